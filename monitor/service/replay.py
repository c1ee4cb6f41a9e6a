"""Replay of a log through the monitoring loop."""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from daq import (
    AnyLog,
    Block,
    Event,
    Item,
    LogError,
    LogExcerpt,
    McapWriter,
    inspect_log,
    read_attachments,
    read_events,
    read_log,
)
from daq.events import DeviceFailed
from daq.log import BEGINNING, END, HOW_TO_PLACE, absent_devices, files_of, read_channel_map, used_axes
from monitor.results.replay_comparison import ReplayComparison, compare_results
from monitor.results.service_events import Stopped
from monitor.results.windows import TOPIC_WINDOW, Result, WindowResult, event_result, result_event
from monitor.service.processes import trim_before
from monitor.service.site import Site
from monitor.settings import (
    Override,
    attachable,
    attached_structure,
    has_settings,
    overridden,
    parse_attached,
    parse_settings,
)
from monitor.watch.backlog import as_logged
from monitor.watch.memory import MEMORY, NOTHING, check_saved_state, memory_text, parse_memory
from monitor.watch.pipeline import Pipeline

NO_SETTINGS = "has no settings attached: give --site"


@dataclass(frozen=True, eq=False, kw_only=True)
class ReplayReport:
    """Results of a replay, with the live results in the log."""

    found: list[Result]
    logged: list[Result]
    attached: Mapping[str, str]  #: name -> text: attachments of the log, with the settings that were used
    memory: str  #: state to be continued, as text; empty if there was none
    window_seconds: float  #: length of a window [s]
    from_beginning: bool = True  #: False for an excerpt with a later start: its baseline is not that of the live run

    @cached_property
    def comparison(self) -> ReplayComparison:
        """Return the agreement of the replay with the live results."""
        return compare_results(self.found, self.logged)

    @property
    def same(self) -> bool:
        """Return whether the replay repeats the live results to the last digit, as far as those go."""
        return self.comparison.kind == "identical"


def replay(
    log: AnyLog, site: Site | None, on_result: Callable[[Result], None], given: Sequence[Override] = ()
) -> ReplayReport:
    """Run the monitoring loop over a log.

    Parameters
    ----------
    log : its path, all files of a run, or an excerpt: one that does not begin with the log learns a baseline of its own
    site : settings to use instead of those attached to the log
    on_result : called with everything that is found
    given : overrides of the settings attached to the log

    Raises
    ------
    LogError
        If the log cannot be read, is damaged, has no settings attached, or has devices unknown to the settings.
    SettingsError
        If the settings attached cannot be used.
    """
    attached = read_attachments(log)
    if site is None and not has_settings(attached):
        raise LogError(str(log), _how_to(log, NO_SETTINGS))
    if site:
        texts = (site.structure_text, site.site_text)
        settings = parse_settings(site.site_text, f"{log}: site.toml")
    else:
        text, origins = overridden(attachable(attached["site.toml"]), given)
        texts = (attached.get("structure.toml", ""), text)
        settings = parse_settings(text, f"{log}: site.toml", origins)
    axes = used_axes(settings.channels, [device.name for device in settings.device])
    from_beginning = not isinstance(log, LogExcerpt) or log.start == BEGINNING
    if not from_beginning:
        attached = {name: text for name, text in attached.items() if name != MEMORY}
    logged: list[Result] = []
    found: list[Result] = []
    memory = _memory(attached, texts)
    skip = as_logged(frozenset() if site or not from_beginning else _skipped(log))
    known = parse_memory(memory) if memory else None
    pipeline = Pipeline(attached_structure(texts[0]), parse_attached(texts[1]), known, skip, trim_before)
    for item in _items(log, logged, axes):
        for result in pipeline.push(item):
            found.append(result)
            on_result(result)
    return ReplayReport(
        found=found,
        logged=_comparable(log, logged, found) if from_beginning else [],
        attached=_attached(attached, texts, memory),
        memory=memory_text(pipeline.memory) if found else "",
        window_seconds=settings.analysis.window_seconds,
        from_beginning=from_beginning,
    )


def _attached(attached: Mapping[str, str], texts: tuple[str, str], memory: str) -> dict[str, str]:
    """Return the attachments of a watched log: as in the log, but with the settings and the state that were used."""
    rest = {name: text for name, text in attached.items() if name != MEMORY}
    used = {"structure.toml": texts[0], "site.toml": texts[1], MEMORY: memory}
    return {name: text for name, text in (rest | used).items() if text}


def _comparable(log: AnyLog, logged: list[Result], found: Sequence[Result]) -> list[Result]:
    """Return the live results that a replay can repeat: of an excerpt up to the last complete window."""
    if not isinstance(log, LogExcerpt) or log.stop == END:
        return logged
    last = max((result.end for result in found if isinstance(result, WindowResult)), default=BEGINNING)
    return [result for result in logged if result_event(result).time <= last]


def write_watched(log: AnyLog, path: Path, report: ReplayReport) -> None:
    """Write a log again with the results of a replay, as if it had been monitored so.

    A whole log without the end of a run, as one that was imported, gets it.

    Parameters
    ----------
    log : its path, or all files of a run
    path : of the new file
    report : of its replay

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    """
    writer, results = McapWriter(path, report.attached), deque(map(result_event, report.found))
    ended, last = not inspect_log(files_of(log)[-1]).whole, 0
    for item in read_log(log):
        if isinstance(item, Event) and event_result(item) is not None:
            continue
        last = item.time if isinstance(item, Event) else item.arrival_time
        ended |= isinstance(item, Event) and item.topic == Stopped.topic
        while results and results[0].time <= last:
            writer.write(results.popleft())
        writer.write(item)
    for result in results:
        writer.write(result)
    if not ended:
        writer.write(Stopped().event(last))
    writer.close()


def _how_to(log: AnyLog, why: str) -> str:
    """Return why a log cannot be replayed; of an imported one with how it gets the devices of a site."""
    return f"{why}; {HOW_TO_PLACE}" if read_channel_map(log) else why


def _memory(attached: Mapping[str, str], texts: tuple[str, str]) -> str:
    """Return the starting state of the run, if it belongs to the replayed baseline; else nothing."""
    text = attached.get(MEMORY, "")
    found = (
        check_saved_state(text, f"attached {MEMORY}", attached_structure(texts[0]), parse_settings(texts[1]))
        if text
        else NOTHING
    )
    return found.text or ""


def _skipped(log: AnyLog) -> frozenset[int]:
    """Return the windows that were left out live, by number; of a damaged log as far as it can be read."""
    found: set[int] = set()
    by_index = log if isinstance(log, LogExcerpt) else LogExcerpt(log=log, text="")
    with suppress(LogError):
        for event in read_events(by_index, [TOPIC_WINDOW]):
            if event.payload.get("skipped"):
                found.add(int(event.payload.get("index", -1)))
    return frozenset(found)


def _items(log: AnyLog, logged: list[Result], axes: Mapping[str, Collection[int]]) -> Iterator[Item]:
    """Yield the items of a log to be analysed, up to where it stopped, was cut or is damaged.

    Parameters
    ----------
    log : as for `replay`
    logged : takes its results
    axes : device -> axes that are analysed
    """
    for device in absent_devices(log, axes):
        yield DeviceFailed(device=device).event(0)
    stopped = False
    for item in read_log(log, axes, others=True):
        if isinstance(item, Block) and item.device not in axes:
            why = f"holds device {item.device!r}; the settings have {', '.join(axes)}"
            raise LogError(str(log), _how_to(log, why))
        result = event_result(item) if isinstance(item, Event) else None
        if result is not None:
            logged.append(result)
        elif not stopped:
            stopped = isinstance(item, Event) and item.topic == Stopped.topic
            if not stopped:
                yield item

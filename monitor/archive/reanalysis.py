"""Reanalysis: windows identified in parallel, then evaluated per site in order of time.

Each log is identified by one task of Dask; the steps of a log (`steps`) are kept by the hash of its content and of the
settings that they depend on, so that a repeated run computes only what is new. The evaluation of a log continues from
the state at the end of the log before it, as a monitor does after a restart.
"""

import hashlib
import json
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq import Event, LogError, McapWriter, read_attachments
from daq.log import log_span
from monitor.archive.catalog import ArchiveLog
from monitor.archive.dataset import keep_parts, write_tables
from monitor.archive.steps import LogSteps, identify_log, unpacked
from monitor.errors import MonitorError
from monitor.outputs.history import HistoryStore
from monitor.results.events import result_event
from monitor.results.windows import Result
from monitor.settings import attached_structure, has_settings, parse_attached
from monitor.watch.memory import MEMORY, VERSION, check_saved_state, memory_text, parse_memory
from monitor.watch.pipeline import Pipeline
from updater import UpdaterError

if TYPE_CHECKING:
    from distributed import Client, Future

RESULTS_LOG = "results.mcap"  #: of a site: events and results of all its logs, without signals
_NO_SITE = "unknown"  # in the tables, of logs that cannot be read
_WAITING = 4  # logs per worker that are submitted before a result is there


@dataclass(frozen=True, kw_only=True)
class LogTexts:
    """Attachments of a log that its analysis depends on."""

    site: str
    structure: str
    memory: str = ""
    start: int = 0  #: time of the first scan [ns UTC]


@dataclass(frozen=True, kw_only=True)
class AnalysedLog:
    """Log after its reanalysis."""

    log: ArchiveLog
    site: str
    n_windows: int
    seconds: float  #: of data
    problem: str | None  #: reason why it was not analysed, or not to its end
    kept: bool  #: whether its steps were kept by an earlier run


OnLog = Callable[[AnalysedLog, list[Result]], None]
_Task = tuple[str, ArchiveLog, LogTexts, str]  # site, log, its texts, key of its steps


def texts_of(log: ArchiveLog, site: LogTexts | None) -> LogTexts | str:
    """Return what a log is analysed with, or the reason why it cannot be."""
    try:
        attached, span = read_attachments(log.log), log_span(log.log)
    except LogError as error:
        return str(error)
    start, memory = span[0] if span else 0, attached.get(MEMORY, "")
    if site:
        return replace(site, memory=memory, start=start)
    if not has_settings(attached):
        return "has no settings attached: give --site"
    try:
        parse_attached(attached["site.toml"])
        attached_structure(attached.get("structure.toml", ""))
    except (MonitorError, UpdaterError) as error:
        return f"has settings that cannot be used: {error}"
    return LogTexts(
        site=attached["site.toml"], structure=attached.get("structure.toml", ""), memory=memory, start=start
    )


def identify_task(log: ArchiveLog, texts: LogTexts, limit: float = math.inf) -> LogSteps:
    """Identify one log, in a worker, within a time [s]; what is wrong with the log is part of the result."""
    try:
        return identify_log(log.log, parse_attached(texts.site), limit)
    except LogError as error:
        return LogSteps(packed=identify_nothing(), n_windows=0, seconds=0.0, problem=str(error))


def identify_nothing() -> bytes:
    """Return the packed steps of a log without any."""
    import zstandard

    return zstandard.ZstdCompressor().compress(b"")


def site_name(texts: LogTexts) -> str:
    """Return the name of a site: that of its structure; without one that of its history."""
    structure = attached_structure(texts.structure)
    name = structure.name if structure else parse_attached(texts.site).history.site or ""
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name) or "unnamed"


def steps_key(log: ArchiveLog, texts: LogTexts) -> str:
    """Return the hash that the steps of a log depend on: its content, the settings of its analysis, this program."""
    settings = parse_attached(texts.site)
    analysis = settings.analysis
    depends = {
        "version": VERSION,
        "log": log.key,
        "window": [analysis.window_seconds, settings.step_seconds, analysis.band],
        "channels": [[c.name, c.device, c.axis] for c in settings.channels],
        "devices": [[d.name, d.rate] for d in settings.device],
    }
    return hashlib.sha256(json.dumps(depends).encode()).hexdigest()[:32]


class _SiteRun:
    """Evaluation of the logs of one site, in order.

    Parameters
    ----------
    folder : of the site's results: `results.mcap` with all events and results, a history, and the saved state
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: McapWriter | None = None
        self._events: list[Event] = []  # of the last log, with its results
        self.memory = ""
        self._pipeline: Pipeline | None = None  # of the last log
        self._texts = ("", "")  # that it was made from
        self.waiting: deque[tuple[ArchiveLog, LogTexts, str]] = deque()
        self.steps: dict[str, tuple[LogSteps, bool]] = {}

    def evaluate(self, texts: LogTexts, steps: LogSteps) -> list[Result]:
        """Evaluate the next log, from the state at the end of the one before; of the first one, from its own."""
        pipeline = self._pipeline_of(texts)
        results: list[Result] = []
        for step in unpacked(steps.packed):
            found = list(pipeline.resume(step) if isinstance(step, int) else pipeline.push_identified(step))
            self._events += [step] if isinstance(step, Event) else []
            self._events += map(result_event, found)
            results += found
        self.memory = memory_text(pipeline.memory)
        return results

    def _pipeline_of(self, texts: LogTexts) -> Pipeline:
        """Return the pipeline of the log before, or with other settings a new one from its state."""
        if self._pipeline and self._texts == (texts.site, texts.structure):
            self._pipeline.begin_log()
            return self._pipeline
        structure, settings = attached_structure(texts.structure), parse_attached(texts.site)
        saved = self.memory or texts.memory
        known = check_saved_state(saved, MEMORY, structure, settings).text if saved else None
        self._pipeline = Pipeline(structure, settings, parse_memory(known) if known else None)
        self._texts = (texts.site, texts.structure)
        return self._pipeline

    def store(self, texts: LogTexts, results: Sequence[Result]) -> None:
        """Add a log to the results of the site, which are begun anew, and replace its saved state."""
        path, log = self._folder / "history.sqlite", self._folder / RESULTS_LOG
        if self._writer is None:
            self._folder.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            log.unlink(missing_ok=True)
            attached = {"site.toml": texts.site} | ({"structure.toml": texts.structure} if texts.structure else {})
            self._writer = McapWriter(log, {**attached, **({MEMORY: texts.memory} if texts.memory else {})})
        for event in self._events:
            self._writer.write(event)
        self._events = []
        history = HistoryStore(f"sqlite:///{path}")
        try:
            history.write([result_event(result) for result in results])
        finally:
            history.__exit__()
        if self.memory:
            (self._folder / MEMORY).write_text(self.memory, encoding="utf-8")

    def close(self) -> None:
        """Finish the log of results."""
        if self._writer is not None:
            self._writer.close()


def reanalyse(
    client: "Client",
    logs: Sequence[tuple[ArchiveLog, LogTexts | str]],
    out: Path,
    on_log: OnLog,
    limit: float = math.inf,
) -> None:
    """Reanalyse logs and write the results.

    Parameters
    ----------
    client : of Dask
    logs : with their texts, or the reasons why they cannot be analysed
    out : folder of the results: tables as Parquet, `steps`, and per site a log of results, a history, a saved state
    on_log : called with each log once it is evaluated, and its results
    limit : on the time for the identification of one log [s]; a repeated run begins such a log anew
    """
    sites: dict[str, _SiteRun] = {}
    tasks: deque[_Task] = deque()
    (out / "steps").mkdir(parents=True, exist_ok=True)
    for log, why in ((log, texts) for log, texts in logs if isinstance(texts, str)):
        refused = AnalysedLog(log=log, site=_NO_SITE, n_windows=0, seconds=0.0, problem=why, kept=False)
        _finish(out, refused, [], on_log)
    readable = [(log, texts) for log, texts in logs if isinstance(texts, LogTexts)]
    for log, texts in sorted(readable, key=lambda entry: entry[1].start):
        site, key = site_name(texts), steps_key(log, texts)
        if site not in sites:
            sites[site] = _SiteRun(out / "sites" / site)
        sites[site].waiting.append((log, texts, key))
        tasks.append((site, log, texts, key))
    with ExitStack() as stack:
        for run in sites.values():
            stack.callback(run.close)
        for site, key, steps, kept in _identified(client, tasks, out / "steps", stack, limit):
            run = sites[site]
            run.steps[key] = (steps, kept)
            while run.waiting and run.waiting[0][2] in run.steps:
                log, texts, first = run.waiting.popleft()
                found, was_kept = run.steps[first]
                results, problem = _evaluated(run, texts, found)
                about = AnalysedLog(
                    log=log, site=site, n_windows=found.n_windows, seconds=found.seconds, problem=problem, kept=was_kept
                )
                _finish(out, about, results, on_log)
                run.store(texts, results)
                del run.steps[first]
    keep_parts(out, {log.key for log, _ in logs}, {*sites, _NO_SITE})


def _evaluated(run: _SiteRun, texts: LogTexts, steps: LogSteps) -> tuple[list[Result], str | None]:
    try:
        return run.evaluate(texts, steps), steps.problem
    except (MonitorError, UpdaterError) as error:
        return [], str(error)


def _identified(
    client: "Client", tasks: deque[_Task], folder: Path, stack: ExitStack, limit: float
) -> Iterator[tuple[str, str, LogSteps, bool]]:
    """Yield site and key of each log with its steps, as they are ready; new ones are kept in a folder."""
    from distributed import as_completed

    running: dict[Future[LogSteps], tuple[str, str]] = {}
    ready = as_completed()
    stack.callback(lambda: client.cancel(list(running)))
    left = deque(tasks)
    most = _WAITING * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    while left or running:
        while left and len(running) < most:
            site, log, texts, key = left.popleft()
            known = steps_of(folder, key)
            if known is not None:
                yield site, key, known, True
                continue
            future = client.submit(identify_task, log, texts, limit, key=f"identify-{key}", pure=False)
            running[future] = (site, key)
            ready.add(future)
        if not running:
            continue
        future = next(ready)
        site, key = running.pop(future)
        try:
            steps: LogSteps = future.result()
        except Exception as error:  # noqa: BLE001 - a log that ends its workers; the others go on
            steps = LogSteps(
                packed=identify_nothing(), n_windows=0, seconds=0.0, problem=f"{type(error).__name__}: {error}"
            )
        else:
            if not steps.late:
                _write_steps(folder / key, steps)
        yield site, key, steps, False


def steps_of(folder: Path, key: str) -> LogSteps | None:
    """Return the kept steps of a log; None if there are none, or they are damaged."""
    try:
        head, _, packed = (folder / key).read_bytes().partition(b"\n")
        about = json.loads(head)
        if about.pop("sha256") != hashlib.sha256(packed).hexdigest():
            return None
        return LogSteps(packed=packed, **about)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_steps(path: Path, steps: LogSteps) -> None:
    about: dict[str, Any] = {"n_windows": steps.n_windows, "seconds": steps.seconds, "problem": steps.problem}
    about["sha256"] = hashlib.sha256(steps.packed).hexdigest()
    unfinished = path.with_suffix(".part")
    unfinished.write_bytes(json.dumps(about).encode() + b"\n" + steps.packed)
    unfinished.replace(path)


def _finish(
    out: Path,
    about: AnalysedLog,
    results: list[Result],
    on_log: OnLog,
) -> None:
    row: Mapping[str, Any] = {
        "bytes": about.log.size,
        "windows": about.n_windows,
        "seconds": about.seconds,
        "problem": about.problem,
    }
    write_tables(out, about.site, about.log.key, about.log.name, results, row)
    on_log(about, results)

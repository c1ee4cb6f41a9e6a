"""Analysis of a log, repeated at full speed."""

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from daq import AnyLog, LogError
from monitor.analysis.modal_table.series import SERIES, read_series
from monitor.analysis.time_range import TimeRange
from monitor.cli.logs.modal_series import series_site, watch_series, write_series
from monitor.cli.logs.run_log import one_log
from monitor.cli.output import write_json
from monitor.cli.site.console_log import line
from monitor.cli.terminal import console, echo, files_of_logs, progress, warn
from monitor.errors import ArgumentError
from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult
from monitor.service.processes import keep_freed_memory
from monitor.service.replay import ReplayReport, replay, write_watched
from monitor.service.site import Site, load_site
from monitor.settings import Override, overrides


def replay_log(
    logs: Sequence[Path],
    site: Path | None,
    given: Sequence[str],
    within: TimeRange,
    *,
    json_path: Path | None,
    watched: Path | None,
) -> int:
    """Run the loop over a log, or over a series of modes; 1 if it ends in an alarm."""
    if watched and watched.exists():
        raise LogError(watched, "cannot be written: File exists")
    if len(logs) == 1 and logs[0].suffix.lower() in SERIES:
        if not within.whole:
            raise ArgumentError(", ".join(within.options), "not of a series of modes: leave rows out of the file")
        return _replay_series(logs[0], site, given, json_path, watched)
    log = within.of_log(one_log(logs), echo)
    report = _replay(log, load_site(site, given) if site else None, overrides(given, {}))
    if json_path:
        results = [result.payload() for result in report.found]
        compared = report.from_beginning
        found = {
            "same_as_live": report.same if compared else None,
            "comparison": report.comparison.payload() if compared else None,
            "results": results,
        }
        write_json(json_path, found)
    note = _nothing_watched(report)
    if note:
        warn(f"note: {note}")
    if watched:
        with progress("writing", files_of_logs([log])):
            write_watched(log, watched, report)
        echo(f"written: {watched}, for `report` and `view`")
    elif not (report.logged or note):
        console.print(
            "note: `-o WATCHED.mcap` writes a log with these results, for `report` and `view`", style="yellow"
        )
    if not report.from_beginning:
        warn("note: not compared with the live results: the baseline is learned from the start of the range")
    if report.logged and not (site or given):
        echo(report.comparison.text, divide=True)
    return _exit_code(report.found)


def _replay(log: AnyLog, site: Site | None, given: Sequence[Override]) -> ReplayReport:
    """Replay a log, and print its results."""
    keep_freed_memory()
    with progress("replaying") as work:
        work.windows_of("replaying", [log])

        def show(result: Result) -> None:
            if isinstance(result, WindowResult):
                work.window(result.end)
            _say(result)

        return replay(log, site, show, given)


def _replay_series(
    path: Path, site: Path | None, given: Sequence[str], json_path: Path | None, watched: Path | None
) -> int:
    """Watch a series of modes."""
    series = read_series(path)
    for name in series.ignored:
        warn(f"note: column {name} is not used")
    used = series_site(series, site, given)
    with progress("watching") as work:

        def show(result: Result) -> None:
            if isinstance(result, WindowResult):
                work.advance(result.index + 1, len(series.time))
            _say(result)

        found = watch_series(series, used, show)
    if json_path:
        results = [result.payload() for result in found]
        write_json(json_path, {"same_as_live": None, "comparison": None, "results": results})
    if not any(isinstance(result, ReferenceResult) for result in found):
        warn(f"note: {_nothing_learned(found, used.settings.analysis.first_windows)}")
    if watched:
        write_series(watched, series, used, found)
        echo(f"written: {watched}, for `report` and `view`")
    return _exit_code(found)


def _nothing_learned(found: Sequence[Result], first: int) -> str:
    """Return how many rows a series lacks for a baseline.

    Parameters
    ----------
    first : rows with modes that the baseline has at least
    """
    learning = [result.learning for result in found if isinstance(result, WindowResult) and result.learning]
    n, needed = (learning[-1].windows, learning[-1].target) if learning else (0, first)
    return f"no baseline is learned: {n} rows with modes, expected {needed} or more (analysis.baseline_windows)"


def _exit_code(found: Sequence[Result]) -> int:
    alarms = [result for result in found if isinstance(result, AlarmResult)]
    return int(bool(alarms) and alarms[-1].state == "alarm")


def _nothing_watched(report: ReplayReport) -> str:
    """Return the reason why no window was scored; nothing if one was."""
    windows = [result for result in report.found if isinstance(result, WindowResult)]
    if not windows:
        return (
            f"there is no whole window of {report.window_seconds:g} s (analysis.window_seconds): nothing was analysed"
        )
    if any(isinstance(result, ReferenceResult) for result in report.found) or windows[-1].phase != "learning":
        return ""
    n_learned = sum(bool(window.modes) for window in windows)
    short = ""
    if n_learned < len(windows) / 2:
        short = f"; are records shorter than a window of {report.window_seconds:g} s (analysis.window_seconds)?"
    return f"the log ended before the baseline was complete: {n_learned} of {len(windows)} windows gave modes{short}"


def _say(result: Result) -> None:
    """Print one result as a line."""
    console.print(escape(line(result)))

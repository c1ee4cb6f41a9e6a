"""`run` and `replay`."""

import json
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from threading import Event

from rich.console import Console
from rich.markup import escape

from daq import LogError
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.cli.data.log import one_log
from monitor.cli.exit_codes import DONE
from monitor.cli.site.console_log import journal, line
from monitor.cli.site.send import send_command, standing_if_known
from monitor.cli.terminal import Terminal, say_range
from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult
from monitor.service.daemon import reload_on_signal, run, stop_on_signals
from monitor.service.operator_commands import Acknowledgement
from monitor.service.processes import give_back_memory, spare_what_is_loaded
from monitor.service.replay import ReplayReport, replay, write_watched
from monitor.service.servers.live_view import LiveView, live_view
from monitor.service.site import Site, load_site
from monitor.service.startup.instance_lock import only_one
from monitor.service.startup.repair_logs import mend_logs
from monitor.settings import overrides
from monitor.text.quantities import utc
from monitor.watch.memory import recall
from updater import parse_structure

console = Terminal()


def say(result: Result) -> None:
    """Print one result as a line."""
    console.print(escape(line(result)))


def run_command(path: Path, given: Sequence[str] = (), *, as_json: bool = False) -> int:
    """Monitor a site until it is stopped.

    Parameters
    ----------
    path : of SITE.toml
    given : KEY=VALUE each, which override the file
    as_json : whether events are printed as JSON, one object per line
    """
    give_back_memory()
    os.umask(os.umask(0o077) | 0o027)  # logs and state: for the owner and the group
    site = load_site(path, given)
    with only_one(site.state), stop_on_signals() as stop, reload_on_signal() as hangup:
        return _watch(site, stop, partial(_reread, hangup, partial(load_site, path, given)), as_json=as_json)


def _watch(site: Site, stop: Event, reread: Callable[[], Site | None], *, as_json: bool) -> int:
    mended = list(mend_logs(site.folder / site.settings.recorder.folder))
    for message in mended:
        console.print(escape(message), soft_wrap=True)
    recalled = recall(site.state, parse_structure(site.structure_text), site.settings)
    with (
        live_view(site.settings, site.structure_text, site.site_text) as live,
        journal(as_json=as_json) as lines,
    ):
        tell_live(console, live)
        _tell_page(site)
        spare_what_is_loaded()
        report = run(
            site,
            stop,
            _nothing,
            live,
            takers=(lines.take,),
            recalled=recalled,
            mended=mended,
            reread=reread,
        )
    tell_live_end(console, live)
    for path in report.logs:
        console.print(f"log: {path}", soft_wrap=True)
    if report.dropped or report.disk_failure:
        console.print(f"not in the log: {report.dropped} items; disk: {report.disk_failure or 'ok'}")
    return DONE


def _tell_page(site: Site) -> None:
    """Print the address of the pages."""
    web = site.settings.web
    if web:
        console.print(
            f"status page: http://{f'[{web.bind}]' if ':' in web.bind else web.bind}:{web.port}", soft_wrap=True
        )


def _reread(hangup: Event, read_again: Callable[[], Site]) -> Site | None:
    """Return the present settings, if a signal has requested a reload."""
    if not hangup.is_set():
        return None
    hangup.clear()
    return read_again()


def _nothing(_: Result) -> None:
    """Results are printed as they are in the log."""


def acknowledge_command(path: Path, by: str, note: str) -> int:
    """Send the acknowledgement of its alarm to the monitor of a site."""
    site = load_site(path)
    found = standing_if_known(site)
    known = f"the alarm of {utc(found.raised)}: {found.text}" if found else "the history has no active alarm"
    console.print(escape(known), soft_wrap=True)
    send_command(site, Acknowledgement(by=by, note=note))
    return DONE


def tell_live(console: Console, live: LiveView) -> None:
    """Print the address of the live view, or the reason why there is none."""
    if live.text:
        console.print(live.text, soft_wrap=True, markup=False)


def tell_live_end(console: Console, live: LiveView) -> None:
    """Print the amount of data that the live view dropped."""
    if live.served and (live.dropped or live.problem):
        console.print(
            f"live view: {live.dropped} items not shown; {live.problem or 'ok'}", soft_wrap=True, markup=False
        )


def replay_command(
    logs: Sequence[Path],
    site: Path | None,
    json_path: Path | None,
    watched: Path | None = None,
    given: Sequence[str] = (),
    within: TimeRange = WHOLE,
) -> int:
    """Run the loop over a log; 1 if it ends in an alarm.

    Parameters
    ----------
    logs : a log, or all files of a run
    site : of SITE.toml, instead of the attached one
    json_path : file for the results
    watched : new log for the whole log and the results
    given : KEY=VALUE each, which override the settings
    within : range of the log
    """
    log = within.of_log(one_log(logs), say_range)
    if watched and watched.exists():
        raise LogError(watched, "cannot be written: File exists")
    report = replay(log, load_site(site, given) if site else None, say, overrides(given, {}))
    if json_path:
        results = [result.payload() for result in report.found]
        compared = report.from_beginning
        found = {
            "same_as_live": report.same if compared else None,
            "comparison": report.comparison.payload() if compared else None,
            "results": results,
        }
        json_path.write_text(json.dumps(found), encoding="utf-8")
    note = _nothing_watched(report)
    if note:
        console.print(f"note: {note}", style="yellow", soft_wrap=True, markup=False)
    if watched:
        write_watched(log, watched, report)
        console.print(f"written: {watched}, for `report` and `view`", soft_wrap=True, markup=False)
    elif not (report.logged or note):
        console.print("note: `-o WATCHED.mcap` writes a log with this, for `report` and `view`", style="yellow")
    if not report.from_beginning:
        console.print(
            "note: not compared with what was found live: the baseline is learnt from the beginning of the range",
            style="yellow",
            soft_wrap=True,
        )
    if report.logged and not (site or given):
        console.print(report.comparison.text, soft_wrap=True, markup=False)
    alarms = [result for result in report.found if isinstance(result, AlarmResult)]
    return int(bool(alarms) and alarms[-1].state == "alarm")


def _nothing_watched(report: ReplayReport) -> str:
    """Return the reason why no window was scored; nothing if one was."""
    windows = [result for result in report.found if isinstance(result, WindowResult)]
    if not windows:
        return (
            f"there is no whole window of {report.window_seconds:g} s (analysis.window_seconds): nothing was looked at"
        )
    if any(isinstance(result, ReferenceResult) for result in report.found) or windows[-1].phase != "learning":
        return ""
    learnt = sum(bool(window.modes) for window in windows)
    short = ""
    if learnt < len(windows) / 2:
        short = f"; are records shorter than a window of {report.window_seconds:g} s (analysis.window_seconds)?"
    return f"the log ended while the watch was still learning: {learnt} of {len(windows)} windows gave modes{short}"

"""Monitoring of a site until it is stopped."""

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from signal import SIGHUP
from threading import Event

from daq.log import repair_folder
from daq.signals import STOP_SIGNALS, signal_event
from monitor.cli.options import DONE
from monitor.cli.site.console_log import journal
from monitor.cli.terminal import console, echo
from monitor.results.windows import Result
from monitor.service.daemon import run
from monitor.service.processes import give_back_memory, spare_what_is_loaded
from monitor.service.servers.live_view import LiveView, live_view
from monitor.service.site import Site, load_site
from monitor.service.startup.instance_lock import only_one
from monitor.settings import attached_structure
from monitor.watch import memory


def monitor_site(path: Path, given: Sequence[str], *, as_json: bool) -> int:
    """Monitor a site until it is stopped; `given` are KEY=VALUE each, which override the file."""
    give_back_memory()
    os.umask(os.umask(0o077) | 0o027)  # logs and state: for the owner and the group
    site = load_site(path, given)
    with only_one(site.state), signal_event(*STOP_SIGNALS) as stop, signal_event(SIGHUP) as hangup:
        return _watch(site, stop, partial(_reread, hangup, partial(load_site, path, given)), as_json=as_json)


def _watch(site: Site, stop: Event, reread: Callable[[], Site | None], *, as_json: bool) -> int:
    repairs = list(repair_folder(site.folder / site.settings.recorder.folder))
    for message in repairs:
        echo(message)
    recalled = memory.NOTHING
    if (site.state / memory.MEMORY).exists():
        recalled = memory.recall(site.state, attached_structure(site.structure_text), site.settings)
    with (
        live_view(site.settings, site.structure_text, site.site_text) as live,
        journal(as_json=as_json) as lines,
    ):
        tell_live(live)
        web = site.settings.web
        if web:
            echo(f"status page: http://{f'[{web.bind}]' if ':' in web.bind else web.bind}:{web.port}")
        spare_what_is_loaded()
        report = run(
            site,
            stop,
            _nothing,
            live,
            takers=(lines.take,),
            recalled=recalled,
            repairs=repairs,
            reread=reread,
        )
    tell_live_end(live)
    for path in report.logs:
        echo(f"log: {path}")
    if report.dropped or report.disk_failure:
        console.print(f"not in the log: {report.dropped} items; disk: {report.disk_failure or 'ok'}")
    return DONE


def _reread(hangup: Event, read_again: Callable[[], Site]) -> Site | None:
    """Return the present settings, if a signal has requested a reload."""
    if not hangup.is_set():
        return None
    hangup.clear()
    return read_again()


def _nothing(_: Result) -> None:
    """Results are printed as they are in the log."""


def tell_live(live: LiveView) -> None:
    """Print the address of the live view, or the reason why there is none."""
    if live.text:
        echo(live.text)


def tell_live_end(live: LiveView) -> None:
    """Print the amount of data that the live view dropped."""
    if live.served and (live.dropped or live.problem):
        echo(f"live view: {live.dropped} items not shown; {live.problem or 'ok'}")

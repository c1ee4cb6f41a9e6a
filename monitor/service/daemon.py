"""The monitoring service: start, loop, stop."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from daq import DaqError, Item
from daq.supervision import error_text, short_line
from monitor.errors import MonitorError
from monitor.results.windows import Result
from monitor.service.servers.live_view import LiveView
from monitor.service.site import Site
from monitor.service.site_run import SiteRun
from monitor.service.systemd.notify import ServiceManager
from monitor.watch.memory import NOTHING, LoadedState
from updater import UpdaterError

_MAX_REFUSAL = 500  # characters


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """Result of a run."""

    logs: tuple[Path, ...]  #: the files, in the order of writing
    dropped: int  #: items that the log's queue had no room for
    disk_failure: str | None

    @property
    def log(self) -> Path:
        """The log, or the folder of its files if there is more than one."""
        return self.logs[0] if len(self.logs) == 1 else self.logs[0].parent


def run(
    site: Site,
    stop: threading.Event,
    on_result: Callable[[Result], None],
    live: LiveView | None = None,
    *,
    takers: Sequence[Callable[[Item], None]] = (),
    recalled: LoadedState = NOTHING,
    repairs: Sequence[str] = (),
    reread: Callable[[], Site | None] = lambda: None,
) -> RunReport:
    """Watch until `stop` is set: readers and writer in threads, analysis in a process.

    Parameters
    ----------
    site : devices and settings
    stop : ends it; data received by then are logged and analysed
    on_result : called in this thread with everything that is found
    live : shows the log, if given
    takers : called in the log's thread with all that is logged; they must not wait
    recalled : state of the run before, to be continued
    repairs : repairs of logs that earlier runs left without an end, as texts
    reread : called at intervals for new settings; None if there are none

    Raises
    ------
    StartError
        If a device does not answer or the log cannot be made.
    """
    manager = ServiceManager()
    with SiteRun(site, on_result, live, takers, recalled, repairs) as running:
        manager.ready()
        while not stop.is_set():
            if running.poll():
                manager.status(running.status.line)
            manager.feed(running.signs)
            _reload(running, reread, manager)
        manager.stopping()
        running.finish()
    return RunReport(logs=running.logs.files, dropped=running.logs.dropped, disk_failure=running.logs.disk_failure)


def _reload(running: SiteRun, reread: Callable[[], Site | None], manager: ServiceManager) -> None:
    """Continue with new settings if there are any; invalid ones are refused, whatever error they raise."""
    try:
        site = reread()
    except Exception as error:  # noqa: BLE001 - a file may raise anything; the watch goes on with the settings it has
        running.refuse(_refusal(error))
        return
    if site is None:
        return
    manager.reloading()
    try:
        running.reload(site)
    except Exception as error:  # noqa: BLE001 - likewise
        running.refuse(_refusal(error))
    manager.ready()


def _refusal(error: Exception) -> str:
    """Return in one line why settings cannot be used."""
    if isinstance(error, DaqError | MonitorError | UpdaterError):
        return short_line(str(error), _MAX_REFUSAL)
    return f"the settings cannot be used: {error_text(error)}"

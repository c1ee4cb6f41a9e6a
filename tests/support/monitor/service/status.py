"""Status of a healthy monitor, and of a run in alarm that serves it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daq import SystemClock
from monitor.analysis.temperature import reading
from monitor.results.site_status import FILE_NAME, Counters, PartProblems, SiteStatus, read_status
from monitor.service.servers.web import Source, web_process
from monitor.service.status import MonitorStatus, Pace
from tests.support.daq.blocks import make_block
from tests.support.monitor.history import run_events, sqlite_url
from tests.support.processes import free_port

PACE = Pace(step=600.0, window=600.0)
WELL = (
    PartProblems(),
    Counters(disk_free=5 * 10**9, waiting={"log": 3, "analysis": 40}, bad_bytes={"left": 21, "right": 0}),
)


def status_in_alarm(folder: Path) -> MonitorStatus:
    """Return the status of a run that has found a mass, with devices and temperatures."""
    status = MonitorStatus(folder / FILE_NAME, ("left", "right"), PACE, SystemClock())
    for name in ("left", "right"):
        status.take(make_block(name, 0))
    status.take(reading(1, -3.5, "weather.csv"))
    for event in run_events():
        status.take(event)
    return status


def site_status(folder: Path) -> SiteStatus:
    """Return the same as it is read back."""
    status_in_alarm(folder).write(*WELL)
    found = read_status(folder / FILE_NAME)
    assert found is not None
    return found


@contextmanager
def served_run(folder: Path) -> Iterator[int]:
    """Serve the run for as long as the context lasts; give the port. Its status is renewed every second."""
    status, ended = status_in_alarm(folder), threading.Event()

    def renew() -> None:
        while not ended.wait(0.2):
            status.write(*WELL)

    renewing = threading.Thread(target=renew)
    renewing.start()
    try:
        port = free_port()
        with web_process(Source(name="bridge", state=folder, url=sqlite_url(folder)), "127.0.0.1", port, None):
            yield port
    finally:
        ended.set()
        renewing.join()

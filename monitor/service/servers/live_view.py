"""The live view of a running monitor, served from a process of its own: a viewer cannot affect the monitor.

The daemon serves; viewers connect and disconnect. Nothing here waits for a viewer; data that the view cannot take are
dropped and counted. Only the serving process loads rerun.
"""

import multiprocessing
import queue
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.queues import Queue

from daq import Block, Item
from monitor.service.processes import (
    LastWords,
    deaf_to_stop_signals,
    environment,
    handed_over,
    queue_to_child,
    received,
    report_end,
)
from monitor.settings import Settings

_HOST = "127.0.0.1"
_WAITING = 2000  # items that may wait for the view
_END_SECONDS = 3.0
_ENVIRONMENT = {
    "RERUN_ANALYTICS": "0",
    "MIMALLOC_PURGE_DELAY": "0",  # rerun's allocator returns free memory at once; else it grows for hours
}


def live_urls(port: int) -> tuple[str, str]:
    """Return the addresses of results and of signals: two servers, so that signals never push results out."""
    first, second = (f"rerun+http://{_HOST}:{p}/proxy" for p in (port, port + 1))
    return first, second


class LiveView:
    """Live view of a running monitor.

    Parameters
    ----------
    settings : of the site; without a [viewer] section nothing is served
    structure, site : texts of the structure's and the site's TOML
    """

    def __init__(self, settings: Settings, structure: str, site: str) -> None:
        self._settings, self._arguments = settings, (structure, site)
        self._process: multiprocessing.context.SpawnProcess | None = None
        self.problem: str | None = None  #: why nothing is served any more, or never was
        self.dropped = 0  #: items the view could not take
        self.served = False  #: whether it was ever served

    def start(self) -> None:
        """Start serving; a port in use is reported in `problem`, because the server itself would only log it."""
        viewer = self._settings.viewer
        if viewer is None:
            return
        taken = [port for port in (viewer.port, viewer.port + 1) if not _free(port)]
        if taken:
            self.problem = f"port {taken[0]} of {_HOST} is in use"
            return
        context = multiprocessing.get_context("spawn")
        self._inbox: Queue[Item | None] = queue_to_child(_WAITING)
        self._last_words = LastWords()
        arguments = self._last_words.sender, _serve, *self._arguments, self._inbox
        self._process = context.Process(target=report_end, args=arguments, name="viewer", daemon=True)
        try:
            with environment(_ENVIRONMENT), deaf_to_stop_signals():
                self._process.start()
        except OSError as error:  # the system has no room for another process
            self._process, self.problem = None, f"it cannot be started: {error}"
            return
        self._last_words.started()
        handed_over(self._inbox)
        self.served = True

    def restart(self, settings: Settings, structure: str, site: str) -> None:
        """Serve by other settings, or serve no more."""
        self.stop()
        self._settings, self._arguments, self.problem = settings, (structure, site), None
        self.start()

    def show(self, item: Item) -> None:
        """Pass on a logged item; never blocks and never fails."""
        if self._process is None:
            return
        if not isinstance(item, Block) and not self._process.is_alive():
            self.problem = self._last_words.text(self._process)
            self._process = None
            # there is no reader any more: the end of this process must not wait for it
            self._inbox.cancel_join_thread()
            return
        try:
            self._inbox.put_nowait(item)
        except queue.Full:
            self.dropped += 1

    def stop(self) -> None:
        """Show the waiting items for a moment, then end."""
        if self._process is None:
            return
        self.show_last()
        self._process.join(_END_SECONDS)
        self._inbox.cancel_join_thread()
        self._process.kill()
        self._process.join()
        self._process = None

    def show_last(self) -> None:
        """Show that no more data arrive."""
        try:
            self._inbox.put_nowait(None)
        except queue.Full:
            self.dropped += 1

    @property
    def waiting(self) -> int:
        """Items that the view has not taken yet."""
        return self._inbox.qsize() if self._process else 0

    @property
    def pid(self) -> int:
        """Number of the serving process; 0 if there is none."""
        return (self._process.pid or 0) if self._process else 0

    @property
    def text(self) -> str:
        """Return the address, or the reason why there is none, in one line; empty if not configured."""
        viewer = self._settings.viewer
        if viewer is None:
            return ""
        if self.problem:
            return f"no live view: {self.problem}"
        return f"live view: modalwatch view {live_urls(viewer.port)[0]}"


@contextmanager
def live_view(settings: Settings, structure: str, site: str) -> Iterator[LiveView]:
    """Serve for as long as the context lasts."""
    live = LiveView(settings, structure, site)
    live.start()
    try:
        yield live
    finally:
        live.stop()


def _free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server will: a closed one may linger
        try:
            probe.bind((_HOST, port))
        except OSError:
            return False
    return True


def _serve(structure: str, site: str, inbox: "Queue[Item | None]") -> None:
    """Serve until the last item."""
    from monitor.views.viewer.live import serve  # loads rerun, in this process only
    from monitor.views.viewer.signals.traces import ServerEndedError

    try:
        serve(structure, site, _until_none(received(inbox)))
    except ServerEndedError:  # rerun has reported it: another process took its port meanwhile
        sys.exit(1)


def _until_none(items: Iterator[Item | None]) -> Iterator[Item]:
    for item in items:
        if item is None:
            return
        yield item

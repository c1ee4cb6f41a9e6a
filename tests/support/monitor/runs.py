"""A run in the tests' own process, in a thread, on emulated devices; its analysis is a stand-in by default."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import pytest

from daq import Block, Event, Item, read_log
from monitor.service.daemon import RunReport, run
from monitor.service.site import Site, load_site
from monitor.service.worker import AnalysisError
from monitor.watch.memory import NOTHING, LoadedState
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[recorder]
min_free_gb = 0
"""
DEVICE = """[[device]]
name = "{name}"
driver = "epson-uart"
port = "{port}"
rate = {rate}
channels = {{y = "{name}_y"}}
"""


class QuietWorker:
    """Replaces the analysis, which is not under test here: it ends on request."""

    made: ClassVar[list["QuietWorker"]] = []

    def __init__(self, *_: str) -> None:
        self._stopped, self.died = threading.Event(), False
        self.hangs = False
        self.waiting = 0
        self.made.append(self)

    def __enter__(self) -> "QuietWorker":
        return self

    def __exit__(self, *_: object) -> None:
        """End."""

    def feed(self, item: Item) -> None:
        if isinstance(item, Event) and item.topic == "/event/stopped":
            self._stopped.set()

    def results(self, timeout: float) -> Iterator[None]:
        if self.died:
            raise AnalysisError("the analysis process ended with code -9")
        if self._stopped.wait(timeout) and not self.hangs:
            yield None


class LawState:
    """A run in a thread of its own, and the settings that it is given."""

    def __init__(self, path: Path) -> None:
        self.path, self._stop, self._again = path, threading.Event(), threading.Event()
        self.items: list[Item] = []
        self.recalled: LoadedState = NOTHING  #: of a run before

    def write(self, devices: dict[str, tuple[str, float]], more: str = "") -> None:
        text = (
            SITE
            + more
            + "".join(DEVICE.format(name=name, port=port, rate=rate) for name, (port, rate) in devices.items())
        )
        self.path.write_text(text, encoding="utf-8")

    def reread(self) -> Site | None:
        if not self._again.is_set():
            return None
        self._again.clear()
        return load_site(self.path)

    @contextmanager
    def running(self) -> Iterator[Future[RunReport]]:
        with ThreadPoolExecutor(1) as pool:
            ended = pool.submit(
                run,
                load_site(self.path),
                self._stop,
                print,
                takers=(self.items.append,),
                recalled=self.recalled,
                reread=self.reread,
            )
            try:
                yield ended
            finally:
                self._stop.set()

    def stop(self) -> None:
        self._stop.set()

    def reload(self) -> None:
        self._again.set()

    def events(self, what: str) -> list[Event]:
        return [item for item in tuple(self.items) if isinstance(item, Event) and item.topic == f"/event/{what}"]

    def until(self, true: Callable[[], object], seconds: float = 60.0) -> None:
        """Wait: a reload may take 30 s for the check of a template, and 20 s for the last results of an analysis."""
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, [item for item in self.items if isinstance(item, Event)]
            time.sleep(0.02)

    def until_told(self, what: str, times: int) -> None:
        self.until(lambda: len(self.events(what)) == times)

    def scans(self, device: str) -> int:
        return sum(len(item.counts) for item in tuple(self.items) if isinstance(item, Block) and item.device == device)

    def flows(self, device: str) -> None:
        """Wait until so much more of a device has come as a second of it."""
        before = self.scans(device)
        self.until(lambda: self.scans(device) > before + 100)


def watched_site(folder: Path, monkeypatch: pytest.MonkeyPatch) -> LawState:
    """Return a site in a folder whose analysis has no results."""
    monkeypatch.setattr("monitor.service.log_and_analysis.Worker", QuietWorker)
    QuietWorker.made.clear()
    (folder / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    return LawState(folder / "site.toml")


def blocks(paths: tuple[Path, ...], device: str) -> list[Block]:
    return [item for path in paths for item in read_log(path) if isinstance(item, Block) and item.device == device]

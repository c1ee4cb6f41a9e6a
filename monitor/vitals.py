"""How a running monitor is: what others may look at, written to one small file each second."""

import contextlib
import json
import os
import threading
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from daq import Block, Event, HostClock, Item
from monitor.result_events import event_result
from monitor.results import TOPIC_ALARM, TOPIC_SELF_TEST, TOPIC_WINDOW, AlarmResult, SelfTestResult, WindowResult

NAME = "status.json"
_EVERY = 1.0  # s


@dataclass
class DeviceVitals:
    """One device since the start."""

    scans: int = 0
    gaps: int = 0
    lost: bool = False
    heard: float | None = None  #: wall time of the last block [s since 1970]
    rate: float = 0.0  #: scans a second of wall time since the last look [Hz]
    seen: int = field(default=0, repr=False)  #: scans at the last look


class Vitals:
    """Gathers the state of a run; called from the log's thread and the main one.

    Parameters
    ----------
    path : of the file
    devices : names
    step_seconds : of wall time between windows
    clock : of the data
    """

    def __init__(self, path: Path, devices: tuple[str, ...], step_seconds: float, clock: HostClock) -> None:
        self._clock = clock
        self._late: dict[str, float] = {}  # of results: since their last sample came [s of wall time]
        self._path, self._lock, self._started = path, threading.Lock(), time.time()
        self._devices = {name: DeviceVitals() for name in devices}
        self._step_seconds, self._windowed = step_seconds, self._started
        self._window: dict[str, Any] = {}
        self._self_test = self_test_of(path)
        self._written = self._started
        self._due = 0.0

    def take(self, item: Item) -> None:
        """Take what was logged."""
        with self._lock:
            if isinstance(item, Block):
                self._heard(item)
            elif item.topic in (TOPIC_WINDOW, TOPIC_ALARM):
                self._analysed(item)
            elif item.topic == TOPIC_SELF_TEST:
                self._tested(item)
            else:
                self._happened(item)

    def follow(self, devices: tuple[str, ...], step_seconds: float) -> None:
        """Follow these devices from now on; what is known of those that stay is kept."""
        with self._lock:
            self._devices = {name: self._devices.get(name, DeviceVitals()) for name in devices}
            self._step_seconds = step_seconds

    @property
    def lost(self) -> list[str]:
        """Devices that are lost."""
        with self._lock:
            return [name for name, device in self._devices.items() if device.lost]

    @property
    def silence(self) -> float:
        """Since a block of any device was logged, or since the start [s]."""
        with self._lock:
            heard = [device.heard for device in self._devices.values() if device.heard is not None]
            return time.time() - max(heard, default=self._started)

    @property
    def line(self) -> str:
        """How it is, in a line."""
        with self._lock:
            lost = [name for name, device in self._devices.items() if device.lost]
            state = self._window.get("phase", "no window yet")
            devices = f"{len(self._devices) - len(lost)} of {len(self._devices)} devices"
            return f"{state}; {devices}" + (f", lost: {', '.join(lost)}" if lost else "")

    def write(self, more: dict[str, Any]) -> bool:
        """Write the file once a second, with what else is known; a disk that does not take it is said elsewhere.

        Returns
        -------
        bool
            Whether a second was over.
        """
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + _EVERY
        unfinished = self._path.with_suffix(".part")
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_text(json.dumps(self._content() | more), encoding="utf-8")
            os.replace(unfinished, self._path)
        return True

    def _content(self) -> dict[str, Any]:
        with self._lock:
            now = time.time()
            for device in self._devices.values():
                device.rate = (device.scans - device.seen) / max(now - self._written, 1e-3)
                device.seen = device.scans
            self._written = now
            return {
                "time": now,
                "started": self._started,
                "pid": os.getpid(),
                "step_seconds": self._step_seconds,
                "windowed": self._windowed,
                "window": self._window,
                "late": self._late,
                "self_test": self._self_test,
                "devices": {name: asdict(device) for name, device in self._devices.items()},
            }

    def _heard(self, block: Block) -> None:
        device = self._devices.get(block.device)
        if device is not None:
            device.scans += len(block.counts)
            device.heard, device.lost = time.time(), False

    def _tested(self, event: Event) -> None:
        result = event_result(event)
        if isinstance(result, SelfTestResult):
            self._self_test = result.payload() | {"text": result.text}

    def _happened(self, event: Event) -> None:
        device = self._devices.get(str(event.payload.get("device", "")))
        if device is not None:
            device.gaps += event.topic == "/event/gap"
            device.lost = event.topic == "/event/device_lost" or (device.lost and event.topic != "/event/device_back")

    def _analysed(self, event: Event) -> None:
        result = event_result(event)
        late = (self._clock.now() - event.time) * 1e-9 / self._clock.speed
        if isinstance(result, AlarmResult) and result.raised:
            self._late["alarm"] = late
        if isinstance(result, WindowResult):
            self._late["window"] = late
            self._windowed = time.time()
            self._window = result.model_dump(mode="json", include={"index", "phase", "problem", "novelty", "end"})
            self._window["n_modes"] = len(result.modes)
            self._window["frequencies"] = {mode.id: mode.frequency for mode in result.modes}


def self_test_of(path: Path) -> dict[str, Any] | None:
    """Return the last self-test that a file of vitals tells of: a restart does not make it unknown."""
    try:
        found = json.loads(path.read_text(encoding="utf-8")).get("self_test")
    except (OSError, ValueError, AttributeError):
        return None
    return found if isinstance(found, dict) else None

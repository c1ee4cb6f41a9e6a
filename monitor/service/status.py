"""State of a running monitor, written to one small file once per second."""

import contextlib
import json
import os
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from daq import Block, Event, HostClock, Item, parse_json
from monitor.results.events import event_result
from monitor.results.windows import (
    TOPIC_ALARM,
    TOPIC_REFERENCE,
    TOPIC_SELF_TEST,
    TOPIC_WINDOW,
    AlarmResult,
    SelfTestResult,
    WindowResult,
)
from monitor.service.processes import held_memory
from monitor.watch.blindness import BlindWindows, MissingChannels

_LAST = 10  # windows over which an overload is reported: one window in time does not end it

TopicPayload = tuple[str, dict[str, Any]]  #: topic and payload of an event


class Overload:
    """Count of the windows that were left out."""

    def __init__(self) -> None:
        self._last: deque[bool] = deque(maxlen=_LAST)
        self._since = 0  # windows left out since the overload began
        self.total = 0  #: windows left out since the start

    def take(self, *, left_out: bool) -> TopicPayload | None:
        """Take a window, or a stretch of windows, that was left out or not; return an event if that is news."""
        before = any(self._last)
        self._last.append(left_out)
        self.total += left_out
        self._since = self._since * before + left_out
        if left_out and not before:
            return "/event/windows_left_out", {"why": "the analysis has fallen behind"}
        if before and not any(self._last):
            return "/event/analysis_caught_up", {"left_out": self._since}
        return None

    @property
    def problem(self) -> str | None:
        """Number of the last windows that were left out; None if none was."""
        n = sum(self._last)
        if not n:
            return None
        return f"{n} of the last {len(self._last)} windows left out: the analysis has fallen behind"


NAME = "status.json"
_EVERY = 1.0  # s
_RATE_LOOKS = 10  # that a rate is the mean over
_LUMP = 2.0  # s that scans may take until they are logged: a device that is silent for longer has no rate of before


@dataclass
class DeviceStatus:
    """One device since the start."""

    scans: int = 0
    gaps: int = 0
    lost: bool = False
    last_block: float | None = None  #: when the last block came [s, monotonic]
    looks: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_RATE_LOOKS + 1))  #: last block, scans

    def look(self, now: float) -> dict[str, Any]:
        """Return the published status at a time [s, monotonic]."""
        last_block = now if self.last_block is None or now - self.last_block > _LUMP else self.last_block
        self.looks.append((last_block, self.scans))
        then, scans = self.looks[0]
        return {
            "scans": self.scans,
            "gaps": self.gaps,
            "lost": self.lost,
            "silent": None if self.last_block is None else now - self.last_block,
            "rate": (self.scans - scans) / max(last_block - then, _EVERY),
        }


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Interval of windows in wall time."""

    step: float  #: interval [s]
    window: float  #: their length: the first takes that long [s]
    tests: bool = True  #: whether there are self-tests: if not, the last one is obsolete


class MonitorStatus:
    """Gathers the state of a run; called from the log's thread and the main one.

    All ages are by a monotonic clock: the file has them at the time of writing.

    Parameters
    ----------
    path : of the file
    devices : names
    pace : of windows
    clock : of the data
    device_of : device of each channel
    """

    def __init__(
        self,
        path: Path,
        devices: tuple[str, ...],
        pace: Pace,
        clock: HostClock,
        device_of: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._clock, self._device_of = clock, device_of
        self._late: dict[str, float] = {}  # of results: since their last sample came [s of wall time]
        self._path, self._lock, self._started = path, threading.Lock(), time.time()
        self._devices = {name: DeviceStatus() for name in devices}
        self._pace, self._windowed = pace, time.monotonic()
        self._first_block = self._windowed  # until a device is
        self._window: dict[str, Any] = {}
        self._novelty: dict[str, Any] = {}  # of the last window that was judged
        self._sight, self._unheard = BlindWindows(), MissingChannels()
        self._overload = Overload()
        self._learnt, self._state = False, "normal"  # whether there is a reference, and of the alarm
        before = last_written(path)
        self._self_test = before.get("self_test")
        self._identities: dict[str, Any] = before.get("identities") or {}  # of devices, over restarts
        self._said: deque[TopicPayload] = deque()
        self._due = 0.0

    def take(self, item: Item) -> None:
        """Add a logged item."""
        with self._lock:
            if isinstance(item, Block):
                self._heard(item)
            elif item.topic in (TOPIC_WINDOW, TOPIC_ALARM):
                self._analysed(item)
            elif item.topic == TOPIC_SELF_TEST:
                self._tested(item)
            elif item.topic == TOPIC_REFERENCE:
                self._learnt = True
            else:
                self._happened(item)

    def follow(self, devices: tuple[str, ...], pace: Pace, device_of: Mapping[str, str]) -> None:
        """Follow these devices from now on, whose first window begins now; the state of continued ones is kept."""
        with self._lock:
            self._devices = {name: self._devices.get(name, DeviceStatus()) for name in devices}
            self._pace, self._windowed, self._device_of = pace, time.monotonic(), device_of

    def events(self) -> Iterator[TopicPayload]:
        """Yield topic and payload of device events since the last time."""
        while self._said:
            yield self._said.popleft()

    @property
    def lost(self) -> list[str]:
        """Devices that are lost."""
        with self._lock:
            return [name for name, device in self._devices.items() if device.lost]

    @property
    def silence(self) -> float:
        """Since a block of any device was logged, or since the start [s]."""
        with self._lock:
            last_block = [device.last_block for device in self._devices.values() if device.last_block is not None]
            return time.monotonic() - max(last_block, default=self._first_block)

    @property
    def line(self) -> str:
        """State in one line."""
        with self._lock:
            lost = [name for name, device in self._devices.items() if device.lost]
            state = self._window.get("phase", "no window yet")
            devices = f"{len(self._devices) - len(lost)} of {len(self._devices)} devices"
            return f"{state}; {devices}" + (f", lost: {', '.join(lost)}" if lost else "")

    def write(self, more: dict[str, Any]) -> bool:
        """Write the file once per second, with further values; disk failures are reported elsewhere.

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
            now = time.monotonic()
            return {
                "time": time.time(),
                "started": self._started,
                "pid": os.getpid(),
                "held": held_memory(),
                "state": self._state if self._learnt else "learning",
                "step_seconds": self._pace.step,
                "window_age": now - self._windowed,
                "window_overdue": now - self._windowed > self._pace.window + 2 * self._pace.step,
                "window": self._window,
                "trend": self._novelty.get("trend"),
                "detectable": self._novelty.get("detectable"),
                "blind": self._sight.blind,
                "unheard": self._unheard.texts,
                "overload": self._overload.problem,
                "windows_left_out": self._overload.total,
                "late": self._late,
                "self_test": self._self_test if self._pace.tests else None,
                "identities": self._identities,
                "devices": {name: device.look(now) for name, device in self._devices.items()},
            }

    def _heard(self, block: Block) -> None:
        device = self._devices.get(block.device)
        if device is not None:
            device.scans += len(block.counts)
            device.last_block, device.lost = time.monotonic(), False

    def _tested(self, event: Event) -> None:
        result = event_result(event)
        if isinstance(result, SelfTestResult):
            self._self_test = result.payload() | {"text": result.text}

    def _happened(self, event: Event) -> None:
        if event.topic == "/event/analysis_lagging":
            self._note(self._overload.take(left_out=True))
        device = self._devices.get(str(event.payload.get("device", "")))
        if device is not None:
            device.gaps += event.topic == "/event/gap"
            device.lost = event.topic == "/event/device_failed" or (
                device.lost and event.topic != "/event/device_recovered"
            )
            if event.topic == "/event/device_open":
                self._compare(event.payload)

    def _compare(self, payload: dict[str, Any]) -> None:
        """Report a device that differs from the one in the run before: ports may have been reassigned."""
        name = str(payload["device"])
        found = {key: value for key, value in payload.items() if key not in ("device", "filter_delay")}
        known = self._identities.get(name, found)
        if known != found:
            self._said.append(("/event/device_replaced", {"device": name, "before": known, "now": found}))
        self._identities[name] = found

    def _note(self, said: TopicPayload | None) -> None:
        if said:
            self._said.append(said)

    def _analysed(self, event: Event) -> None:
        result = event_result(event)
        late = (self._clock.now() - event.time) * 1e-9 / self._clock.speed
        if isinstance(result, AlarmResult):
            self._state = result.state
            if result.raised:
                self._late["alarm"] = late
        if isinstance(result, WindowResult):
            self._late["window"] = late
            self._note(self._overload.take(left_out=result.skipped))
            self._windowed, self._sight = time.monotonic(), self._sight.after(result)
            self._listen(result)
            self._learnt = result.phase != "learning"
            if not self._learnt:
                self._self_test, self._novelty = None, {}  # they belong to an obsolete baseline
            self._window = result.model_dump(mode="json", include={"index", "phase", "problem", "novelty", "end"})
            self._novelty = self._window["novelty"] or self._novelty
            self._window["n_modes"] = len(result.modes)
            self._window["frequencies"] = {mode.id: mode.frequency for mode in result.modes}

    def _listen(self, window: WindowResult) -> None:
        """Update the channels without data, and those with data again; a lost device is reported separately."""
        lost = {name for name, device in self._devices.items() if device.lost}
        faults = {c: why for c, why in window.faults.items() if self._device_of.get(c) not in lost}
        self._unheard = self._unheard.after(window.model_copy(update={"faults": faults}))
        for channels, why in self._unheard.gone:
            self._said.append(("/event/channel_failed", {"channels": ", ".join(channels), "why": why}))
        if self._unheard.back:
            self._said.append(("/event/channel_recovered", {"channels": ", ".join(self._unheard.back)}))


def last_written(path: Path) -> dict[str, Any]:
    """Return the content of the status file of the run before; empty if it cannot be read."""
    try:
        found = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}

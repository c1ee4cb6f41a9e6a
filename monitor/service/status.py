"""State of a running monitor, written to one small file once per second."""

import contextlib
import math
import os
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from daq import Block, Event, HostClock, Item
from daq.events import DeviceFailed, DeviceOpened, DeviceRecovered, EventPayload, ScansMissing
from monitor.analysis.temperature import TOPIC_TEMPERATURE
from monitor.detection.alarm import State
from monitor.results.residuals import ChannelResiduals
from monitor.results.service_events import (
    AnalysisCaughtUp,
    AnalysisLagging,
    ChannelFailed,
    ChannelRecovered,
    DeviceReplaced,
    WindowsLeftOut,
)
from monitor.results.site_status import (
    Counters,
    DeviceStatus,
    ModeStatus,
    PartProblems,
    SiteStatus,
    WindowStatus,
    read_status,
)
from monitor.results.windows import (
    TOPIC_ALARM,
    TOPIC_REFERENCE,
    TOPIC_SELF_TEST,
    TOPIC_WINDOW,
    AlarmResult,
    LearningProgress,
    Novelty,
    SelfTestResult,
    WindowResult,
    event_result,
)
from monitor.service.processes import held_memory
from monitor.watch.blindness import BlindWindows, MissingChannels

_LAST = 10  # windows over which an overload is reported: one window in time does not end it


class Overload:
    """Count of the windows that were left out."""

    def __init__(self) -> None:
        self._last: deque[bool] = deque(maxlen=_LAST)
        self._since = 0  # windows left out since the overload began
        self.total = 0  #: windows left out since the start

    def take(self, *, left_out: bool) -> EventPayload | None:
        """Take a window, or a stretch of windows, that was left out or not; return an event if that is news."""
        before = any(self._last)
        self._last.append(left_out)
        self.total += left_out
        self._since = self._since * before + left_out
        if left_out and not before:
            return WindowsLeftOut(why="the analysis has fallen behind")
        if before and not any(self._last):
            return AnalysisCaughtUp(left_out=self._since)
        return None

    @property
    def problem(self) -> str | None:
        """Number of the last windows that were left out; None if none was."""
        n = sum(self._last)
        if not n:
            return None
        return f"{n} of the last {len(self._last)} windows left out: the analysis has fallen behind"


_EVERY = 1.0  # s
_BLOCKS = 120  # of which the largest residual is kept
_OUTDATED = 5.0  # s, or half a window: residuals of older blocks are not the present ones
_RATE_LOOKS = 10  # that a rate is the mean over
_LUMP = 2.0  # s that scans may take until they are logged: a device that is silent for longer has no rate of before


@dataclass
class DeviceCounts:
    """Counts of one device since the start."""

    scans: int = 0
    gaps: int = 0
    lost: bool = False
    last_block: float | None = None  #: when the last block came [s, monotonic]
    temperature: float | None = None  #: last reading [degC]
    looks: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_RATE_LOOKS + 1))  #: last block, scans

    def status(self, now: float) -> DeviceStatus:
        """Return the status at a time [s, monotonic]."""
        last_block = now if self.last_block is None or now - self.last_block > _LUMP else self.last_block
        self.looks.append((last_block, self.scans))
        then, scans = self.looks[0]
        return DeviceStatus(
            scans=self.scans,
            gaps=self.gaps,
            lost=self.lost,
            silent=None if self.last_block is None else now - self.last_block,
            rate=(self.scans - scans) / max(last_block - then, _EVERY),
            temperature=self.temperature,
        )


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
        self._latency: dict[str, float] = {}  # of results: since their last sample came [s of wall time]
        self._path, self._lock, self._started = path, threading.Lock(), time.time()
        self._devices = {name: DeviceCounts() for name in devices}
        self._pace, self._windowed = pace, time.monotonic()
        self._first_block = self._windowed  # until a device is
        self._window: WindowStatus | None = None
        self._novelty: Novelty | None = None  # of the last window that was evaluated
        self._blind, self._missing = BlindWindows(), MissingChannels()
        self._overload = Overload()
        self._residuals: ChannelResiduals | None = None
        self._residual_course: deque[float] = deque(maxlen=_BLOCKS)
        self._residuals_at = -math.inf  # monotonic time at which they came [s]
        self._temperature: float | None = None  # of the site's thermometer [degC]
        self._learnt = False  # whether there is a reference
        self._learning: LearningProgress | None = None
        self._state: State = "normal"  # of the alarm
        before = read_status(path)
        self._self_test = before.self_test if before else None
        self._identities = dict(before.identities) if before else {}  # of devices, over restarts
        self._events: deque[EventPayload] = deque()
        self._due = 0.0

    def take(self, item: Item) -> None:
        """Add a logged item."""
        with self._lock:
            if isinstance(item, Block):
                self._count(item)
            elif item.topic in (TOPIC_WINDOW, TOPIC_ALARM):
                self._take_result(item)
            elif item.topic == TOPIC_SELF_TEST:
                result = event_result(item)
                if isinstance(result, SelfTestResult):
                    self._self_test = result
            elif item.topic == TOPIC_REFERENCE:
                self._learnt, self._learning = True, None
            else:
                self._take_event(item)

    def take_residuals(self, residuals: ChannelResiduals) -> None:
        """Take the residuals of the last block."""
        with self._lock:
            self._residuals, self._residuals_at = residuals, time.monotonic()
            self._residual_course.append(max(residuals.deviation.values()))

    def follow(self, devices: tuple[str, ...], pace: Pace, device_of: Mapping[str, str]) -> None:
        """Follow these devices from now on, whose first window begins now; the state of continued ones is kept."""
        with self._lock:
            self._devices = {name: self._devices.get(name, DeviceCounts()) for name in devices}
            self._pace, self._windowed, self._device_of = pace, time.monotonic(), device_of

    def events(self) -> Iterator[EventPayload]:
        """Yield the events of devices since the last time."""
        while self._events:
            yield self._events.popleft()

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
            state = self._window.phase if self._window else "no window yet"
            devices = f"{len(self._devices) - len(lost)} of {len(self._devices)} devices"
            return f"{state}; {devices}" + (f", lost: {', '.join(lost)}" if lost else "")

    def write(self, problems: PartProblems, counters: Counters) -> SiteStatus | None:
        """Write the file once per second, with values of other parts; disk failures are reported elsewhere.

        Returns
        -------
        SiteStatus or None
            Content of the file; None while a second is not over.
        """
        now = time.monotonic()
        if now < self._due:
            return None
        self._due = now + _EVERY
        content = self._content(problems, counters)
        unfinished = self._path.with_suffix(".part")
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_text(content.model_dump_json(), encoding="utf-8")
            os.replace(unfinished, self._path)
        return content

    def _content(self, problems: PartProblems, counters: Counters) -> SiteStatus:
        with self._lock:
            now = time.monotonic()
            outdated = now - self._residuals_at > max(_OUTDATED, self._pace.window / 2)
            residuals = None if outdated else self._residuals
            return SiteStatus(
                time=time.time(),
                started=self._started,
                pid=os.getpid(),
                memory_use=held_memory(),
                state=self._state if self._learnt else "learning",
                learning=self._learning,
                step_seconds=self._pace.step,
                window_age=now - self._windowed,
                window_overdue=now - self._windowed > self._pace.window + 2 * self._pace.step,
                window=self._window,
                trend=self._novelty.trend if self._novelty else None,
                detectable=self._novelty.detectable if self._novelty else None,
                blind=self._blind.blind,
                missing_channels=self._missing.texts,
                overload=self._overload.problem,
                windows_left_out=self._overload.total,
                residuals=residuals,
                residual_course=list(self._residual_course) if residuals else [],
                temperature=self._temperature,
                latency=dict(self._latency),
                self_test=self._self_test if self._pace.tests else None,
                identities=dict(self._identities),
                devices={name: device.status(now) for name, device in self._devices.items()},
                problems=problems,
                counters=counters,
            )

    def _count(self, block: Block) -> None:
        device = self._devices.get(block.device)
        if device is not None:
            device.scans += len(block.counts)
            device.last_block, device.lost = time.monotonic(), False
            device.temperature = block.temperature if math.isfinite(block.temperature) else None

    def _take_event(self, event: Event) -> None:
        if event.topic == AnalysisLagging.topic:
            self._note(self._overload.take(left_out=True))
        if event.topic == TOPIC_TEMPERATURE:
            self._temperature = float(event.payload["celsius"])
        device = self._devices.get(str(event.payload.get("device", "")))
        if device is not None:
            device.gaps += event.topic == ScansMissing.topic
            device.lost = event.topic == DeviceFailed.topic or (device.lost and event.topic != DeviceRecovered.topic)
            if event.topic == DeviceOpened.topic:
                self._compare_identity(event.payload)

    def _compare_identity(self, payload: dict[str, Any]) -> None:
        """Report a device that differs from the one in the run before: ports may have been reassigned."""
        name = str(payload["device"])
        found = {key: value for key, value in payload.items() if key not in ("device", "filter_delay")}
        known = self._identities.get(name, found)
        if known != found:
            self._events.append(DeviceReplaced(device=name, before=known, now=found))
        self._identities[name] = found

    def _note(self, event: EventPayload | None) -> None:
        if event:
            self._events.append(event)

    def _take_result(self, event: Event) -> None:
        result = event_result(event)
        late = (self._clock.now() - event.time) * 1e-9 / self._clock.speed
        if isinstance(result, AlarmResult):
            self._state = result.state
            if result.raised:
                self._latency["alarm"] = late
        if isinstance(result, WindowResult):
            self._latency["window"] = late
            self._note(self._overload.take(left_out=result.skipped))
            self._windowed, self._blind = time.monotonic(), self._blind.after(result)
            self._check_channels(result)
            self._learnt = result.phase != "learning"
            if not self._learnt:
                self._self_test, self._novelty = None, None  # they belong to an obsolete baseline
            self._learning = None if self._learnt else result.learning or self._learning
            self._novelty = result.novelty or self._novelty
            self._window = WindowStatus(
                index=result.index,
                phase=result.phase,
                problem=result.problem,
                novelty=result.novelty,
                end=result.end,
                n_modes=len(result.modes),
                modes={mode.id: ModeStatus.model_validate(mode, from_attributes=True) for mode in result.modes},
            )

    def _check_channels(self, window: WindowResult) -> None:
        """Update the channels without data, and those with data again; a lost device is reported separately."""
        lost = {name for name, device in self._devices.items() if device.lost}
        faults = {c: why for c, why in window.faults.items() if self._device_of.get(c) not in lost}
        self._missing = self._missing.after(window.model_copy(update={"faults": faults}))
        for channels, why in self._missing.gone:
            self._events.append(ChannelFailed(channels=", ".join(channels), why=why))
        if self._missing.back:
            self._events.append(ChannelRecovered(channels=", ".join(self._missing.back)))

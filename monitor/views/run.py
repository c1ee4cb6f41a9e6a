"""Run read from its log for views: results, last signals, completeness of the data."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scipy.signal import resample_poly

from daq import (
    AnyLog,
    Assembler,
    Block,
    Event,
    Flag,
    LogError,
    LogExcerpt,
    Recording,
    read_attachments,
    read_events,
    read_log,
)
from daq.events import DeviceFailed, DeviceRecovered, DeviceWarning, ScansMissing, WrongDevice, WrongRate
from daq.log import BEGINNING, END, PartedLog, files_of, newest_log
from monitor.analysis.temperature import TOPIC_TEMPERATURE
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.errors import ResultsError, SettingsError
from monitor.results.run_results import RunResults
from monitor.results.service_events import Stopped
from monitor.results.windows import (
    TOPIC_ALARM,
    TOPIC_REFERENCE,
    AlarmResult,
    ReferenceResult,
    Result,
    WindowResult,
    event_result,
)
from monitor.settings import attachable, parse_attached
from monitor.text.events import event_sentence
from oma import aligned
from updater import StructureError, parse_structure

_TAIL_SECONDS = 14.0  # of blocks kept: ten to draw, the rest for the clocks to settle and for filters
_SIGNAL_SECONDS = 11.0
_SHOWN_EVENTS = frozenset(
    kind.topic for kind in (DeviceFailed, DeviceRecovered, DeviceWarning, ScansMissing, WrongDevice, WrongRate)
)
_MAX_EVENTS = 1000  # that are kept, the newest
_TEMPERATURE_SECONDS = 10.0  # between readings that are kept
_TAPS = 10  # of the low-pass on each side, at the lower rate: that much is cut off at both ends
_VIEW_RATE = 500.0  # Hz: signals that are faster are drawn at this rate at the most


@dataclass(kw_only=True)
class DeviceQuality:
    """Data delivered by one device."""

    device: str
    rate: float = 0.0  #: nominal [Hz]
    scans: int = 0
    gaps: int = 0
    missing: int = 0  #: scans in those gaps
    exact: bool = True  #: False if the number of missing scans was estimated by the host's clock
    damaged: int = 0  #: blocks while which damaged frames were dropped
    lost: int = 0  #: times the device was lost


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """A log, read whole."""

    log: AnyLog
    results: RunResults
    devices: list[DeviceQuality]
    dropped: int | None  #: items dropped because the log's queue was full; None if the log does not state it
    ended: bool  #: False if the log is truncated: it has no end
    site_text: str  #: settings attached to the log, without secrets; empty if there are none


def find_log(path: Path) -> Path | PartedLog:
    """Return the log that a path means: itself, or the newest run in a folder or in its `log` folder.

    Raises
    ------
    ResultsError
        If there is none.
    """
    if not path.exists():
        raise ResultsError(path, "there is no such file or folder")
    try:
        return newest_log(path)
    except LogError as error:
        raise ResultsError(path, error.message) from error


def load_run(path: Path, within: TimeRange = WHOLE, say: Callable[[str], object] = lambda _: None) -> Run:
    """Read a run from a log, or from the newest log of a folder.

    Parameters
    ----------
    path : of the log or folder
    within : range of time; its windows are those that lie within it. The baseline may be older, and so may an alarm be
        that is active where the range begins
    say : called with the range as a text, if there is one

    Raises
    ------
    ResultsError, LogError
        Naming the file, if it cannot be read or holds no results.
    ArgumentError
        If the range does not fit the log.
    """
    log = within.of_log(find_log(path), say)
    attached = read_attachments(log)
    found = _Reading()
    try:
        found.results += _standing(log)
        for item in read_log(log):
            found.take(item)
    except ValidationError as error:
        place = ".".join(str(part) for part in error.errors()[0]["loc"])
        message = f"holds a result that this version cannot read: {error.title}, {place}: {error.errors()[0]['msg']}"
        raise ResultsError(str(log), message) from error
    excerpt = log if isinstance(log, LogExcerpt) else None
    windows = tuple(
        r
        for r in found.results
        if isinstance(r, WindowResult) and (excerpt is None or (excerpt.start <= r.start and r.end <= excerpt.stop))
    )
    if excerpt and not windows:
        raise ResultsError(str(log), "holds no result of a whole window")
    if not windows:
        raise ResultsError(
            str(log),
            "holds no results: it was not monitored, or stopped before its first window ended; "
            "`modalwatch replay LOG -o WATCHED.mcap` analyses it",
        )
    site_text = attachable(attached.get("site.toml", ""))
    reference = next((r for r in reversed(found.results) if isinstance(r, ReferenceResult)), None)
    run_results = RunResults(
        name=_name(attached.get("structure.toml", ""), log),
        reference=reference,
        windows=windows,
        alarms=tuple(r for r in found.results if isinstance(r, AlarmResult)),
        device_events=tuple(found.happened),
        temperatures=found.temperatures,
        signals=last_signals(found.tail, site_text, reference.late if reference else {}),
    )
    return Run(
        log=log,
        results=run_results,
        devices=sorted(found.devices.values(), key=lambda d: d.device),
        dropped=found.dropped,
        ended=found.ended or (excerpt is not None and excerpt.stop < END),
        site_text=site_text,
    )


def _standing(log: AnyLog) -> list[Result]:
    """Return the baseline and the alarm, if any, that are valid where an excerpt begins."""
    if not isinstance(log, LogExcerpt) or log.start == BEGINNING:
        return []
    baseline: list[Result] = []
    alarms: list[Result] = []
    for event in read_events(replace(log, start=BEGINNING, stop=log.start), (TOPIC_REFERENCE, TOPIC_ALARM)):
        result = event_result(event)
        if isinstance(result, ReferenceResult):
            baseline = [result]
        elif isinstance(result, AlarmResult):
            alarms = [*alarms, result] if result.state != "normal" else []
    return baseline + alarms


@dataclass
class _Reading:
    """Data gathered in one pass through a log."""

    results: list[Result] = field(default_factory=list)
    devices: dict[str, DeviceQuality] = field(default_factory=dict)
    tail: deque[Block] = field(default_factory=deque)
    happened: deque[tuple[int, str]] = field(default_factory=lambda: deque(maxlen=_MAX_EVENTS))
    temperatures: dict[str, tuple[list[int], list[float]]] = field(default_factory=dict)
    dropped: int | None = None
    ended: bool = False

    def take(self, item: Block | Event) -> None:
        if isinstance(item, Block):
            self._block(item)
            return
        result = event_result(item)
        if result is not None:
            self.results.append(result)
        elif item.topic == Stopped.topic:
            self.dropped, self.ended = Stopped.read(item).dropped, True
        elif item.topic == TOPIC_TEMPERATURE:
            self._temperature("site", item.time, float(item.payload["celsius"]))
        elif "device" in item.payload:
            self._event(item, self._quality(item.payload["device"]))

    def _quality(self, device: str) -> DeviceQuality:
        return self.devices.setdefault(device, DeviceQuality(device=device))

    def _block(self, block: Block) -> None:
        quality = self._quality(block.device)
        quality.rate = block.rate
        quality.scans += block.n_scans
        quality.damaged += bool(block.flags & Flag.BAD_FRAMES)
        self._temperature(block.device, block.arrival_time, block.temperature)
        self.tail.append(block)
        while self.tail[0].arrival_time < block.arrival_time - _TAIL_SECONDS * 1e9:
            self.tail.popleft()

    def _temperature(self, name: str, time: int, celsius: float) -> None:
        """Keep a reading, unless the last one is too recent."""
        if math.isfinite(celsius):
            times, values = self.temperatures.setdefault(name, ([], []))
            if not times or time - times[-1] >= _TEMPERATURE_SECONDS * 1e9:
                times.append(time)
                values.append(celsius)

    def _event(self, event: Event, quality: DeviceQuality) -> None:
        if event.topic in _SHOWN_EVENTS:
            self.happened.append((event.time, event_sentence(event.topic, event.payload)))
        if event.topic == ScansMissing.topic:
            gap = ScansMissing.read(event)
            quality.gaps += 1
            quality.missing += gap.missing
            quality.exact &= bool(gap.exact)
        elif event.topic == DeviceFailed.topic:
            quality.lost += 1


def _name(structure: str, log: AnyLog) -> str:
    try:
        return parse_structure(structure).name if structure else files_of(log)[0].stem
    except StructureError:
        return files_of(log)[0].stem


def late_devices(log: AnyLog) -> dict[str, float]:
    """Return the time by which scans were taken before their arrivals indicate [s], by a log's newest baseline.

    Raises
    ------
    LogError
        If the log cannot be read.
    """
    baselines = list(read_events(log, (TOPIC_REFERENCE,)))
    return ReferenceResult.model_validate(baselines[-1].payload).late if baselines else {}


def last_signals(blocks: Iterable[Block], site_text: str, late: Mapping[str, float] = {}) -> Recording | None:
    """Return the last seconds of all channels on one grid; None without settings, or if too little was measured.

    Delays of devices [s] are removed. Faster signals are low-passed and drawn at 500 Hz at most. A device that is
    silent at the end is left out.
    """
    try:
        settings = parse_attached(site_text)
    except SettingsError:
        return None
    blocks = list(blocks)
    devices = {block.device for block in blocks}
    channels = tuple(channel for channel in settings.channels if channel.device in devices)
    if not channels:
        return None
    rates = {d.name: d.rate for d in settings.device if d.name in {c.device for c in channels}}
    assembler = Assembler(channels, rates, window_seconds=_SIGNAL_SECONDS, step_seconds=1.0, by_record=False)
    recordings = [r for b in blocks if b.device in rates for r in assembler.push(b)]
    if not recordings:
        return None
    return slower(aligned(recordings[-1], {name: late.get(name, 0.0) for name in rates}))


def slower(recording: Recording, most: float = _VIEW_RATE) -> Recording:
    """Return a recording at `most` [Hz] or a little less, low-passed before (a gap grows by the filter's length)."""
    factor = int(np.ceil(recording.rate / most - 1e-9))
    if factor == 1:
        return recording
    data = resample_poly(recording.data, 1, factor, axis=0)[_TAPS:-_TAPS]
    rate = recording.rate / factor
    start = recording.start + round(_TAPS / rate * 1e9)
    return Recording(channels=recording.channels, data=data, rate=rate, start=start)

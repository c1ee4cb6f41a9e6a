"""Blocks of many devices on one grid: a function of the sequence of blocks and events, and of nothing else."""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from daq.events import DeviceFailed
from daq.timing.clock_fit import ClockFit
from daq.timing.interpolation import half_taps, interpolate
from daq.timing.scan_runs import ScanRun
from daq.types import Block, BoolArray, Channel, Event, Flag, FloatArray, IndexArray, Recording, find_gaps

_LITTLE = 0.1  # of a window: where all devices are silent for longer, it is a pause between records
_PIECE = 1 << 16  # samples at a time, which bounds the memory
_SETTLE_SECONDS = 2.0  # s of arrivals before a clock is used; by then it errs by far less
_CLOCK_SHIFT_SECONDS = 120.0  # s before a window from which its scans may come when the fit of a clock changes
_PAUSE_SCANS = 64  # before the scan that ends a pause: more than the kernel reaches

NO_DELAYS: Mapping[str, float] = MappingProxyType({})  #: device -> delay [s]


class _Stretch:
    """Scans and clock of one device from one start to the next; `late` is its delay [ns]."""

    def __init__(self, clock: ClockFit, late: int) -> None:
        self.clock, self._late = clock, late
        self.runs: deque[ScanRun] = deque()

    def index_at(self, time: int) -> tuple[float, float]:
        """Return the (fractional) scan at a time [ns UTC], the delay removed, and scans per second of UTC there."""
        return self.clock.index_at(time + self._late)

    def time_at(self, index: int) -> int:
        """Return the time of a scan, the delay removed [ns UTC]."""
        return self.clock.time_at(index) - self._late

    def add(self, block: Block) -> None:
        self.clock.add(block.arrival_index, block.arrival_time)
        if self.runs and self.runs[-1].is_continued_by(block):
            self.runs[-1].add(block)
        else:
            self.runs.append(ScanRun(block))

    def forget(self, index: float) -> None:
        """Drop blocks that end before a scan, but for the last one."""
        while len(self.runs) > 1 and self.runs[0].end < index:
            self.runs.popleft()
        self.runs[0].forget(index)

    def scans(self, first: int, last: int, axes: IndexArray, out: FloatArray | None = None) -> FloatArray:
        """Return scans first .. last - 1 of some axes in m/s2 (n_axes, n), NaN where one is missing."""
        out = np.empty((len(axes), last - first)) if out is None else out
        written = first
        for run in self.runs:
            start, stop = max(first, run.first), min(last, run.end)
            if start < stop:
                out[:, written - first : max(start, written) - first] = np.nan
                run.write(start, axes, out[:, start - first : stop - first])
                written = max(written, stop)
        out[:, written - first :] = np.nan
        return out

    def has(self, first: int, last: int, axis: int) -> bool:
        """Return whether it holds all scans first .. last - 1 of an axis."""
        for run in self.runs:
            if run.first <= first < run.end and axis < run.n_axes:
                first = run.end
        return first >= last

    def covers(self, start: int, n: int, rate: float, ratio: float | None, axis: int) -> bool:
        """Return whether `resample` would write all samples of an axis."""
        first, scan_rate = self.index_at(start)
        if ratio is None:
            return self.has(round(first), round(first) + n, axis)
        return self.has(*_needed(first, scan_rate / rate, half_taps(ratio), slice(0, n)), axis)

    def resample(self, start: int, rate: float, ratio: float | None, axes: IndexArray, out: FloatArray) -> bool:
        """Write scans on a grid (n_axes, n); return False if there is none near it. Without a ratio they lie on it."""
        (first, scan_rate), n = self.index_at(start), out.shape[1]
        pieces = [slice(begin, min(begin + _PIECE, n)) for begin in range(0, n, _PIECE)]
        if ratio is None:
            for piece in pieces:
                self.scans(round(first) + piece.start, round(first) + piece.stop, axes, out[:, piece])
            return True
        step, half = scan_rate / rate, half_taps(ratio)
        low, high = _needed(first, step, half, slice(0, n))
        if not any(run.first < high and run.end > low for run in self.runs):
            return False
        for piece in pieces:
            low, high = _needed(first, step, half, piece)
            scans = self.scans(low, high, axes).T
            at = first + piece.start * step - low
            interpolate(scans, at, step, piece.stop - piece.start, ratio, out[:, piece].T)
        return True


def _needed(first: float, step: float, half: int, piece: slice) -> tuple[int, int]:
    """Return the first scan that a piece of the grid needs, and the one after its last."""
    return math.floor(first + piece.start * step) - half, int(first + (piece.stop - 1) * step) + half + 2


class _Device:
    """Stretches of one device, one a start.

    Parameters
    ----------
    rate, grid_rate : of its scans and of the grid [Hz]
    axes : device axes that are wanted
    clocks : those that devices share, by name
    late : its delay [ns]
    on_grid : its scans lie on the grid
    """

    def __init__(
        self,
        rate: float,
        grid_rate: float,
        axes: Sequence[int],
        clocks: dict[str, ClockFit],
        late: int,
        *,
        on_grid: bool,
    ) -> None:
        self._rate, self._grid_rate, self._clocks = rate, grid_rate, clocks
        self.axes = np.array(axes, np.intp)  #: device axes, ascending: those that are wanted
        self._late = late
        self._ratio = None if on_grid else grid_rate / rate
        self._half = half_taps(self._ratio) if self._ratio else 0
        self._stretches: deque[_Stretch] = deque()
        self._awaited = (0, 0.0)  # time that was not reached, and the scan needed for it
        self.lost = False

    def add(self, block: Block) -> None:
        if not self._stretches or (block.flags is not Flag.NONE and block.flags & Flag.RESTARTED):
            own = ClockFit(self._rate)
            clock = self._clocks.setdefault(block.clock, own) if block.clock else own
            self._stretches.append(_Stretch(clock, self._late))
            self._awaited = (0, 0.0)
        self._stretches[-1].add(block)
        self.lost = False
        if self.axes[-1] >= block.counts.shape[1] and self.axes[0]:  # an axis that the device has shows its data
            self.axes = np.insert(self.axes, 0, 0)

    @property
    def ready(self) -> bool:
        return self.has_data and self._stretches[-1].clock.span >= _SETTLE_SECONDS

    @property
    def has_data(self) -> bool:
        return bool(self._stretches)

    @property
    def first_time(self) -> int:
        """Time from which on there can be samples [ns UTC]."""
        stretch = self._stretches[-1]
        return stretch.time_at(stretch.runs[0].first + self._half)

    @property
    def end_time(self) -> int:
        """Time before which there can be samples, unless more blocks come [ns UTC]."""
        stretch = self._stretches[-1]
        return stretch.time_at(stretch.runs[-1].end - self._half)

    @property
    def temperatures(self) -> list[float]:
        return [value for run in self.runs for value in run.temperatures]

    def reaches(self, time: int) -> bool:
        """Return whether all scans needed for samples before `time` are available."""
        if not self._stretches:
            return False
        stretch = self._stretches[-1]
        end = stretch.runs[-1].end
        if self._awaited[0] == time and end < self._awaited[1] - _SETTLE_SECONDS * self._rate:
            return False  # far before it: the clock need not be fitted again
        needed = stretch.index_at(time)[0] + self._half
        self._awaited = (time, needed)
        return needed < end

    def next_time(self, time: int) -> int | None:
        """Return the time of the first scan that is not before `time`, None if there is none."""
        return next(
            (
                max(time, stretch.time_at(run.first))
                for stretch in self._stretches
                for run in stretch.runs
                if stretch.time_at(run.end) > time
            ),
            None,
        )

    def forget(self, time: int) -> None:
        """Drop blocks that end well before `time`."""
        for stretch in self._stretches:
            stretch.forget(stretch.index_at(time)[0] - 2 * self._half)
        while len(self._stretches) > 1 and self._stretches[1].time_at(self._stretches[1].runs[0].first) < time:
            self._stretches.popleft()

    def n_after(self, time: int | None) -> int:
        """Return the number of blocks, the last ones, that are used after a time [ns UTC]; None: all that are held."""
        if time is None:
            return sum(map(len, self.runs))
        n = 0
        for stretch in self._stretches:
            index = stretch.index_at(time)[0] - 2 * self._half
            n += sum(run.n_after(index) for run in stretch.runs)
        return n

    @property
    def runs(self) -> Iterator[ScanRun]:
        """Runs of all its stretches."""
        return (run for stretch in self._stretches for run in stretch.runs)

    def covers(self, start: int, n: int) -> bool:
        """Return whether its scans reach over the whole of a window, without a gap."""
        axis = int(self.axes[0])
        return any(s.covers(start, n, self._grid_rate, self._ratio, axis) for s in self._stretches)

    def resample(self, start: int, out: FloatArray) -> None:
        """Write scans on the grid (n_axes, n), NaN where they are missing."""
        written = False
        for stretch in self._stretches:
            signal = np.empty_like(out) if written else out
            found = stretch.resample(start, self._grid_rate, self._ratio, self.axes, signal)
            if found and written:
                np.copyto(out, signal, where=~np.isnan(signal))
            written |= found
        if not written:
            out[:] = np.nan


class Assembler:
    """Cuts the streams of many devices into recordings on one grid.

    Parameters
    ----------
    channels : analysed channels
    rates : device -> nominal scans per second [Hz]; the grid has the slowest one
    window_seconds, step_seconds : length of a window and distance of their starts [s]
    on_grid : scans of all devices lie on one grid already, as those of an imported file: nothing is interpolated
    late : device -> delay of its scans, which is removed [s]; it needs interpolation, and so no `on_grid`
    by_record : after a pause of all devices the next window begins with the next data, and an incomplete rest of a
        record is dropped; else windows stay on their grid, and contain all data
    """

    def __init__(
        self,
        channels: tuple[Channel, ...],
        rates: Mapping[str, float],
        *,
        window_seconds: float,
        step_seconds: float,
        on_grid: bool = False,
        late: Mapping[str, float] = NO_DELAYS,
        by_record: bool = True,
    ) -> None:
        self._channels, self._by_record = channels, by_record
        self._rate = min(rates.values())
        axes = {name: sorted({channel.axis for channel in channels if channel.device == name}) or [0] for name in rates}
        self._on_grid = on_grid
        clocks: dict[str, ClockFit] = {}
        self._devices = {
            name: _Device(rate, self._rate, axes[name], clocks, round(late.get(name, 0.0) * 1e9), on_grid=on_grid)
            for name, rate in rates.items()
        }
        self._n = round(window_seconds * self._rate)
        self._window_ns = round(self._n / self._rate * 1e9)
        self._step = round(round(step_seconds * self._rate) / self._rate * 1e9)  # whole samples, without a remainder
        self._next: int | None = None  # start of the next window [ns UTC]
        self._last: _Device | None = None  # one that lacked scans of this window

    def push(self, block: Block) -> Iterable[Recording]:
        """Take a block; return the windows that are complete with it, to be made one by one.

        Raises
        ------
        ValueError
            If the device is not one of this site.
        """
        self._add(block)
        return () if self._is_incomplete() else self._complete()

    def push_event(self, event: Event) -> Iterator[Recording]:
        """Take an event; a device that is lost no longer holds a window open."""
        if self._loses(event):
            yield from self._complete()

    def advance(self, item: Block | Event) -> None:
        """Take a block or an event as `push` and `push_event`, without the recordings: counts may be 0 for this.

        Windows, their borders and the clocks depend on which scans there are and when they arrived.
        """
        if isinstance(item, Block):
            self._add(item)
            completes = not self._is_incomplete()
        else:
            completes = self._loses(item)
        if completes:
            for _ in self._complete(make=False):
                pass

    def n_needed(self) -> dict[str, int]:
        """Return how many blocks of each device, the last ones, the next windows can need."""
        since = None if self._next is None else self._next - round(_CLOCK_SHIFT_SECONDS * 1e9)
        return {name: device.n_after(since) for name, device in self._devices.items()}

    def mark(self) -> None:
        """Mark the blocks held now."""
        for run in self._runs:
            run.mark()

    def refuse_marked(self) -> None:
        """Refuse the counts of marked blocks, which were not read: a window with one raises `UnreadCountsError`."""
        for run in self._runs:
            run.refuse_marked()

    @property
    def _runs(self) -> Iterator[ScanRun]:
        return (run for device in self._devices.values() for run in device.runs)

    def _add(self, block: Block) -> None:
        if block.device not in self._devices:
            raise ValueError(f"device: expected one of {', '.join(self._devices)}, found {block.device!r}")
        self._devices[block.device].add(block)

    def _loses(self, event: Event) -> bool:
        """Return whether an event reports the loss of a device, which then no longer holds a window open."""
        device = self._devices.get(event.payload.get("device", ""))
        if event.topic != DeviceFailed.topic or device is None:
            return False
        device.lost = True
        return True

    def finish(self) -> Iterator[Recording]:
        """Yield the remaining windows at the end: incomplete for some devices, and a last, shorter one."""
        alive = [d for d in self._devices.values() if d.has_data and not d.lost]
        alive = alive or [d for d in self._devices.values() if d.has_data]
        if not alive:
            return
        if self._next is None:
            self._next = self._first(alive)
        ends = [d.end_time for d in alive]
        end = max(ends) if self._on_grid else min(ends)
        while (left := int((end - self._next) * 1e-9 * self._rate + 1e-3)) > 0:  # ends are rounded to ns
            yield from self._cut(self._next, min(left, self._n))

    def _is_incomplete(self) -> bool:
        """Return whether the device that lacked scans of the next window still does, as after most blocks."""
        last = self._last
        if last is None or self._next is None or last.lost:
            return False
        return not last.reaches(self._next + self._window_ns)

    def _complete(self, *, make: bool = True) -> Iterator[Recording]:
        if self._next is not None:
            end = self._next + self._window_ns
            self._last = next((d for d in self._devices.values() if not d.lost and not d.reaches(end)), None)
            if self._last:
                return
        alive = [d for d in self._devices.values() if not d.lost]
        if not alive or not all(d.ready for d in alive):
            return
        if self._next is None:
            self._next = self._first(alive)
        while all(d.reaches(self._next + self._window_ns) for d in alive):
            yield from self._cut(self._next, self._n, make=make)

    def _first(self, devices: list[_Device]) -> int:
        """Return where the first window starts: where all devices are there; on a common grid, where one is."""
        return (min if self._on_grid else max)(device.first_time for device in devices)

    def _cut(self, start: int, n: int, *, make: bool = True) -> Iterator[Recording]:
        """Yield a window of `n` samples, if there is one and it is to be made, and advance to the next."""
        if make or not any(device.covers(start, n) for device in self._devices.values()):
            data, there = self._resampled(start, n)
        else:
            data, there = np.empty((0, len(self._channels))), np.ones(n, np.bool_)
        unused = _unused(there) if self._by_record else n * (not there.any())
        recording = self._recording(start, data) if make and not unused else None
        del data
        if there.any():
            self._next = start + (round(unused / self._rate * 1e9) if 0 < unused < n else self._step)
        else:
            self._next = start + self._step * self._empty_steps(start)
        for device in self._devices.values():
            device.forget(self._next)  # before the window is analysed: less memory
        if recording:
            yield recording

    def _empty_steps(self, start: int) -> int:
        """Return the number of steps from an empty window to one near the next scan: a pause may last for years."""
        times = [time for device in self._devices.values() if (time := device.next_time(start)) is not None]
        return max(
            1,
            (min(times, default=start) - self._window_ns - round(_PAUSE_SCANS / self._rate * 1e9) - start)
            // self._step,
        )

    def _resampled(self, start: int, n: int) -> tuple[FloatArray, BoolArray]:
        """Return the channels (n, n_channels), and where any device has scans (n,)."""
        data, there = np.empty((len(self._channels), n)), np.zeros(n, np.bool_)
        for name, device in self._devices.items():
            own = [k for k, channel in enumerate(self._channels) if channel.device == name]
            axes = [self._channels[k].axis for k in own]
            are_rows = axes == device.axes.tolist() and own == list(range(own[0], own[-1] + 1))
            signal = data[own[0] : own[-1] + 1] if are_rows else np.empty((len(device.axes), n))
            device.resample(start, signal)
            for axis in signal:
                if not there.all():
                    there |= np.isfinite(axis)
            if not are_rows:
                data[own] = signal[np.searchsorted(device.axes, axes)]
        return data.T, there

    def _recording(self, start: int, data: FloatArray) -> Recording:
        temperatures = [device.temperatures for device in self._devices.values()]
        return Recording(
            channels=self._channels,
            data=data,
            rate=self._rate,
            start=start,
            temperature=_mean([_mean(values) for values in temperatures]),
            gaps=find_gaps(self._channels, data),
        )


def _unused(there: BoolArray) -> int:
    """Return how many samples of a window are to be left out for it to begin with a record; 0 if it does.

    A recorder with pauses begins its records at any time; the rest of a record is not a window.
    """
    little = _LITTLE * len(there)
    edges = np.diff(np.concatenate([[True], there, [True]]).astype(np.int8))
    for begin, end in zip(np.flatnonzero(edges < 0), np.flatnonzero(edges > 0), strict=True):
        if end - begin > little:
            return int(end) if begin < little else 0
    return 0


def _mean(values: list[float]) -> float:
    """Return the mean of the known values, NaN if there are none: not every device has a thermometer."""
    known = [value for value in values if math.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


_GAIN = 0.05  # of the phase, per scan: jitter is averaged over 20 scans


class StampCount:
    """Counts periods between time stamps.

    The number of a scan is the nearest whole number of periods since the first one. The phase follows the stamps of
    scans that continue the previous one, so that neither their jitter, below half a period, nor an error of the rate,
    up to about 2 %, adds up. A single false stamp gives a single false number.

    Parameters
    ----------
    rate : scans per second by the clock of the device [Hz]
    wrap : after which that clock begins again [s]
    most : longest step between two scans of which one continues the other [scans]
    """

    def __init__(self, rate: float, *, wrap: float = math.inf, most: int = 8) -> None:
        self._rate, self._wrap, self._most = rate, wrap, most
        self._reference: float | None = None  # time of the scan `_number` without jitter [s]
        self._number = self._previous = 0

    def numbers(self, time: FloatArray) -> IndexArray:
        """Return the numbers (n,) of the next scans by their stamps (n,) [s]."""
        return np.array([self._next(stamp) for stamp in time.tolist()], np.intp)

    def _next(self, stamp: float) -> int:
        if self._reference is None:
            self._reference = stamp
        passed = stamp - self._reference
        if math.isfinite(self._wrap):
            passed = (passed + self._wrap / 2) % self._wrap - self._wrap / 2
        periods = passed * self._rate
        step = round(periods)
        number = self._number + step
        if 1 <= number - self._previous <= self._most:
            self._reference += (step + _GAIN * (periods - step)) / self._rate
            self._number = number
        self._previous = number
        return number

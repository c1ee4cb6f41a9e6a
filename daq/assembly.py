"""Blocks of many devices on one grid: a function of the sequence of blocks and events, and of nothing else."""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from daq.log import Event
from daq.recording import Block, Channel, Flag, FloatArray, Gap, Recording
from daq.timebase import ClockFit

_HALF = 16  # taps on each side of the interpolating kernel
_BETA = 8.0  # of its Kaiser window: images under -80 dB for signals below 0.42 of the rate
_SETTLE_SECONDS = 2.0  # of arrivals before a clock is believed
_CHUNK = 1 << 13
_PHASES = 1024  # fractions of a sample that are tabulated


class _Device:
    """Blocks and clock of one device."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self.clock = ClockFit(rate)
        self.blocks: deque[Block] = deque()
        self.lost = False

    def add(self, block: Block) -> None:
        if block.flags & Flag.RESTARTED:
            self.clock = ClockFit(self.rate)
        self.clock.add(block.pair_index, block.pair_time)
        self.blocks.append(block)
        self.lost = False

    @property
    def ready(self) -> bool:
        return bool(self.blocks) and self.clock.span >= _SETTLE_SECONDS

    def reaches(self, time: int) -> bool:
        """Tell whether all scans needed for samples before `time` are here."""
        return bool(self.blocks) and self.clock.index_at(time)[0] + _HALF < self.blocks[-1].end_index

    def forget(self, time: int) -> None:
        """Drop blocks that end well before `time`."""
        first = self.clock.index_at(time)[0] - 2 * _HALF
        while len(self.blocks) > 1 and self.blocks[0].end_index < first:
            self.blocks.popleft()

    def scans(self, first: int, last: int) -> FloatArray:
        """Return scans first .. last - 1 in m/s2 (n, n_axes), NaN where one is missing."""
        out = np.full((last - first, self.blocks[0].counts.shape[1]), np.nan)
        for block in self.blocks:
            start, stop = max(first, block.first_index), min(last, block.end_index)
            if start < stop:
                part = block.counts[start - block.first_index : stop - block.first_index]
                out[start - first : stop - first] = part * block.scale
        return out

    def temperature(self) -> float:
        return float(np.mean([block.temperature for block in self.blocks]))


def _kernels() -> FloatArray:
    """Return the kernel (n_phases + 1, 32) at equally spaced fractions of a sample."""
    x = np.arange(1 - _HALF, _HALF + 1) - np.linspace(0, 1, _PHASES + 1)[:, None]
    kernel = np.sinc(x) * np.i0(_BETA * np.sqrt(np.clip(1 - (x / _HALF) ** 2, 0, 1))) / np.i0(_BETA)
    return np.asarray(kernel / kernel.sum(1, keepdims=True))


_KERNELS = _kernels()


def interpolate(scans: FloatArray, position: FloatArray) -> FloatArray:
    """Return a band-limited signal (n, n_axes) at fractional positions in its scans; NaN where one it needs is missing.

    Windowed sinc of 32 taps (Kaiser, beta 8), linear between tabulated fractions (error under -120 dB).
    """
    out = np.empty((len(position), scans.shape[1]))
    taps = np.arange(1 - _HALF, _HALF + 1)
    for start in range(0, len(position), _CHUNK):
        part = position[start : start + _CHUNK]
        base = np.floor(part).astype(np.intp)
        phase = (part - base) * _PHASES
        row = np.minimum(phase.astype(np.intp), _PHASES - 1)
        share = (phase - row)[:, None]
        kernel = (1 - share) * _KERNELS[row] + share * _KERNELS[row + 1]
        for axis in range(scans.shape[1]):
            signal = scans[base[:, None] + taps, axis]
            out[start : start + len(part), axis] = np.einsum("nt,nt->n", signal, kernel)
    return out


class Assembler:
    """Cuts the streams of many devices into recordings on one grid.

    Parameters
    ----------
    channels : analysed channels
    rates : device -> nominal scans a second [Hz]; the grid has the slowest one
    window_seconds, step_seconds : length of a window and distance of their starts [s]
    """

    def __init__(
        self, channels: tuple[Channel, ...], rates: Mapping[str, float], *, window_seconds: float, step_seconds: float
    ) -> None:
        self._channels = channels
        self._devices = {name: _Device(rate) for name, rate in rates.items()}
        self._rate = min(rates.values())
        self._n = round(window_seconds * self._rate)
        self._step = round(step_seconds * 1e9)
        self._next: int | None = None  # start of the next window [ns UTC]

    def push(self, block: Block) -> Iterator[Recording]:
        """Take a block; yield the windows that are complete with it.

        Raises
        ------
        ValueError
            If the device is not one of this site.
        """
        if block.device not in self._devices:
            raise ValueError(f"device: expected one of {', '.join(self._devices)}, found {block.device!r}")
        self._devices[block.device].add(block)
        yield from self._complete()

    def push_event(self, event: Event) -> Iterator[Recording]:
        """Take an event; a device that is lost no longer holds a window open."""
        if event.topic == "/event/device_lost":
            self._devices[event.payload["device"]].lost = True
            yield from self._complete()

    def _complete(self) -> Iterator[Recording]:
        alive = [d for d in self._devices.values() if not d.lost]
        if not alive or not all(d.ready for d in alive):
            return
        if self._next is None:
            self._next = max(d.clock.time_at(d.blocks[0].first_index + _HALF) for d in alive)
        while all(d.reaches(self._next + self._window_ns) for d in alive):
            yield self._recording(self._next)
            self._next += self._step
            for device in self._devices.values():
                if device.blocks:
                    device.forget(self._next)

    @property
    def _window_ns(self) -> int:
        return round(self._n / self._rate * 1e9)

    def _recording(self, start: int) -> Recording:
        signals = {name: self._resampled(device, start) for name, device in self._devices.items()}
        gaps = tuple(gap for name, signal in signals.items() for gap in _gaps(name, signal))
        temperatures = [device.temperature() for device in self._devices.values() if device.blocks]
        return Recording(
            channels=self._channels,
            data=np.column_stack([signals[channel.device][:, channel.axis] for channel in self._channels]),
            rate=self._rate,
            start=start,
            temperature=float(np.mean(temperatures)),
            gaps=gaps,
        )

    def _resampled(self, device: _Device, start: int) -> FloatArray:
        """Return a device's scans on the grid (n_samples, n_axes)."""
        if not device.blocks:
            return np.full((self._n, 3), np.nan)
        index, rate = device.clock.index_at(start)
        position: FloatArray = index + np.arange(self._n, dtype=float) * (rate / self._rate)
        first = int(position[0]) - _HALF
        return interpolate(device.scans(first, int(position[-1]) + _HALF + 2), position - first)


def _gaps(device: str, signal: FloatArray) -> Iterator[Gap]:
    missing = np.isnan(signal).any(1)
    edges = np.flatnonzero(np.diff(np.r_[False, missing, False].astype(np.int8)))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield Gap(device=device, start=start, stop=stop)

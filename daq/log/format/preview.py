"""Preview messages for stock viewers: one message per scan, at a reduced rate.

Scans of a device are low-pass filtered with linear phase and decimated, without aliasing or shift in time. Missing
scans remain missing: the filter restarts after a gap, with half its length.
"""

from dataclasses import dataclass

import numpy as np

from daq.log.format.ros_messages import encode_scans, message_kind
from daq.timing.scan_clocks import ScanClock, ScanClocks
from daq.types import Block, Flag, FloatArray, IndexArray

VIEW = "/view/"
_HALF = 9  # kept scans on each side of the filter's middle: 60 dB from 0.6 of the view's rate on
_BETA = 5.65  # of its Kaiser window: 60 dB
_NO_SCANS = np.zeros((0, 0), np.int32)


@dataclass(frozen=True, eq=False)
class ViewMessage:
    """One scan of the view."""

    topic: str
    kind: str  #: name of the message's schema
    time: int  #: when it was taken [ns UTC]
    data: bytes


class View:
    """Makes the view of a run's blocks, of each device in order.

    Parameters
    ----------
    rate : scans per second [Hz]; of a device the nearest that divides its own, all of one that is slower
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._devices: dict[str, _DeviceView] = {}
        self._clocks = ScanClocks()

    def add(self, block: Block) -> list[ViewMessage]:
        """Add a block; return the scans that can be shown now."""
        device = self._devices.get(block.device)
        if device is None or block.flags & Flag.RESTARTED or not device.goes_on(block):
            device = self._devices[block.device] = _DeviceView(block.rate, self._rate)
        times, scans = device.add(block, self._clocks.add(block))
        if not len(times):
            return []
        topic, kind = VIEW + block.device, message_kind(scans.shape[1])
        messages = encode_scans(block.device, times, scans)
        return [ViewMessage(topic, kind, time, data) for time, data in zip(times.tolist(), messages, strict=True)]


class _DeviceView:
    """One device from one start to the next."""

    def __init__(self, rate: float, view_rate: float) -> None:
        self._every = max(1, round(rate / view_rate))
        self._taps = _low_pass(self._every)
        self._kept, self._end = _NO_SCANS, 0  # scans that the filter still needs, and the index behind them
        self._last = 0  # time of the last scan shown [ns UTC]

    def goes_on(self, block: Block) -> bool:
        """Return whether a block is later than the previous ones: a restarted log repeats some."""
        return block.first_index >= self._end

    def add(self, block: Block, clock: ScanClock) -> tuple[IndexArray, FloatArray]:
        """Take a block and its clock; return times (n,) [ns UTC] and accelerations (n, n_axes) [m/s2]."""
        continues = block.first_index == self._end and len(self._kept)
        counts = np.concatenate([self._kept, block.counts]) if continues else block.counts
        self._end = block.end_index
        self._kept = counts[max(0, len(counts) - len(self._taps) + 1) :]
        begin = self._end - len(counts)
        half = len(self._taps) // 2
        centre = np.arange(-(-(begin + half) // self._every) * self._every, self._end - half, self._every)
        if not len(centre):
            return centre, np.zeros((0, counts.shape[1]))
        windows = np.lib.stride_tricks.sliding_window_view(counts, len(self._taps), axis=0)
        # seven digits are sufficient for a plot; more would double the size on the disk
        scans = (windows[centre - half - begin] @ self._taps * block.scale).astype(np.float32)
        return self._times(clock.times(centre)), scans.astype(np.float64)

    def _times(self, times: IndexArray) -> IndexArray:
        """Return times of scans [ns UTC] that never go back."""
        times = np.maximum(times, self._last + 1 + np.arange(len(times)))
        self._last = int(times[-1])
        return times


def _low_pass(every: int) -> FloatArray:
    """Return the filter (odd,) before every so many are kept: half at half of the view's rate; of sum 1."""
    if every == 1:
        return np.ones(1)
    k = np.arange(-_HALF * every, _HALF * every + 1)
    taps = np.sinc(k / every) * np.kaiser(len(k), _BETA)
    return np.asarray(taps / taps.sum())

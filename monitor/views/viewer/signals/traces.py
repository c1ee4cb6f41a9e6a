"""Signals as measured: the last ones of a log, or of a live stream."""

import numpy as np
import rerun as rr

from daq import Block, Channel, Flag, Recording
from daq.timing import ScanClock, ScanClocks
from monitor.results.windows import ReferenceResult
from monitor.views.palette import SENSOR
from monitor.views.viewer.primitives import once, times

SECONDS = 10.0
_CHUNK_SECONDS = 1.0


def draw_signals(recording: rr.RecordingStream, signals: Recording) -> None:
    """Draw the last ten seconds of each channel; a gap is a break in the line."""
    first = max(0, len(signals.data) - round(SECONDS * signals.rate))
    index = np.arange(first, len(signals.data))
    column = times(signals.start + np.round(index / signals.rate * 1e9).astype(np.int64))
    for number, channel in enumerate(signals.channels):
        path = signal_path(channel.name)
        _style(recording, channel.name)
        recording.send_columns(path, [column], rr.Scalars.columns(scalars=signals.data[first:, number]))


def signal_span(signals: Recording) -> tuple[float, float]:
    """Return the lowest and the highest value [m/s2] of the drawn seconds of all channels, symmetric about zero."""
    last = signals.data[-round(SECONDS * signals.rate) :]
    largest = float(np.nanmax(np.abs(last), initial=0.0)) if np.isfinite(last).any() else 0.0
    return -largest, largest


def _style(recording: rr.RecordingStream, channel: str) -> None:
    style = rr.SeriesLines(colors=[SENSOR], names=[channel], widths=[0.9], aggregation_policy="MinMax")
    once(recording, signal_path(channel), style)


def signal_path(channel: str) -> str:
    """Return the entity of a channel."""
    return rr.new_entity_path(["signal", channel])


class ServerEndedError(Exception):
    """Rerun's server takes nothing any more, or never did: its port was taken before it listened."""


class SignalStream:
    """Signals of the arriving blocks, on the own or shared clocks of devices, without known delays.

    Parameters
    ----------
    recording : that gets them
    channels : that are drawn

    Raises
    ------
    ServerEndedError
        By `add`, when its receiver has ended.
    """

    def __init__(self, recording: rr.RecordingStream, channels: tuple[Channel, ...]) -> None:
        self._recording, self._channels = recording, channels
        self._clocks = ScanClocks()
        self._waiting: dict[str, list[Block]] = {}
        self._late: dict[str, int] = {}  # device -> how late it is [ns]
        for channel in channels:
            _style(recording, channel.name)

    def know(self, reference: ReferenceResult) -> None:
        """Take the devices' delays that a baseline has shown."""
        self._late = {device: round(1e9 * late) for device, late in reference.late.items()}

    def add(self, block: Block) -> None:
        """Take a block; about a second of them is sent at once, which costs far less than one by one."""
        clock = self._clocks.add(block)
        waiting = self._waiting.setdefault(block.device, [])
        if block.flags & Flag.RESTARTED or (waiting and not _continues(waiting[-1], block)):
            waiting.clear()
        waiting.append(block)
        if sum(b.n_scans for b in waiting) >= block.rate * _CHUNK_SECONDS:
            self._send(block.device, waiting, clock)
            waiting.clear()

    def _send(self, device: str, blocks: list[Block], clock: ScanClock) -> None:
        index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
        column = times(clock.times(index) - self._late.get(device, 0))
        values = np.concatenate([b.counts * b.scale for b in blocks])
        for channel in self._channels:
            if channel.device == device and channel.axis < values.shape[1]:
                scalars = rr.Scalars.columns(scalars=values[:, channel.axis])
                self._recording.send_columns(signal_path(channel.name), [column], scalars)
        try:
            self._recording.flush()  # data wait before this process, where they are bounded and counted
        except RuntimeError as error:
            raise ServerEndedError(str(error)) from error


def _continues(last: Block, block: Block) -> bool:
    """Return whether a block can be drawn with the one before it; blocks between them may have been dropped."""
    alike = (block.clock, block.rate, block.counts.shape[1]) == (last.clock, last.rate, last.counts.shape[1])
    return alike and block.first_index >= last.end_index

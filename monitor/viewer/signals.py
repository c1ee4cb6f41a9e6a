"""Signals as they were measured: the last of a log, or of a live stream."""

import numpy as np
import rerun as rr

from daq import Block, Channel, ClockFit, Flag, Recording
from monitor.viewer.draw import times
from monitor.viewer.palette import SENSOR

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


def _style(recording: rr.RecordingStream, channel: str) -> None:
    style = rr.SeriesLines(colors=[SENSOR], names=[channel], widths=[0.9], aggregation_policy="MinMax")
    recording.log(signal_path(channel), style, static=True)


def signal_path(channel: str) -> str:
    """Return the entity of a channel."""
    return rr.new_entity_path(["signal", channel])


class SignalStream:
    """Signals as the blocks come, each device by its own clock.

    Parameters
    ----------
    recording : that gets them
    channels : that are drawn
    """

    def __init__(self, recording: rr.RecordingStream, channels: tuple[Channel, ...]) -> None:
        self._recording, self._channels = recording, channels
        self._clocks: dict[str, ClockFit] = {}
        self._waiting: dict[str, list[Block]] = {}
        for channel in channels:
            _style(recording, channel.name)

    def add(self, block: Block) -> None:
        """Take a block; about a second of them is sent at once, which costs far less than one by one."""
        if block.device not in self._clocks or block.flags & Flag.RESTARTED:
            self._clocks[block.device] = ClockFit(block.rate)
            self._waiting[block.device] = []
        self._clocks[block.device].add(block.pair_index, block.pair_time)
        waiting = self._waiting[block.device]
        waiting.append(block)
        if sum(b.n_scans for b in waiting) >= block.rate * _CHUNK_SECONDS:
            self._send(block.device, waiting)
            self._waiting[block.device] = []

    def _send(self, device: str, blocks: list[Block]) -> None:
        clock = self._clocks[device]
        first, last = blocks[0].first_index, blocks[-1].end_index - 1
        index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
        start, end = clock.time_at(first), clock.time_at(last)
        step = (end - start) / max(last - first, 1)
        column = times(start + np.round((index - first) * step).astype(np.int64))
        values = np.concatenate([b.counts * b.scale for b in blocks])
        for channel in self._channels:
            if channel.device == device and channel.axis < values.shape[1]:
                scalars = rr.Scalars.columns(scalars=values[:, channel.axis])
                self._recording.send_columns(signal_path(channel.name), [column], scalars)

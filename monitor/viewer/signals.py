"""The end of the signals, as they were measured."""

import numpy as np
import rerun as rr

from daq import Recording
from monitor.viewer.draw import times
from monitor.viewer.palette import SENSOR

SECONDS = 10.0


def draw_signals(recording: rr.RecordingStream, signals: Recording) -> None:
    """Draw the last ten seconds of each channel; a gap is a break in the line."""
    first = max(0, len(signals.data) - round(SECONDS * signals.rate))
    index = np.arange(first, len(signals.data))
    column = times(signals.start + np.round(index / signals.rate * 1e9).astype(np.int64))
    for number, channel in enumerate(signals.channels):
        path = signal_path(channel.name)
        style = rr.SeriesLines(colors=[SENSOR], names=[channel.name], widths=[0.9], aggregation_policy="MinMax")
        recording.log(path, style, static=True)
        recording.send_columns(path, [column], rr.Scalars.columns(scalars=signals.data[first:, number]))


def signal_path(channel: str) -> str:
    """Return the entity of a channel."""
    return rr.new_entity_path(["signal", channel])

"""Mode shapes as bars per channel, where no structure is known."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from monitor.results.run_results import find_mode
from monitor.results.windows import ReferenceResult, WindowResult
from monitor.views.palette import GREY, TEXT, mode_colour
from monitor.views.viewer.primitives import at, once, text
from oma import mac_matrix

NAMES, HEAD = 130.0, 40.0  #: room for the names of channels at the left, and for those of modes at the top
_COLUMN, _ROW = 100.0, 24.0  # of a mode, and of a channel
_LONGEST, _RADIUS, _POINT = 42.0, 3.0, 3.4
_HINT = (
    "One column per mode, one row per channel; the longest bar of a mode has the largest component. Bars: baseline. "
    "White points: last window, scaled to the baseline; away from the end of the bar, the shape has changed."
)


def size(n_modes: int, n_channels: int) -> tuple[float, float]:
    """Return width and height of the drawing, without the room for names."""
    return _COLUMN * n_modes, _ROW * (n_channels + 1)


def draw_bars(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw the shapes of the baseline from a time on [ns UTC]."""
    once(recording, "/shapes/hint", rr.TextDocument(_HINT, media_type="text/markdown"))
    at(recording, time)
    rows = [[-NAMES / 2, _ROW * (i + 0.5) - 9.0] for i in range(len(reference.channels))]
    text(recording, "/shapes/channels", rows, reference.channels, [GREY], static=False)
    heads = [[_COLUMN * (k + 0.5), -26.0] for k in range(len(reference.modes))]
    labels = [f"{mode.id}: {mode.frequency:.4g} Hz" for mode in reference.modes]
    text(recording, "/shapes/modes", heads, labels, [TEXT], static=False)
    for k, mode in enumerate(reference.modes):
        lengths = _LONGEST * np.array(mode.shape) / np.abs(mode.shape).max()
        middle = _COLUMN * (k + 0.5)
        bars = [[[middle, _ROW * (i + 0.5)], [middle + x, _ROW * (i + 0.5)]] for i, x in enumerate(lengths)]
        zero = [[middle, 0.0], [middle, _ROW * len(lengths)]]
        recording.log(
            f"/shapes/mode_{mode.id}",
            rr.LineStrips2D(
                [*bars, zero], colors=[mode_colour(mode.id)] * len(bars) + [GREY], radii=[_RADIUS] * len(bars) + [0.5]
            ),
        )


def draw_window_bars(
    recording: rr.RecordingStream, reference: ReferenceResult, windows: Sequence[WindowResult]
) -> None:
    """Draw the shapes of windows, scaled to those of the baseline, and their MAC."""
    for window in windows:
        at(recording, window.end)
        common = [i for i, channel in enumerate(reference.channels) if channel in window.channels]
        places, macs = [], []
        for k, mode in enumerate(reference.modes):
            found = find_mode(window, mode.id)
            if found is None or not common:
                continue
            base = np.array(mode.shape)[common]
            now = np.array([found.shape[window.channels.index(reference.channels[i])] for i in common])
            scaled = now * (now @ base) / max(now @ now, 1e-12) / np.abs(mode.shape).max()
            places += [
                [_COLUMN * (k + 0.5) + _LONGEST * x, _ROW * (i + 0.5)] for i, x in zip(common, scaled, strict=True)
            ]
            mac = float(mac_matrix(base[None], now[None])[0, 0])
            macs.append(([_COLUMN * (k + 0.5), _ROW * (len(reference.channels) + 0.2)], f"MAC {mac:.3f}"))
        recording.log("/shapes/window", rr.Points2D(places, radii=_POINT, colors=[TEXT]))
        text(recording, "/shapes/mac", [place for place, _ in macs], [label for _, label in macs], [GREY], static=False)

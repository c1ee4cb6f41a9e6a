"""Bars with names: one row per mode or sensor, one bar per model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.views.palette import ALARM, DIM, GREY, OK, TEXT
from monitor.views.viewer.primitives import bars, text

WITHOUT, WITH = ALARM, OK  #: colours of the figures without and with the causes
_LENGTH, _ROW, _BAR = 100.0, 14.0, 2.0  # of the longest bar, of a row, and half of a bar's height
_NAME, _VALUE = 30.0, 34.0  # room for names at the left, and for values at the right


@dataclass(frozen=True, eq=False, kw_only=True)
class NamedBars:
    """Values of named rows."""

    names: tuple[str, ...]
    without: FloatArray  #: (n_rows,) NaN where not known
    with_causes: FloatArray  #: (n_rows,) likewise
    noise: FloatArray  #: (n_rows,) part that noise explains
    form: str  #: of the values as text

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Bounds of the drawing, x and y."""
        return (-_NAME - 4.0, _LENGTH + _VALUE), (-4.0, _ROW * max(len(self.names), 4) + 4.0)


def draw_named_bars(recording: rr.RecordingStream, path: str, rows: NamedBars) -> None:
    """Draw both values of each row from a common zero, and marks at the noise."""
    values = np.concatenate([[0.0], rows.without, rows.with_causes, rows.noise])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if low < 0:
        low = min(low, -float(np.nanmax(rows.noise, initial=0.0)))  # noise is drawn to both sides
    scale = _LENGTH / max(high - low, 1e-12)

    def x(value: float) -> float:
        return scale * (value - low)

    middle: FloatArray = _ROW * (np.arange(float(len(rows.names))) + 0.5)
    ends, colours, places, labels = [], [], [], []
    for series, colour, shift in ((rows.without, WITHOUT, -1.3 * _BAR), (rows.with_causes, WITH, 1.3 * _BAR)):
        for y, value in zip((middle + shift).tolist(), series.tolist(), strict=True):
            if np.isfinite(value):
                ends.append((x(0.0), x(value), y))
                colours.append(colour)
                places.append([_LENGTH + _VALUE / 2, y - 4.5])
                labels.append(format(value, rows.form))
    bars(recording, f"{path}/bars", ends, _BAR, colours)
    text(recording, f"{path}/values", places, labels, colours)
    zero = [[[x(0.0), 0.0], [x(0.0), _ROW * len(rows.names)]]]
    recording.log(f"{path}/zero", rr.LineStrips2D(zero, colors=[DIM], draw_order=5.0), static=True)
    noise = _noise_marks(rows.noise, middle, x, both=low < 0)
    thin = rr.Radius.ui_points(1.0)
    recording.log(f"{path}/noise", rr.LineStrips2D(noise, colors=[TEXT], radii=thin, draw_order=20.0), static=True)
    text(recording, f"{path}/names", [[-_NAME / 2, y - 4.5] for y in middle.tolist()], rows.names, [GREY])


Line = list[list[float]]


def _noise_marks(noise: FloatArray, middle: FloatArray, x: Callable[[float], float], *, both: bool) -> list[Line]:
    """Return a line across each row at its noise, and at the opposite where values have both signs."""
    marks = []
    for y, value in zip(middle.tolist(), noise.tolist(), strict=True):
        for sign in (1, -1) if both else (1,):
            if np.isfinite(value):
                marks.append([[x(sign * value), y - 0.4 * _ROW], [x(sign * value), y + 0.4 * _ROW]])
    return marks

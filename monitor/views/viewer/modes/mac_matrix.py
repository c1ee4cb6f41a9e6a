"""Matrices of MAC values: the auto-MAC of the baseline, and the model against measured modes."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.windows import ReferenceResult
from monitor.views.geometry import Geometry
from monitor.views.palette import GREY, TEXT, heat
from monitor.views.viewer.modes.shapes import shapes_at_sensors
from monitor.views.viewer.primitives import text
from oma import mac_matrix

BOUNDS = ((-40.0, 250.0), (-34.0, 250.0))  # of the drawing, x and y
_PIXELS = 240
_WRITTEN = 12  # rows or columns up to which each value is written
_MIN_WRITTEN = 0.05


def draw_auto_mac(recording: rr.RecordingStream, reference: ReferenceResult, *, static: bool = True) -> None:
    """Draw the MAC of every mode of a reference with every other, at the sensors."""
    names = [str(mode.id) for mode in reference.modes]
    draw_mac(recording, "/auto_mac", auto_mac(reference), names, names, static=static)


def auto_mac(reference: ReferenceResult) -> FloatArray:
    """Return the MAC (n_modes, n_modes) of the modes at the sensors: how well these distinguish them."""
    if reference.has_model:
        shapes = shapes_at_sensors(Geometry(reference), reference, list(reference.sensors))
    else:
        shapes = np.array([mode.shape for mode in reference.modes])
    return mac_matrix(shapes, shapes) if shapes.size else np.zeros((0, 0))


def draw_mac(
    recording: rr.RecordingStream,
    path: str,
    mac: FloatArray,
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    static: bool = True,
) -> None:
    """Draw a matrix (n_rows, n_columns) as coloured squares with the names of its rows and columns; NaN as zero."""
    if not mac.size:
        return
    n_rows, n_columns = mac.shape
    row, column = (np.minimum((np.arange(_PIXELS) * n) // _PIXELS, n - 1) for n in mac.shape)
    squares = heat(np.nan_to_num(mac).ravel()).reshape(n_rows, n_columns, 3)[row][:, column]
    recording.log(f"{path}/squares", rr.Image(squares), static=static)
    x = [_PIXELS / n_columns * (k + 0.5) for k in range(n_columns)]
    y = [_PIXELS / n_rows * (i + 0.5) for i in range(n_rows)]
    places = [*([a, -26.0] for a in x), *([-22.0, b - 10.0] for b in y)]
    text(recording, f"{path}/names", places, [*columns, *rows], [GREY], static=static)
    is_small = max(mac.shape) <= _WRITTEN
    written = [(i, k) for (i, k), value in np.ndenumerate(mac) if is_small and value >= _MIN_WRITTEN]
    values = [[x[k], y[i] - 10.0] for i, k in written]
    text(recording, f"{path}/values", values, [f"{mac[i, k]:.2f}" for i, k in written], [TEXT], static=static)

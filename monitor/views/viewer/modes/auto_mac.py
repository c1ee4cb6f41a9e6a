"""Auto-MAC of the baseline: how well the sensors distinguish its modes."""

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.windows import ReferenceResult
from monitor.views.geometry import Geometry
from monitor.views.palette import GREY, TEXT, heat
from monitor.views.viewer.modes.shapes import shapes_at_sensors
from monitor.views.viewer.primitives import text
from oma import mac_matrix

BOUNDS = ((-30.0, 250.0), (-30.0, 250.0))  # of the drawing, x and y
_PIXELS = 240
_WRITTEN = 12  # modes up to which each value is written
_MIN_WRITTEN = 0.01


def draw_auto_mac(recording: rr.RecordingStream, reference: ReferenceResult, *, static: bool = True) -> None:
    """Draw the MAC of every mode of a reference with every other, at the sensors, as squares."""
    mac = auto_mac(reference)
    n = len(mac)
    if not n:
        return
    step = _PIXELS / n
    pixel = np.minimum((np.arange(_PIXELS) * n) // _PIXELS, n - 1)
    squares = heat(mac.ravel()).reshape(n, n, 3)[pixel][:, pixel]
    recording.log("/auto_mac/squares", rr.Image(squares), static=static)
    middle = [step * (k + 0.5) for k in range(n)]
    names = [str(mode.id) for mode in reference.modes]
    places = [*([x, -24.0] for x in middle), *([-16.0, y - 10.0] for y in middle)]
    text(recording, "/auto_mac/names", places, [*names, *names], [GREY], static=static)
    written = [(i, k) for i in range(n) for k in range(n) if n <= _WRITTEN and mac[i, k] >= _MIN_WRITTEN]
    values = [[middle[k], middle[i] - 10.0] for i, k in written]
    text(recording, "/auto_mac/values", values, [f"{mac[i, k]:.2f}" for i, k in written], [TEXT], static=static)


def auto_mac(reference: ReferenceResult) -> FloatArray:
    """Return the MAC (n_modes, n_modes) of the modes at the sensors."""
    shapes = shapes_at_sensors(Geometry(reference), reference, list(reference.sensors))
    return mac_matrix(shapes, shapes) if len(shapes) else np.zeros((0, 0))

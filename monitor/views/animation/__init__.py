"""Animated mode shapes: a page that turns, or a GIF."""

from pathlib import Path

from monitor.results.sensor_geometry import SensorGeometry
from monitor.views.animation.drawing import Drawing, Motion
from monitor.views.animation.gif import write_gif
from monitor.views.animation.page import write_page
from oma import ModalEstimate
from updater.validation import ModelModes

_WRITERS = {".html": write_page, ".gif": write_gif}
SUFFIXES = tuple(_WRITERS)  #: endings of the names of files that can be written


def write_animation(path: Path, estimate: ModalEstimate, on: ModelModes | SensorGeometry) -> None:
    """Write all measured mode shapes in motion, on a structure or at sensors; an existing file is replaced.

    Parameters
    ----------
    path : of an .html page, which needs no network, or of a .gif
    estimate : measured modes
    on : modes of the model that were compared with them, or positions of the sensors

    Raises
    ------
    OSError
        If the file cannot be written.
    ValueError
        If its name ends otherwise.
    """
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ValueError(f"expected a name that ends with {' or '.join(SUFFIXES)}")
    motion = Motion.of_sensors(estimate, on) if isinstance(on, SensorGeometry) else Motion.of_model(estimate, on)
    drawing = Drawing(estimate, motion)
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    try:
        writer(part, drawing)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)

"""Animated mode shapes as one page that needs no network: the structure turns with the mouse or a finger."""

from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from daq import FloatArray
from monitor.views.animation.drawing import Drawing
from monitor.views.geometry import screen

_DIGITS = 5  # of lengths, as shares of the structure's size


def write_page(path: Path, drawing: Drawing) -> None:
    """Write a page.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    environment = Environment(
        loader=PackageLoader("monitor.views.animation", "."),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
    )
    text = environment.get_template("page.html").render(title=drawing.name, labels=drawing.labels, data=_data(drawing))
    path.write_text(text, encoding="utf-8")


def _data(drawing: Drawing) -> dict[str, Any]:
    """Return lengths as shares of the reach, and the angles of the first view [rad]."""
    scale = 1 / drawing.reach
    right, _ = screen(drawing.towards)
    return {
        "points": _rounded(scale * (drawing.points - drawing.centre)),
        "spans": drawing.spans,
        "ribs": drawing.ribs,
        "sensors": drawing.sensors,
        "modes": [{"re": _rounded(scale * m.real), "im": _rounded(scale * m.imag)} for m in drawing.motion],
        "azimuth": float(np.arctan2(right[1], right[0])),
        "elevation": float(np.arcsin(drawing.towards[2])),
    }


def _rounded(values: FloatArray) -> list[list[float]]:
    rounded: list[list[float]] = np.round(values, _DIGITS).tolist()
    return rounded

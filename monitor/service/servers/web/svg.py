"""Small pictures of the status page, as SVG: the structure with its sensors, and courses over the last windows."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from markupsafe import Markup

from daq import FloatArray
from monitor.results.windows import ReferenceResult

_WIDTH, _HEIGHT, _EDGE = 320.0, 220.0, 16.0
_VIEW = np.array([[0.90, -0.44, 0.0], [0.17, 0.35, 0.92]])  # to the right, upwards: seen from the front, above


def structure_svg(reference: ReferenceResult, places: Sequence[tuple[float, float, float]]) -> Markup:
    """Return the members, the sensors, and where the change is [m]."""
    nodes = np.array(reference.nodes) @ _VIEW.T
    low, high = nodes.min(0), nodes.max(0)
    scale = float(np.min((np.array([_WIDTH, _HEIGHT]) - 2 * _EDGE) / np.maximum(high - low, 1e-9)))
    offset = (np.array([_WIDTH, _HEIGHT]) - scale * (high - low)) / 2

    def at(points: FloatArray) -> FloatArray:
        flat = offset + scale * (points - low)
        return np.column_stack([flat[:, 0], _HEIGHT - flat[:, 1]])

    flat = at(nodes)
    parts = [_line(flat[order], "member") for order in reference.lines.values()]
    sensors = np.array([place for place, _ in reference.sensors.values()]).reshape(-1, 3) @ _VIEW.T
    parts += [f'<circle class="sensor" cx="{x:.1f}" cy="{y:.1f}" r="4"/>' for x, y in at(sensors)]
    changes = np.array(places).reshape(-1, 3) @ _VIEW.T
    parts += [f'<circle class="change" cx="{x:.1f}" cy="{y:.1f}" r="9"/>' for x, y in at(changes)]
    return _svg(parts, _WIDTH, _HEIGHT, "the structure, its sensors, and where it has changed")


def course_svg(values: Sequence[float | None], limit: float | None = None, height: float = 44.0) -> Markup:
    """Return a course of values, oldest first, with a limit if there is one, or else with zero.

    Parameters
    ----------
    values : at least one that is not None; None where there is no value, which is marked
    limit : level of the dashed line
    height : of the picture
    """
    level = 0.0 if limit is None else limit
    known = [value for value in values if value is not None]
    low, high = min(*known, level), max(*known, level)
    span = max(high - low, 1e-12)
    places = np.linspace(3, _WIDTH - 3, len(values)) if len(values) > 1 else np.array([_WIDTH / 2])
    base = height - 4 - (level - low) / span * (height - 8)
    parts = [_line(np.array([[0, base], [_WIDTH, base]]), "zero" if limit is None else "limit")]
    pairs = list(zip(places.tolist(), values, strict=True))
    for is_known, run in groupby(pairs, key=lambda pair: pair[1] is not None):
        points = np.array([[x, height - 4 - ((value or 0.0) - low) / span * (height - 8)] for x, value in run])
        if is_known:
            parts.append(_line(points, "course") if len(points) > 1 else _dot(points[0], 1.5))
            last = points[-1]
        else:
            parts += [_line(np.array([[x, height], [x, height - 7]]), "missing") for x, _ in points]
    parts.append(_dot(last, 3))
    return _svg(parts, _WIDTH, height, "last windows")


def _dot(place: FloatArray, radius: float) -> str:
    return f'<circle class="now" cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="{radius:g}"/>'


def _line(points: FloatArray, kind: str) -> str:
    return f'<polyline class="{kind}" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}"/>'


def _svg(parts: Sequence[str], width: float, height: float, label: str) -> Markup:
    head = f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{label}">'
    return Markup(head + "".join(parts) + "</svg>")  # numbers and words of our own only

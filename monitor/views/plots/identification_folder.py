"""All that an identification has to show, as files of a folder."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from daq import FloatArray, Recording
from monitor.results.sensor_geometry import SensorGeometry
from monitor.views.animation.drawing import Drawing, Motion
from monitor.views.geometry import screen
from oma import Identification, ModalEstimate, Place, plot_spectrum, plot_tracks, write_universal
from oma.plots import LINE, STABLE, complexity_figure, mac_with_model_figure
from updater import Structure
from updater.validation import ModelModes

_DPI = 110
_OVER_TIME = "tracks.png"
_TRACKS = 12  # windows from which on identities can be followed
_SAME = 1e-9  # m: places that are one

Vector = tuple[float, float, float]
_COLUMNS = 4
_WIDTH = 3.6  # inches of a picture
_ROOM = 0.06  # of the structure's size, around it
_TRIAD = 0.12  # of its size: arrows of the directions
_REST, _SUPPORT = "#c3cad3", "#2e7d32"
_ARROW = {"arrowstyle": "->", "color": LINE, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}


@dataclass(frozen=True, eq=False, kw_only=True)
class Results:
    """Results to be written."""

    estimate: ModalEstimate  #: estimate of all windows
    windows: Sequence[ModalEstimate]
    recording: Recording  #: a window ...
    found: Identification  #: ... and its identification
    model: ModelModes | None  #: model to compare with
    geometry: SensorGeometry | None  #: positions of the sensors, used without a model
    content: Mapping[str, Any]  #: content of modes.json


def write_folder(folder: Path, results: Results) -> list[Path]:
    """Write modes.json, modes.unv and the pictures, over those of an earlier run; return the files.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / "modes.json", folder / "modes.unv"]
    written[0].write_text(json.dumps(results.content, indent=1), encoding="utf-8")
    write_universal(written[1], results.estimate, *_geometry(results))
    (folder / _OVER_TIME).unlink(missing_ok=True)  # an earlier run may have had more windows
    for name, draw in _pictures(results).items():
        draw().savefig(folder / name, dpi=_DPI)
        written.append(folder / name)
    return written


def _geometry(results: Results) -> tuple[dict[str, Place] | None, dict[int, Vector] | None, list[list[int]]]:
    """Return places of the channels, positions of nodes, and lines; none if they are not known."""
    if results.model:
        return structure_geometry(results.model.structure, results.estimate)
    if results.geometry:
        lines = [[node + 1 for node in chain] for chain in results.geometry.chains]
        return results.geometry.places, dict(enumerate(results.geometry.nodes, 1)), lines
    return None, None, []


def _pictures(results: Results) -> dict[str, Callable[[], Figure]]:
    estimate, model = results.estimate, results.model
    pictures: dict[str, Callable[[], Figure]] = {
        "stabilization.png": lambda: results.found.plot_stabilization(results.recording, estimate),
        "singular_values.png": lambda: plot_spectrum(results.recording, estimate, results.found.harmonics),
        "mac.png": lambda: mac_with_model_figure(estimate, model.near(estimate.frequency) if model else None),
        "shapes.png": lambda: (
            plot_deformed_shapes(estimate, model) if model else estimate.plot_shapes(results.geometry)
        ),
        "complexity.png": lambda: complexity_figure(estimate),
    }
    if len(results.windows) >= _TRACKS:
        pictures[_OVER_TIME] = lambda: plot_tracks(results.windows)
    return pictures


def structure_geometry(
    structure: Structure, estimate: ModalEstimate
) -> tuple[dict[str, Place], dict[int, Vector], list[list[int]]]:
    """Return places of the channels, positions of nodes, and the nodes on each member: its ends and its sensors."""
    sensors = {s.channel: s for s in structure.corrected_sensors}
    points = [sensors[channel].at for channel in estimate.channels]
    points += [end for member in structure.member for end in (member.start, member.end)]
    number = {point: k for k, point in enumerate(dict.fromkeys(points), 1)}
    places = {
        name: Place(node=number[sensors[name].at], direction=_unit(sensors[name].direction))
        for name in estimate.channels
    }
    lines = [_nodes_along(member.start, member.end, number) for member in structure.member]
    return places, {k: point for point, k in number.items()}, lines


def _nodes_along(start: Vector, end: Vector, number: Mapping[Vector, int]) -> list[int]:
    """Return the nodes on a straight line from its start to its end."""
    first, span = np.array(start), np.subtract(end, start)
    share = {point: float(np.dot(np.subtract(point, first), span) / np.dot(span, span)) for point in number}
    on = [p for p, s in share.items() if 0 <= s <= 1 and np.linalg.norm(first + s * span - p) < _SAME]
    return [number[point] for point in sorted(on, key=lambda p: share[p])]


def _unit(direction: Vector) -> Vector:
    x, y, z = (np.array(direction) / np.linalg.norm(direction)).tolist()
    return x, y, z


def plot_deformed_shapes(estimate: ModalEstimate, compared: ModelModes) -> Figure:
    """Draw all measured shapes, expanded to the nodes of the model.

    Parameters
    ----------
    estimate : measured modes
    compared : modes of the model that were compared with them
    """
    drawing = Drawing(estimate, Motion.of_model(estimate, compared))
    paper = np.column_stack(screen(drawing.towards))
    rest = drawing.points @ paper
    moved = [rest + extreme @ paper for extreme in map(_extreme, drawing.motion)]
    every = np.concatenate([rest, *moved])
    room = _ROOM * drawing.size
    low, high = every.min(0) - [room + 1.4 * _TRIAD * drawing.size, room], every.max(0) + room
    rows = -(-len(moved) // _COLUMNS)
    columns = min(_COLUMNS, len(moved))
    tall = float(np.clip(_WIDTH * (high - low)[1] / (high - low)[0], 1.5, 4.5))
    figure = Figure(figsize=(_WIDTH * columns, (tall + 0.5) * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    held = [support.at for support in compared.structure.support]
    feet = np.array(held, float).reshape(-1, 3) @ paper
    for axes in grid:
        axes.set_axis_off()
    for k, (axes, points) in enumerate(zip(grid, moved, strict=False)):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.add_collection(LineCollection([rest[[a, b]] for a, b in drawing.spans], colors=_REST, linewidths=1.5))
        axes.add_collection(LineCollection([points[[a, b]] for a, b in drawing.ribs], colors=STABLE, linewidths=0.8))
        axes.add_collection(LineCollection([points[[a, b]] for a, b in drawing.spans], colors=STABLE, linewidths=2.0))
        axes.plot(*points[drawing.sensors].T, "o", markersize=4, color=LINE)
        axes.plot(*feet.T, "^", markersize=7, color=_SUPPORT)
        axes.set_title(drawing.labels[k], fontsize=9)
    _directions(grid[0], low + room + [0.3 * _TRIAD * drawing.size, 0.0], _TRIAD * drawing.size * paper)
    return figure


def _extreme(motion: FloatArray) -> FloatArray:
    """Return complex motions (n, 3) at the phase of their largest component."""
    largest = motion.ravel()[np.argmax(np.abs(motion))]
    return np.real(motion * np.conj(largest) / max(abs(largest), 1e-300))


def _directions(axes: Axes, origin: FloatArray, arms: FloatArray) -> None:
    """Draw the directions of the global axes (3, 2) at a point (2,)."""
    for name, arm in zip("xyz", arms, strict=True):
        (x, y), (tip_x, tip_y), (text_x, text_y) = (origin + share * arm for share in (0.0, 1.0, 1.25))
        axes.annotate("", (tip_x, tip_y), (x, y), arrowprops=_ARROW)
        axes.text(text_x, text_y, name, fontsize=8, color=LINE, ha="center", va="center")

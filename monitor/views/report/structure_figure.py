"""The structure and its mode shapes in parallel projection."""

import math
from collections.abc import Sequence
from itertools import pairwise
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.results.comparison import PlaceDensity
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import Interval, MassAnswer, MassIncrements, ReferenceResult
from monitor.views.geometry import Geometry, screen
from monitor.views.member_axis import sigmas
from monitor.views.report.svg import ADDED, REGION, REMOVED, SENSOR, WARN, bare, mode_colour
from oma.plots import FAINT, INK, SOFT, new_figure
from updater.quantities import Vector

_SIDE = (30.0, 20.0)  # degrees: azimuth and elevation of the eye
_AMPLITUDE = 0.16  # of the structure's size: the largest increment
_HEAT = LinearSegmentedColormap.from_list("heat", ["#cc3340", "#f08a3c", "#f2c35c", "#c9d0d8"])
_SIGNED = LinearSegmentedColormap.from_list("signed", [REMOVED, "#d5dae0", ADDED])
_PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}
_LEADER = {"arrowstyle": "-", "color": INK, "linewidth": 0.7, "shrinkB": 4}
_ARROW = {"arrowstyle": "->", "color": SOFT, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
_TRIAD = 0.1  # of the structure's size: length of the arrows of the directions
_SAME_LABEL = 0.08  # of the structure's size: places that are nearer have one label
_LABEL_WIDTH = 32  # characters of a line
_LETTER = (0.021, 0.045)  # of the structure's size: width and height of a letter of a member's name
_SHARES = (0.5, 0.3, 0.7, 0.15, 0.85)  # of a member's length: places of its name, the best first
_FAR = 6.0  # sigmas: from here on a place is drawn as cold
_COLUMNS = 4
_SWAY = 0.14  # of the structure's size: the largest displacement
_ROOM = 0.02  # of its size, for the markers of sensors


class Frame:
    """A structure seen in parallel projection.

    Parameters
    ----------
    reference : with the geometry
    """

    def __init__(self, reference: ReferenceResult) -> None:
        self.reference, self.geometry = reference, Geometry(reference)
        self._screen = np.column_stack(screen(self.geometry.side(*_SIDE)))

    def flat(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) on paper (..., 2) [m]."""
        return np.asarray(points @ self._screen)

    def draw(self, axes: Axes, *, names: bool = False) -> None:
        """Draw members and supports, with the positions of sensors and the members' names if requested."""
        bare(axes)
        for strip in self.geometry.strips():
            axes.plot(*self.flat(strip).T, color="#c9d0d8", linewidth=4, solid_capstyle="round", zorder=1)
        if names and self.reference.has_model:
            for name, (x, y) in self.name_places().items():
                axes.annotate(name, (x, y), (4, 4), textcoords="offset points", color=SOFT, fontsize=7)
        feet = self.flat(self.geometry.nodes[self.geometry.held])
        axes.plot(*feet.T, linestyle="none", marker="^", markersize=7, color=SOFT, zorder=2)
        self._directions(axes)
        if names:
            places = self.flat(np.array([place for place, _ in self.reference.sensors.values()]).reshape(-1, 3))
            axes.plot(*places.T, "o", markersize=5, color=SENSOR, markeredgecolor="white", zorder=4, label="sensor")
        axes.margins(0.1)

    def name_places(self) -> dict[str, FloatArray]:
        """Return places (2,) on paper [m] of the members' names, which do not overlap; names without room are left out.

        The middle of a member is preferred. Members that are drawn short come first: a long one has room elsewhere.
        """
        strips = zip(self.geometry.lines, map(self.flat, self.geometry.strips()), strict=True)
        boxes: list[FloatArray] = []  # left and lower, right and upper edge
        found = {}
        for name, strip in sorted(strips, key=lambda one: float(np.linalg.norm(one[1][-1] - one[1][0]))):
            extent = self.geometry.size * np.array([len(name) * _LETTER[0], _LETTER[1]])
            for share in _SHARES:
                place = strip[round(share * (len(strip) - 1))]
                box = np.array([place, place + extent])
                if not any((box[0] < other[1]).all() and (other[0] < box[1]).all() for other in boxes):
                    boxes.append(box)
                    found[name] = place
                    break
        return found

    def _directions(self, axes: Axes) -> None:
        """Draw the directions of the axes next to the structure."""
        drawn = self.flat(self.geometry.nodes)
        origin = drawn.min(0) - (0.1 * self.geometry.size, 0.0)
        for name, along in zip("xyz", self.flat(_TRIAD * self.geometry.size * np.eye(3)), strict=True):
            tip = origin + along
            axes.annotate("", tip, origin, arrowprops=_ARROW, zorder=2)
            x, y = origin + 1.3 * along
            axes.text(x, y, name, color=SOFT, fontsize=7, ha="center", va="center")
            axes.update_datalim([tip, origin + 1.3 * along])

    def draw_answer(self, axes: Axes, answer: MassAnswer) -> None:
        """Draw the likelihood's answer: warm where the mass may be, the 95 % region, the best place."""
        far, points = sigmas(answer.profile), answer.profile
        pairs = [i for i in range(len(points) - 1) if points[i].member == points[i + 1].member]
        segments = [self.flat(np.array([points[i].position, points[i + 1].position])) for i in pairs]
        level = [min(far[i], far[i + 1]) for i in pairs]
        heat = LineCollection(segments, cmap=_HEAT, linewidths=4, zorder=3, capstyle="round")
        heat.set_array(np.array(level, float))
        heat.set_clim(0.0, _FAR)
        axes.add_collection(heat)
        self._region(axes, answer.region)
        place = self.flat(np.array(answer.position))
        colour = ADDED if answer.mass >= 0 else REMOVED
        axes.plot(*place, "o", markersize=9, color=colour, markeredgecolor="white", zorder=6, label="best place")
        for number, other in enumerate(answer.others):
            label = "or here" if number == 0 else None
            at = self.flat(np.array(other.position))
            axes.plot(*at, "o", markersize=9, color="white", markeredgecolor=colour, zorder=6, label=label)
        if pairs:
            bar = axes.figure.colorbar(heat, ax=axes, shrink=0.5, pad=0.02, aspect=18)
            bar.set_label("misfit compared with the best place [σ]", fontsize=7)
            bar.ax.invert_yaxis()
            bar.outline.set_visible(False)

    def draw_places(
        self, axes: Axes, places: Sequence[tuple[Vector, list[Interval], str]], *, above: bool = False
    ) -> None:
        """Draw places, each with its 95 % region and its name; the names of places that coincide are one label.

        Parameters
        ----------
        above : whether the labels are above their places
        """
        self._region(axes, [stretch for _, region, _ in places for stretch in region])
        labels: list[tuple[FloatArray, list[str]]] = []
        for position, _, name in places:
            at = self.flat(np.array(position))
            near = (names for other, names in labels if np.linalg.norm(other - at) < _SAME_LABEL * self.geometry.size)
            if (names := next(near, None)) is None:
                labels.append((at, [name]))
                axes.plot(*at, "o", markersize=9, color=ADDED, markeredgecolor="white", zorder=6)
            else:
                names.append(name)
        middle = self.flat(self.geometry.nodes).mean(0)
        for (x, y), names in labels:
            left = x > middle[0]
            text = "\n".join(fill(line, _LABEL_WIDTH) for name in names for line in name.splitlines())
            axes.annotate(
                text, (x, y), (-9 if left else 9, 7 if above else -4),
                textcoords="offset points", fontsize=8, zorder=7, ha="right" if left else "left",
                va="bottom" if above else "top", bbox=_PAPER,
            )  # fmt: skip

    def _region(self, axes: Axes, region: list[Interval]) -> None:
        extended = [stretch for stretch in region if stretch.start != stretch.end]
        for number, stretch in enumerate(extended):
            ends = self.flat(np.array([stretch.start, stretch.end]))
            label = "95 % region" if number == 0 else None
            axes.plot(*ends.T, color=REGION, linewidth=9, alpha=0.8, zorder=2.5, label=label)

    def draw_values(self, axes: Axes, values: FloatArray, what: str) -> None:
        """Draw values (n_nodes,) along the members: red positive, blue negative, nothing where there is none.

        Parameters
        ----------
        values : at each node
        what : name of the values, for the scale
        """
        self.draw(axes)
        largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) or 1.0
        pairs = [pair for nodes in self.geometry.lines.values() for pair in pairwise(nodes.tolist())]
        level = np.array([np.mean(values[list(pair)]) for pair in pairs])
        known = np.flatnonzero(np.isfinite(level))
        segments = [self.flat(self.geometry.nodes[list(pairs[i])]) for i in known]
        heat = LineCollection(segments, cmap=_SIGNED, linewidths=7, zorder=3, capstyle="round")
        heat.set_array(level[known])
        heat.set_clim(-largest, largest)
        axes.add_collection(heat)
        bar = axes.figure.colorbar(heat, ax=axes, shrink=0.6, pad=0.02, aspect=22)
        bar.set_label(what, fontsize=8)
        bar.outline.set_visible(False)

    def draw_density(self, axes: Axes, places: PlaceDensity) -> None:
        """Draw a posterior along the members, each place's sigmas worse than the best."""
        density = np.array(places.density)
        share = np.maximum(density / density.max(), 1e-300)
        far = np.minimum(np.sqrt(-2 * np.log(share)), _FAR)
        at = self.flat(np.array(places.position))
        pairs = [i for i in range(len(far) - 1) if places.member[i] == places.member[i + 1]]
        heat = LineCollection([at[[i, i + 1]] for i in pairs], cmap=_HEAT, linewidths=7, zorder=3, capstyle="round")
        heat.set_array(np.array([min(far[i], far[i + 1]) for i in pairs], float))
        heat.set_clim(0.0, _FAR)
        axes.add_collection(heat)
        bar = axes.figure.colorbar(heat, ax=axes, shrink=0.6, pad=0.02, aspect=22)
        bar.set_label("misfit compared with the best place [σ]", fontsize=7)
        bar.ax.invert_yaxis()
        bar.outline.set_visible(False)

    def draw_note(self, axes: Axes, position: Vector, text: str) -> None:
        """Mark a place with a text next to it."""
        x, y = self.flat(np.array(position))
        axes.plot(x, y, "o", markersize=10, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.3, zorder=6)
        axes.annotate(
            text, (x, y), (22, -34), textcoords="offset points", fontsize=9, zorder=7, bbox=_PAPER, arrowprops=_LEADER
        )

    def draw_increments(self, axes: Axes, values: FloatArray, scale: float) -> None:
        """Draw one direction's increments (n_nodes,) as a curve along each member, red added, blue removed.

        Parameters
        ----------
        values : at each node [kg], NaN where there is none
        scale : the value [kg] that is drawn largest
        """
        self.draw(axes)
        for nodes in self.geometry.lines.values():
            base = self.flat(self.geometry.nodes[nodes])
            height = values[nodes] / scale * _AMPLITUDE * self.geometry.size
            tip = base + height[:, None] * _across(base)
            stems = [np.array(pair) for pair in zip(base, tip, strict=True) if np.isfinite(pair[1]).all()]
            signs = [v for v in values[nodes] if np.isfinite(v)]
            colours = [ADDED if v >= 0 else REMOVED for v in signs]
            axes.add_collection(LineCollection(stems, colors=colours, linewidths=1.1, alpha=0.75, zorder=3))
            axes.plot(*tip.T, color=INK, linewidth=0.9, zorder=4)

    def draw_flags(self, axes: Axes, increments: MassIncrements, direction: str, values: FloatArray) -> None:
        """Mark the flagged nodes of one direction, and the place of one mass that explains all, if one is claimed."""
        flagged = [f for f in increments.flagged if f.direction == direction and np.isfinite(values[f.node])]
        if not flagged:
            return
        places = self.flat(self.geometry.nodes[[f.node for f in flagged]])
        axes.plot(*places.T, "o", markersize=3, color=WARN, markeredgecolor=INK, markeredgewidth=0.5, zorder=5)
        place = increments.place
        if place is None or not place.located:
            return
        text = f"({', '.join(f'{v:.2f}' for v in place.position)}) ± {place.radius:.2f} m"
        x, y = self.flat(np.array(place.position))
        axes.plot(x, y, "o", markersize=8, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.1, zorder=6)
        axes.annotate(
            text, (x, y), (16, -28), textcoords="offset points", fontsize=7, zorder=7, bbox=_PAPER, arrowprops=_LEADER
        )


def _across(base: FloatArray) -> FloatArray:
    """Return the direction (2,) across a member on paper: upwards, or to the right of an upright one."""
    along = base[-1] - base[0]
    across = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-12)
    return across if across @ (1.0, 1.1) > 0 else -across


def shapes_figure(reference: ReferenceResult) -> Figure | None:
    """Return one picture a mode: at rest, and displaced; None without displacements."""
    modes = [mode for mode in reference.modes if mode.displacement]
    if not modes:
        return None
    frame = Frame(reference)
    moved = [_SWAY * frame.geometry.size * np.array(mode.displacement, float) for mode in modes]
    figure, grid = _grid(frame, len(modes), moved)
    for axes, mode, motion in zip(grid, modes, moved, strict=False):
        _shape(axes, frame, mode.id, motion, f"Mode {mode.id}, {mode.frequency:.4g} Hz")
    return figure


def states_figure(reference: ReferenceResult, states: StateComparison) -> Figure | None:
    """Return one picture a mode: at rest, displaced now, and before (dashed); None without shapes at these nodes."""
    shapes = [one for one in states.shapes if one.now_moved.shape == (len(reference.nodes), 3)]
    if not shapes:
        return None
    frame = Frame(reference)
    sway = _SWAY * frame.geometry.size
    every = [sway * moved for one in shapes for moved in (one.before_moved, one.now_moved)]
    figure, grid = _grid(frame, len(shapes), every)
    for number, (axes, one) in enumerate(zip(grid, shapes, strict=False), 1):
        title = f"{number}: {one.frequency_before:.4g} -> {one.frequency:.4g} Hz"
        _shape(axes, frame, number, sway * one.now_moved, title)
        for strip in frame.geometry.strips(sway * one.before_moved):
            axes.plot(*frame.flat(strip).T, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=2.5)
    return figure


def _grid(frame: Frame, n: int, moved: Sequence[FloatArray]) -> tuple[Figure, list[Axes]]:
    """Return a figure with n pictures in rows, with room for all displaced structures (n_nodes, 3)."""
    nodes, size = frame.geometry.nodes, frame.geometry.size
    points = frame.flat(np.concatenate([nodes, *(nodes + motion for motion in moved)]))
    low, high = points.min(0) - _ROOM * size, points.max(0) + _ROOM * size
    tall = float(np.clip(2.5 * (high - low)[1] / (high - low)[0], 1.2, 3.0))
    rows = math.ceil(n / _COLUMNS)
    figure = new_figure(10.0, (tall + 0.3) * rows)
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in grid:
        bare(axes)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return figure, list(grid)


def _shape(axes: Axes, frame: Frame, number: int, moved: FloatArray, title: str) -> None:
    geometry = frame.geometry
    for rest, strip in zip(geometry.strips(), geometry.strips(moved), strict=True):
        axes.plot(*frame.flat(rest).T, color=FAINT, linewidth=1.5, zorder=1)
        axes.plot(*frame.flat(strip).T, color=mode_colour(number), linewidth=2, solid_capstyle="round", zorder=2)
    feet = frame.flat(geometry.nodes[geometry.held])
    axes.plot(*feet.T, linestyle="none", marker="^", markersize=5, color=SOFT, zorder=2)
    places = np.array([place for place, _ in frame.reference.sensors.values()]).reshape(-1, 3)
    nodes = np.unique(np.argmin(np.linalg.norm(geometry.nodes - places[:, None], axis=2), axis=1))
    axes.plot(*frame.flat(geometry.nodes[nodes] + moved[nodes]).T, "o", markersize=3.5, color=SENSOR, zorder=3)
    axes.set_title(title, fontsize=8.5)

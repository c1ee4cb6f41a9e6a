"""Definitions of the single views."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from daq import FloatArray, Recording
from monitor.results.run_results import RunResults
from monitor.results.windows import MassAnswer, ReferenceResult
from monitor.views.geometry import Geometry, flat_aspect
from monitor.views.palette import BACKGROUND
from monitor.views.viewer import increments as steps
from monitor.views.viewer import posterior as change
from monitor.views.viewer import scene, spectrum
from monitor.views.viewer.modes import bars, shapes
from monitor.views.viewer.modes import mac_matrix as matrix
from monitor.views.viewer.primitives import LEGEND_COLUMNS, LEGEND_STEPS, TIME
from monitor.views.viewer.signals import spectra
from monitor.views.viewer.signals import spectrogram as waterfall
from monitor.views.viewer.signals.traces import SECONDS, signal_path

_MARGINS = (0.09, 0.05)  # of the time axis: before the first window, where a date needs room, and after the last
_ROOM = 0.06  # of a plot's values, above and below them
_FILL = 0.92  # of a picture
_MAX_COLUMNS = 6  # of pictures, so that their labels have room
_SCREEN = 2.1  # width over height of all views together
_PLOT = rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True)


def structure(reference: ReferenceResult, answers: Sequence[MassAnswer], aspect: float) -> rrb.Spatial3DView:
    """Return the view of the structure with the located mass; `aspect` is its width over height on a wide screen."""
    geometry = Geometry(reference)
    points = scene.seen(geometry, answers)
    name = "Structure" if reference.has_model else "Sensors"
    return scene_view(name, "/structure", geometry, geometry.side(*scene.SIDE), points, aspect)


def mode_shapes(reference: ReferenceResult) -> rrb.Vertical:
    """Return the views of all mode shapes, seen from the same place, in the grid that shows them largest."""
    geometry, modes = Geometry(reference), reference.modes
    side, points = geometry.side(*shapes.SIDE), shapes.seen(geometry, reference.modes)
    columns, aspect = best_grid(len(modes), flat_aspect(side, points))
    pictures = [scene_view(f"Mode {m.id}", f"/modes/mode_{m.id}", geometry, side, points, aspect) for m in modes]
    grid = rrb.Grid(*pictures, grid_columns=columns)
    return rrb.Vertical(grid, card("Explanation", "/modes/hint"), row_shares=[8.0, 1.0], name="Mode shapes")


def shape_bars(reference: ReferenceResult) -> rrb.Vertical:
    """Return the view of all mode shapes as bars per channel, where no positions are known."""
    width, height = bars.size(len(reference.modes), len(reference.channels))
    view = rrb.Spatial2DView(
        name="Mode shapes at the channels",
        origin="/shapes",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-bars.NAMES, width], y_range=[-bars.HEAD, height]),
    )
    return rrb.Vertical(view, card("Explanation", "/shapes/hint"), row_shares=[8.0, 1.0], name="Mode shapes")


def best_grid(n: int, aspect: float) -> tuple[int, float]:
    """Return the number of columns, six at most, that shows n pictures largest, and width over height of its cells."""
    cells = {c: (_SCREEN / c, 1 / math.ceil(n / c)) for c in range(1, min(n, _MAX_COLUMNS) + 1)}
    columns = max(cells, key=lambda c: min(cells[c][0] / aspect, cells[c][1]))
    width, height = cells[columns]
    return columns, width / height


def scene_view(
    name: str, origin: str, geometry: Geometry, side: FloatArray, points: FloatArray, aspect: float
) -> rrb.Spatial3DView:
    """Return a view of something in space from a side, near enough to fill it."""
    eye = geometry.eye(side, points, aspect, _FILL)
    return rrb.Spatial3DView(
        name=name,
        origin=origin,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(position=eye.position, look_target=eye.target),
    )


def singular_values() -> rrb.Spatial2DView:
    """Return the view of the spectrum and the poles."""
    return drawing_view("Singular values and stabilisation", "/spectrum", spectrum.BOUNDS)


def posterior() -> rrb.Spatial2DView:
    """Return the view of the posterior along the members."""
    name = "Where: misfit compared with the best place [σ]; the mass that fits there"
    return drawing_view(name, "/posterior", change.BOUNDS)


def increments(reference: ReferenceResult) -> list[rrb.Spatial3DView]:
    """Return one view a direction of the one-step update's increments, seen from where the structure is seen."""
    geometry = Geometry(reference)
    side, points = geometry.side(*scene.SIDE), scene.seen(geometry, [])
    points = np.concatenate([points, geometry.nodes + np.array([0, 0, 1.3 * steps.LABEL * geometry.size])])
    return [
        scene_view(f"One-step, {d}; pale: not significant", f"/increments/{d}", geometry, side, points, 0.8)
        for d in steps.DIRECTIONS
    ]


def increment_curves() -> rrb.Spatial2DView:
    """Return the view of the increments along the members."""
    name = "Mass increment per node: normalised (blue), limits (dark), flagged (red), raw (grey); colours above"
    return drawing_view(name, "/increment_curves", steps.BOUNDS)


def drawing_view(name: str, origin: str, bounds: tuple[tuple[float, float], tuple[float, float]]) -> rrb.Spatial2DView:
    """Return the view of a drawing with axes of its own."""
    return rrb.Spatial2DView(
        name=name,
        origin=origin,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=list(bounds[0]), y_range=list(bounds[1])),
    )


def card(name: str, origin: str) -> rrb.TextDocumentView:
    """Return the view of a text."""
    return rrb.TextDocumentView(name=name, origin=origin)


def signal(channel: str, span: rr.TimeRange, values: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    """Return the view of a channel."""
    scale = f", scale ±{values[1]:.2g}" if values else ""
    return _series(f"{channel} [m/s²]{scale}", signal_path(channel), span, values=values)


def mac(name: str, origin: str) -> rrb.Spatial2DView:
    """Return the view of a matrix of MAC values."""
    return drawing_view(name, origin, matrix.BOUNDS)


def channel_spectra(n_channels: int) -> rrb.Spatial2DView:
    """Return the view of the spectra of the channels."""
    name = "Spectra of the last seconds [dB re (m/s²)²/Hz]; lines: modes of the baseline"
    return drawing_view(name, "/channel_spectra", spectra.spectra_bounds(n_channels))


def spectrogram() -> rrb.Spatial2DView:
    """Return the view of the spectrogram."""
    return drawing_view("Spectrogram: first singular value of each window", "/spectrogram", waterfall.BOUNDS)


def legend(name: str, origin: str, n_names: int) -> tuple[rrb.Spatial2DView, float]:
    """Return the view of names in their colours, in rows, and its height relative to that of one row."""
    rows = math.ceil(n_names / LEGEND_COLUMNS)
    right, down = LEGEND_STEPS
    bounds = ((-0.5 * right, (LEGEND_COLUMNS - 0.5) * right), (-0.3 * down, (rows - 0.1) * down))
    return drawing_view(name, origin, bounds), float(rows)


def plot_view(name: str, origin: str) -> rrb.TimeSeriesView:
    """Return a plot of all that is under an entity, over all of its time."""
    legend = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(name=name, origin=origin, plot_legend=legend, background=_PLOT)


def last_seconds(signals: Recording) -> rr.TimeRange:
    """Return the last ten seconds of signals."""
    return _span(max(signals.start, signals.end - round(SECONDS * 1e9)), signals.end)


def following(seconds: float) -> rr.TimeRange:
    """Return the seconds up to the cursor, which follows a live stream."""
    boundary = rrb.TimeRangeBoundary.cursor_relative
    return rr.TimeRange(start=boundary(seconds=-seconds), end=boundary(seconds=0))


class TrendViews:
    """Views over the whole run, all with the same time axis.

    Parameters
    ----------
    run_results : gives the axis
    follow : seconds up to now that a live view shows; None for all of a run that has ended
    """

    def __init__(self, run_results: RunResults, follow: float | None = None) -> None:
        self._live = follow is not None
        if follow is not None:
            self._span = following(follow)
            return
        length = run_results.end - run_results.start
        before, after = (round(share * length) for share in _MARGINS)
        self._span = _span(run_results.start - before, run_results.end + after)

    def series(self, name: str, origin: str, *, values: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
        """Return a plot of all that is under an entity, from the lowest to the highest of `values` if given."""
        return _series(name, origin, self._span, values=None if self._live else values)

    def small(self, name: str, origin: str, values: tuple[float, float]) -> rrb.TimeSeriesView:
        """Return a plot that is too low for more than one tick: its name states the range."""
        low, high = values
        return self.series(name if self._live else f"{name}, {low:.4g} to {high:.4g}", origin, values=values)

    def lanes(self) -> rrb.StateTimelineView:
        """Return the lanes of states."""
        return rrb.StateTimelineView(
            name="State",
            origin="/state",
            time_view=rrb.TimeAxis(view_range=self._span),
            time_ranges=rrb.VisibleTimeRange(TIME, range=self._span),
        )


@dataclass(frozen=True, kw_only=True)
class BlockPlot:
    """Plot of figures that come block by block."""

    seconds: float  #: time shown [s]
    limit: float  #: value from which a figure is significant


def residuals(plot: BlockPlot) -> rrb.TimeSeriesView:
    """Return the plot of the last residuals of channels against their prediction from the others."""
    name = f"Residual of each channel by the others [σ]; red: limit, {plot.limit:g}"
    return _series(name, "/channels/residuals", following(plot.seconds))


def innovations(plot: BlockPlot) -> rrb.TimeSeriesView:
    """Return the plot of the last innovations about the modes."""
    name = f"Innovations about each mode [σ]; red: limit, {plot.limit:g}"
    return _series(name, "/channels/innovations", following(plot.seconds))


def _span(start: int, end: int) -> rr.TimeRange:
    boundary = rrb.TimeRangeBoundary.absolute
    return rr.TimeRange(start=boundary(nanos=start), end=boundary(nanos=end))


def _series(
    name: str, origin: str, span: rr.TimeRange, *, values: tuple[float, float] | None = None
) -> rrb.TimeSeriesView:
    low, high = values or (0.0, 0.0)
    room = _ROOM * (high - low)
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=rrb.TimeAxis(view_range=span),
        axis_y=rrb.ScalarAxis(range=(low - room, high + room)) if high > low else None,
        time_ranges=rrb.VisibleTimeRange(TIME, range=span),
        plot_legend=rrb.PlotLegend(visible=False),
        background=_PLOT,
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
    )

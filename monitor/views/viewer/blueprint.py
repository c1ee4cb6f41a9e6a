"""The single views: what each shows and from where."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from daq import FloatArray, Recording
from monitor.results.story import Story
from monitor.results.windows import MassAnswer, ReferenceResult
from monitor.views.geometry import Geometry, flat_aspect
from monitor.views.member_axis import has_profile
from monitor.views.palette import BACKGROUND
from monitor.views.viewer import blueprint as views
from monitor.views.viewer import increments as steps
from monitor.views.viewer import mode_shapes as shapes
from monitor.views.viewer import posterior as change
from monitor.views.viewer import scene, spectrum
from monitor.views.viewer.posterior import mass_span
from monitor.views.viewer.primitives import TIME
from monitor.views.viewer.signals import SECONDS, signal_path
from monitor.views.viewer.trends import frequency_span, shift_span

_LEGEND_ROOM = 0.2  # of the time axis, left free of data for the legend
_MARGIN = 0.01  # of the time axis, after the last window
_ROOM = 0.06  # of a plot's values, above and below them
_FILL = 0.92  # of a picture
_SCREEN = 1.9  # width over height of all views together
_PLOT = rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True)


def structure(reference: ReferenceResult, answers: Sequence[MassAnswer], aspect: float) -> rrb.Spatial3DView:
    """Return the view of the structure with the located mass; `aspect` is its width over height on a wide screen."""
    geometry = Geometry(reference)
    points = scene.seen(geometry, answers)
    return scene_view("Structure", "/structure", geometry, geometry.side(*scene.SIDE), points, aspect)


def mode_shapes(reference: ReferenceResult) -> rrb.Grid:
    """Return the views of all mode shapes, seen from the same place, in the grid that shows them largest."""
    geometry, modes = Geometry(reference), reference.modes
    side, points = geometry.side(*shapes.SIDE), shapes.seen(geometry, reference.modes)
    columns, aspect = best_grid(len(modes), flat_aspect(side, points))
    pictures = [
        scene_view(
            f"Mode {m.id}, MAC {m.mac:.4f} with the model", f"/modes/mode_{m.id}", geometry, side, points, aspect
        )
        for m in modes
    ]
    return rrb.Grid(*pictures, grid_columns=columns, name="Mode shapes")


def best_grid(n: int, aspect: float) -> tuple[int, float]:
    """Return the number of columns that shows n pictures largest, and the aspect (width over height) of its cells."""
    cells = {c: (_SCREEN / c, 1 / math.ceil(n / c)) for c in range(1, n + 1)}
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
        scene_view(f"One-step update, {d}: added mass (normalised)", f"/increments/{d}", geometry, side, points, 0.8)
        for d in steps.DIRECTIONS
    ]


def increment_curves() -> rrb.Spatial2DView:
    """Return the view of the increments along the members."""
    name = "One-step update: normalised (blue) and raw (grey) increments a node, limits, flagged nodes"
    return drawing_view(name, "/increment_curves", steps.BOUNDS)


def drawing_view(name: str, origin: str, bounds: tuple[tuple[float, float], tuple[float, float]]) -> rrb.Spatial2DView:
    """Return the view of a drawing with axes of its own."""
    return rrb.Spatial2DView(
        name=name,
        origin=origin,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=list(bounds[0]), y_range=list(bounds[1])),
    )


def events() -> rrb.TextLogView:
    """Return the list of events; their time stands in the text."""
    hidden = TimelineColumn(TIME, visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["loglevel", "body"])
    return rrb.TextLogView(name="Events", origin="/events", columns=columns)


def card(name: str, origin: str) -> rrb.TextDocumentView:
    """Return the view of a text."""
    return rrb.TextDocumentView(name=name, origin=origin)


def signal(channel: str, span: rr.TimeRange) -> rrb.TimeSeriesView:
    """Return the view of a channel."""
    return _series(f"{channel} [m/s²]", signal_path(channel), span)


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


class Trends:
    """Views over the whole run, all with the same time axis.

    Parameters
    ----------
    story : gives the axis, with room for a legend where no mode is watched yet
    follow : seconds up to now that a live view shows; None for all of a run that has ended
    """

    def __init__(self, story: Story, follow: float | None = None) -> None:
        self._live = follow is not None
        if follow is not None:
            self._span = following(follow)
            return
        length = story.end - story.start
        watched = story.watched[0].start if story.watched else story.end
        room = max(0.0, _LEGEND_ROOM * length - (watched - story.start))
        self._span = _span(story.start - round(room), story.end + round(_MARGIN * length))

    def series(
        self, name: str, origin: str, *, values: tuple[float, float] | None = None, legend: bool = False
    ) -> rrb.TimeSeriesView:
        """Return a plot of all that is under an entity, from the lowest to the highest of `values` if given."""
        return _series(name, origin, self._span, values=None if self._live else values, legend=legend)

    def lanes(self) -> rrb.StateTimelineView:
        """Return the lanes of states."""
        return rrb.StateTimelineView(
            name="State",
            origin="/state",
            time_view=rrb.TimeAxis(view_range=self._span),
            time_ranges=rrb.VisibleTimeRange(TIME, range=self._span),
        )


def _span(start: int, end: int) -> rr.TimeRange:
    boundary = rrb.TimeRangeBoundary.absolute
    return rr.TimeRange(start=boundary(nanos=start), end=boundary(nanos=end))


def _series(
    name: str, origin: str, span: rr.TimeRange, *, values: tuple[float, float] | None = None, legend: bool = False
) -> rrb.TimeSeriesView:
    low, high = values or (0.0, 0.0)
    room = _ROOM * (high - low)
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=rrb.TimeAxis(view_range=span),
        axis_y=rrb.ScalarAxis(range=(low - room, high + room)) if high > low else None,
        time_ranges=rrb.VisibleTimeRange(TIME, range=span),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftBottom) if legend else rrb.PlotLegend(visible=False),
        background=_PLOT,
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
    )


_Part = rrb.View | rrb.Container
_PLOTS_A_COLUMN = 6


@dataclass(frozen=True, kw_only=True)
class Live:
    """Settings for following a running monitor."""

    seconds: float  #: of the past that the trends show [s]
    channels: tuple[str, ...]  #: whose signals are streamed


def layout(story: Story, live: Live | None = None) -> rrb.Blueprint:
    """Return the blueprint: the overview in front, then one tab a subject.

    Parameters
    ----------
    story : what there is to show
    live : how a running monitor is followed; None for a run that has ended
    """
    trends = views.Trends(story, live.seconds if live else None)
    tabs: list[rrb.Container] = [_overview(story, trends)]
    if story.reference:
        tabs.append(views.mode_shapes(story.reference))
    if story.spectra or story.reference:
        tabs.append(_identification(story, trends))
    if story.answers or _has_increments(story) or _has_diagnosis(story):
        tabs.append(_change(story, trends))
    if live:
        tabs.append(_signals(live.channels, views.following(SECONDS)))
    elif story.signals:
        tabs.append(_signals([c.name for c in story.signals.channels], views.last_seconds(story.signals)))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TopPanel(state="expanded"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _stack(*parts: tuple[_Part, float]) -> rrb.Vertical:
    return rrb.Vertical(*[part for part, _ in parts], row_shares=[share for _, share in parts])


def _beside(name: str, *parts: tuple[_Part, float]) -> rrb.Horizontal:
    return rrb.Horizontal(*[part for part, _ in parts], column_shares=[share for _, share in parts], name=name)


def _overview(story: Story, trends: views.Trends) -> rrb.Horizontal:
    left = _structure(story, 4.4, aspect=1.25)
    left.append((views.card("Now", "/now"), 5.0))
    right: list[tuple[_Part, float]] = [(views.singular_values(), 4.2)] if story.spectra else []
    right.append((views.events(), 4.0))
    return _beside("Overview", (_stack(*left), 3.3), (_trends(story, trends), 4.0), (_stack(*right), 4.2))


def _structure(story: Story, share: float, *, aspect: float) -> list[tuple[_Part, float]]:
    """Return the view of the structure with its share of the room; none without a reference."""
    if story.reference is None:
        return []
    return [(views.structure(story.reference, [answer for _, answer in story.answers], aspect), share)]


def _trends(story: Story, trends: views.Trends) -> rrb.Vertical:
    parts: list[tuple[_Part, float]] = []
    if any(m.shift_percent is not None for w in story.watched for m in w.modes):
        parts.append(
            (
                trends.series(
                    "Frequency shift from the baseline [%]", "/trend/shift", values=shift_span(story), legend=True
                ),
                4.0,
            )
        )
    elif any(w.modes for w in story.learning):
        parts.append((trends.series("Frequencies found while learning [Hz]", "/trend/found"), 4.0))
    if any(w.novelty for w in story.watched):
        parts.append((trends.series("Novelty, log10(T² / limit): over 0 is out", "/novelty"), 2.4))
    return _stack(*parts, (trends.lanes(), 1.7))


def _identification(story: Story, trends: views.Trends) -> rrb.Horizontal:
    left: list[tuple[_Part, float]] = [(views.singular_values(), 5.0)] if story.spectra else []
    if story.reference:
        modes, model = (
            views.card("Baseline and model", "/reference/modes"),
            views.card("Calibration", "/reference/model"),
        )
        left.append((_beside("Reference", (modes, 5.0), (model, 4.0)), 3.7))
    return _beside("Identification", (_stack(*left), 5.0), (_frequencies(story, trends), 4.0))


def _frequencies(story: Story, trends: views.Trends) -> rrb.Grid:
    """One small plot a mode, each with an axis of its own, so that a shift far smaller than the whole band is seen."""
    plots = [
        trends.series(f"Mode {n} [Hz], ± 2σ", f"/trend/frequency/mode_{n}", values=frequency_span(story, n))
        for n in story.tracks
    ]
    if not plots:
        plots = [trends.series("Frequencies found while learning [Hz]", "/trend/found")]
    return _grid(plots, name="Natural frequencies")


def _has_increments(story: Story) -> bool:
    return story.reference is not None and any(w.increments for w in story.windows)


def _has_diagnosis(story: Story) -> bool:
    return any(w.diagnosis for w in story.windows)


def _change(story: Story, trends: views.Trends) -> rrb.Container:
    """Return the likelihood's pictures; beside them the one-step update's, and the diagnosis, where there are any."""
    evidence = _posterior(story, trends)
    if not _has_increments(story) or story.reference is None:
        card = [(views.card("Diagnosis", "/diagnosis"), 2.4)] if _has_diagnosis(story) else []
        return _beside("Change", *_structure(story, 3.0, aspect=0.82), *evidence, *card)
    scenes = [(view, 2.0) for view in views.increments(story.reference)]
    above = _beside("Where", *_structure(story, 2.6, aspect=1.0), *scenes)
    card = [(views.card("Diagnosis", "/diagnosis"), 2.6)] if _has_diagnosis(story) else []
    below = _beside("Evidence", *evidence, (views.increment_curves(), 4.0), *card)
    return rrb.Vertical(above, below, row_shares=[1.0, 1.05], name="Change")


def _posterior(story: Story, trends: views.Trends) -> list[tuple[_Part, float]]:
    """Return the profile of the likelihood with the answer's sharpening under it; nothing without an answer."""
    if not story.answers:
        return []
    mass = trends.series(f"Mass, ± 2σ [{story.mass_unit[1]}]", "/answer/mass", values=mass_span(story))
    place = trends.series("Place, standard deviation [mm]", "/answer/place")
    parts: list[tuple[_Part, float]] = [(_beside("Sharpening", (mass, 1.0), (place, 1.0)), 3.4)]
    if any(has_profile(answer) for _, answer in story.answers):
        parts.insert(0, (views.posterior(), 5.6))
    return [(_stack(*parts), 4.2)]


def _signals(channels: Sequence[str], span: rr.TimeRange) -> rrb.Grid:
    return _grid([views.signal(channel, span) for channel in channels], name="Signals")


def _grid(plots: Sequence[rrb.View], name: str) -> rrb.Grid:
    return rrb.Grid(*plots, grid_columns=math.ceil(len(plots) / _PLOTS_A_COLUMN), name=name)

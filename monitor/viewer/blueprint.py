"""How the views are laid out."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from monitor.results import ReferenceResult
from monitor.viewer.palette import BACKGROUND
from monitor.viewer.plots import HEIGHT, WIDTH
from monitor.viewer.scene import Geometry


class Layout:
    """The views of one recording.

    Parameters
    ----------
    reference : None if the baseline was never learnt; views that need it are left out
    seconds : length of the recording
    answered : whether a change was located
    """

    def __init__(self, reference: ReferenceResult | None, seconds: float, *, answered: bool) -> None:
        self._reference, self._seconds, self._answered = reference, seconds, answered
        self._geometry = Geometry(reference) if reference else None

    def blueprint(self) -> rrb.Blueprint:
        """Return the whole layout."""
        tabs: list[rrb.Container] = [self._overview()]
        if self._reference:
            tabs += [self._mode_shapes(self._reference), self._identification()]
        if self._answered:
            tabs.append(self._change())
        return rrb.Blueprint(
            rrb.Tabs(*tabs, active_tab=0),
            rrb.TopPanel(state="expanded"),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
            auto_layout=False,
            auto_views=False,
        )

    def _overview(self) -> rrb.Horizontal:
        card = rrb.TextDocumentView(name="Now", origin="/now")
        left: list[rrb.View] = [self._structure(), card] if self._reference else [card]
        return rrb.Horizontal(
            rrb.Vertical(*left, row_shares=[5.0, 4.6][: len(left)]),
            rrb.Vertical(
                self._series("Frequency shift from the baseline [%]", "/trend/shift", legend=True),
                self._series("Novelty, log10(T² / limit): over 0 is out", "/novelty"),
                rrb.StateTimelineView(name="State", origin="/state", time_view=self._axis()),
                row_shares=[4.0, 2.4, 2.2],
            ),
            rrb.Vertical(self._spectrum(), self._events(), row_shares=[4.0, 3.0]),
            column_shares=[3.2, 4.0, 4.2],
            name="Overview",
        )

    def _mode_shapes(self, reference: ReferenceResult) -> rrb.Grid:
        views = [self._scene(f"Mode {m.id}", f"/modes/mode_{m.id}", close=0.85) for m in reference.modes]
        return rrb.Grid(*views, grid_columns=4 if len(views) > 6 else 3, name="Mode shapes")

    def _identification(self) -> rrb.Horizontal:
        return rrb.Horizontal(
            rrb.Vertical(
                self._spectrum(),
                self._series("Natural frequencies [Hz]", "/trend/frequency", legend=True),
                row_shares=[5, 3],
            ),
            rrb.TextDocumentView(name="Reference", origin="/reference"),
            column_shares=[5, 3],
            name="Identification",
        )

    def _change(self) -> rrb.Horizontal:
        plot = rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True)
        posterior = rrb.BarChartView(
            name="Posterior of the place [1/m], member after member, over distance from each start [m]",
            origin="/answer/posterior",
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
            background=plot,
        )
        return rrb.Horizontal(
            self._structure(),
            rrb.Vertical(
                posterior,
                self._series("Mass, with two standard deviations [g]", "/answer/mass", legend=True),
                self._series("Standard deviation of the place [mm]", "/answer/place"),
            ),
            name="Change",
        )

    def _structure(self) -> rrb.Spatial3DView:
        return self._scene("Structure", "/structure", close=0.72)

    def _scene(self, name: str, origin: str, *, close: float) -> rrb.Spatial3DView:
        if self._geometry is None:
            return rrb.Spatial3DView(name=name, origin=origin)
        view = np.array([0.75, -1.0, 0.42]) * 1.35 * close * self._geometry.size
        return rrb.Spatial3DView(
            name=name,
            origin=origin,
            background=BACKGROUND,
            line_grid=rrb.LineGrid3D(visible=False),
            eye_controls=rrb.EyeControls3D(position=self._geometry.centre + view, look_target=self._geometry.centre),
        )

    def _spectrum(self) -> rrb.Spatial2DView:
        bounds = rrb.VisualBounds2D(x_range=[-22, WIDTH + 8], y_range=[-16, HEIGHT + 12])
        return rrb.Spatial2DView(
            name="Singular values and stabilisation", origin="/spectrum", background=BACKGROUND, visual_bounds=bounds
        )

    def _events(self) -> rrb.TextLogView:
        columns = rrb.TextLogColumns(
            timeline_columns=[TimelineColumn("time", visible=False)], text_log_columns=["loglevel", "body"]
        )
        return rrb.TextLogView(name="Events", origin="/events", columns=columns)

    def _axis(self) -> rrb.TimeAxis:
        start = rrb.TimeRangeBoundary.cursor_relative(seconds=-self._seconds)
        return rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=start, end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.01 * self._seconds)
            )
        )

    def _series(self, name: str, origin: str, *, legend: bool = False) -> rrb.TimeSeriesView:
        start = rrb.TimeRangeBoundary.cursor_relative(seconds=-self._seconds)
        return rrb.TimeSeriesView(
            name=name,
            origin=origin,
            axis_x=self._axis(),
            time_ranges=rrb.VisibleTimeRange("time", start=start, end=rrb.TimeRangeBoundary.cursor_relative()),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftBottom) if legend else rrb.PlotLegend(visible=False),
            background=rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True),
            interaction=rrb.PlotInteraction(tooltip_mode="All"),
        )

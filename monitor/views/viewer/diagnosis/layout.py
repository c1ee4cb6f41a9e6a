"""Layout of the views of a diagnosis."""

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb

from daq import FloatArray
from monitor.results.comparison import BalanceResult, DiagnosisAnswer, DiscrepancyResult
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import ReferenceResult
from monitor.views.geometry import Geometry
from monitor.views.viewer import scene
from monitor.views.viewer.diagnosis.bars import NamedBars
from monitor.views.viewer.diagnosis.evidence import evidence_bounds
from monitor.views.viewer.diagnosis.shapes import shapes_bounds
from monitor.views.viewer.layout import view_specs as views
from monitor.views.viewer.signals.spectra import spectra_bounds

SECONDS_TIMELINE = "seconds"
_ASPECT = 0.8  # of the structure's view, width over height


def diagnosis_layout(
    diagnosis: DiagnosisAnswer, found: DiscrepancyResult, reference: ReferenceResult, states: StateComparison | None
) -> rrb.Blueprint:
    """Return the blueprint: where and why in front, then modes, sensors, shapes and spectra."""
    tabs: list[rrb.View | rrb.Container] = [_where(diagnosis, found, reference), _modes(found)]
    if found.sensors:
        tabs.append(_sensors(found))
    if states and states.shapes:
        tabs.append(_shapes(states))
    if states and states.signals:
        tabs.append(_spectra(states))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TopPanel(state="expanded"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=SECONDS_TIMELINE),
        auto_layout=False,
        auto_views=False,
    )


def _where(diagnosis: DiagnosisAnswer, found: DiscrepancyResult, reference: ReferenceResult) -> rrb.Horizontal:
    geometry = Geometry(reference)
    right = np.array([0.0, 0.0, 0.2 * geometry.size])
    places = [c.where.position for c in diagnosis.causes if c.where and c.where.position]
    spots = np.array(places, float).reshape(-1, 3) + right
    points = np.concatenate([scene.seen(geometry, []), spots])
    view = views.scene_view(
        reading_name(found.balance), "/structure", geometry, geometry.side(*scene.SIDE), points, _ASPECT
    )
    name = "Log evidence against the best explanation; logarithmic beyond -5"
    evidence = views.drawing_view(name, "/evidence", evidence_bounds(diagnosis))
    parts = [views.card("Diagnosis", "/diagnosis"), *([evidence] if diagnosis.rejected or diagnosis.causes else [])]
    beside = rrb.Vertical(*parts)
    return rrb.Horizontal(view, beside, column_shares=[1.0, 1.0], name="Diagnosis")


def reading_name(balance: BalanceResult | None) -> str:
    """Return the meaning of the members' colours."""
    if balance is None:
        return "Structure"
    values, name = (balance.added, "excess mass") if balance.log_odds > 0 else (balance.loss, "missing stiffness")
    largest = max((abs(v) for v in values if v is not None), default=0.0)
    return f"Residual forces as {name}: red, up to {100 * largest:.1f} %; blue: the opposite"


def _modes(found: DiscrepancyResult) -> rrb.Horizontal:
    first, second = ("before", "now") if found.measured_before else ("model", "measured")
    what = "Frequencies now against before" if found.measured_before else "Measured frequencies against the model"
    name = f"{what} [%], red without, green with the causes; white: standard deviation"
    offsets = views.drawing_view(name, "/offsets", offset_bars(found).bounds)
    mac = views.mac(f"MAC: {first} (down) with {second} (across) [Hz]", "/mac")
    left = rrb.Vertical(views.card(f"{len(found.modes)} modes", "/modes"), offsets, row_shares=[1.0, 1.2])
    return rrb.Horizontal(left, mac, column_shares=[1.0, 1.15], name="Modes")


def _sensors(found: DiscrepancyResult) -> rrb.Horizontal:
    residual = _bars("Distance of sensors from the shapes [%]", "noise", "/sensors/residual", residual_bars(found))
    missed = missed_bars(found)
    if missed:
        error = _bars("Prediction error from the other sensors [%]", "least error", "/sensors/missed", missed)
        residual = rrb.Vertical(residual, error)
    signals = [
        views.plot_view(f"{signal.channel} [m/s²]: measured (white), predicted from the others (blue)",
                        f"/signals/{signal.channel}")
        for signal in found.signals
    ]  # fmt: skip
    parts = [residual, rrb.Vertical(*signals)] if signals else [residual]
    return rrb.Horizontal(*parts, name="Sensors")


def _bars(name: str, white: str, origin: str, rows: NamedBars) -> rrb.View | rrb.Container:
    return views.drawing_view(f"{name}: red without, green with the causes; white: {white}", origin, rows.bounds)


def _shapes(states: StateComparison) -> rrb.Horizontal:
    before = "before" if states.measured_before else "model"
    name = f"Shapes: {before} (grey bars), now (blue points), with the causes (green marks)"
    return rrb.Horizontal(views.drawing_view(name, "/state_shapes", shapes_bounds(states)), name="Shapes")


def _spectra(states: StateComparison) -> rrb.Horizontal:
    assert states.signals is not None
    before = "before (grey) and now (blue)" if states.signals_before else "now"
    name = f"Spectra {before} [dB re (m/s²)²/Hz]; lines: modes before (grey) and now (blue)"
    view = views.drawing_view(name, "/state_spectra", spectra_bounds(len(states.signals.channels)))
    return rrb.Horizontal(view, name="Spectra")


def offset_bars(found: DiscrepancyResult) -> NamedBars:
    """Return the frequency of each pair, measured against simulated [%]."""
    pairs = [mode for mode in found.modes if mode.off_percent is not None]
    return NamedBars(
        names=tuple(f"{mode.measured:#.4g} Hz" for mode in pairs),
        without=_column([mode.off_percent for mode in pairs]),
        with_causes=_column([mode.off_percent_after for mode in pairs]),
        noise=_column([mode.std_percent for mode in pairs]),
        form="+.3f",
    )


def residual_bars(found: DiscrepancyResult) -> NamedBars:
    """Return the residual of the shapes at each sensor [%]."""
    return NamedBars(
        names=tuple(sensor.channel for sensor in found.sensors),
        without=100 * _column([sensor.residual for sensor in found.sensors]),
        with_causes=100 * _column([sensor.residual_after for sensor in found.sensors]),
        noise=100 * _column([sensor.noise for sensor in found.sensors]),
        form=".1f",
    )


def missed_bars(found: DiscrepancyResult) -> NamedBars | None:
    """Return the error of each signal predicted from the other sensors [%]; None if none was predicted."""
    sensors = [sensor for sensor in found.sensors if sensor.missed is not None]
    if not sensors:
        return None
    return NamedBars(
        names=tuple(sensor.channel for sensor in sensors),
        without=100 * _column([sensor.missed for sensor in sensors]),
        with_causes=100 * _column([sensor.missed_after for sensor in sensors]),
        noise=100 * _column([sensor.missed_least for sensor in sensors]),
        form=".1f",
    )


def _column(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values], float)

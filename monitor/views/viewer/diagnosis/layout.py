"""Layout of the views of a diagnosis."""

import numpy as np
import rerun.blueprint as rrb

from monitor.results.comparison import BalanceResult, DiagnosisAnswer, DiscrepancyResult
from monitor.results.windows import ReferenceResult
from monitor.views.geometry import Geometry
from monitor.views.viewer import scene
from monitor.views.viewer.diagnosis.evidence import evidence_bounds
from monitor.views.viewer.layout import view_specs as views

SECONDS_TIMELINE = "seconds"
_ASPECT = 0.8  # of the structure's view, width over height


def diagnosis_layout(diagnosis: DiagnosisAnswer, found: DiscrepancyResult, reference: ReferenceResult) -> rrb.Blueprint:
    """Return the blueprint: where and why in front, then modes, then sensors."""
    tabs = [_where(diagnosis, found, reference), _modes(found)]
    if found.sensors:
        tabs.append(_sensors(found))
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
    offsets = views.image_view("Measured off the model [%], red without, green with the causes", "/offsets")
    mac = views.mac("MAC: simulated (down) with measured (across) modes [Hz]", "/mac")
    left = rrb.Vertical(views.card(f"{len(found.modes)} modes", "/modes"), offsets, row_shares=[1.0, 1.2])
    return rrb.Horizontal(left, mac, column_shares=[1.0, 1.15], name="Modes")


def _sensors(found: DiscrepancyResult) -> rrb.Horizontal:
    residual = views.image_view("Sensors, red without, green with the causes; bar: noise", "/sensors")
    signals = [
        views.plot_view(f"{signal.channel} [m/s²]: measured (white), predicted from the others (blue)",
                        f"/signals/{signal.channel}")
        for signal in found.signals
    ]  # fmt: skip
    parts = [residual, rrb.Vertical(*signals)] if signals else [residual]
    return rrb.Horizontal(*parts, name="Sensors")

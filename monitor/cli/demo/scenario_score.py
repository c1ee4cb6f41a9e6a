"""Comparison of the last diagnosis with the events of a shipped scenario."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from monitor.results.windows import AlarmResult, Result, WindowResult
from monitor.rig import RigEvent
from monitor.rig.scenario import RigCrack, Vector
from monitor.text.causes import breathing_text, cause_text
from updater import Cause, Structure
from updater.quantities import Breathing

PLACE = 0.10  #: m: tolerance of a correct place ..
SIGMAS = 3.0  #: .. or so many of its own deviations
MASS = 0.15  #: tolerance of a correct mass, relative, or so many deviations; a share has its deviations alone

_LOSSES = {"local_stiffness", "support_stiffness", "joint_stiffness"}  # causes that a crack, or play, may be


@dataclass(frozen=True)
class ScoredEvent:
    """An event of a rig, and the cause that the monitor names for it."""

    what: str
    truth: str
    answer: str
    off: str
    right: bool


def score_events(structure: Structure, events: Sequence[RigEvent], found: Sequence[Result]) -> list[ScoredEvent]:
    """Compare the causes of the last diagnosis with events; each cause belongs to one event.

    Parameters
    ----------
    structure : of the rig
    events : of the scenario; none: the monitor must not raise an alarm
    found : results of the monitor
    """
    diagnoses = [r.diagnosis for r in found if isinstance(r, WindowResult) and r.diagnosis]
    left = list(diagnoses[-1].causes) if diagnoses else []
    scored = []
    for event in events:
        at = _place(structure, event)
        names = {"added_mass"} if event.body else _LOSSES
        near = sorted((c for c in left if c.cause in names), key=lambda c: distance(c, at))
        cause = near[0] if near else None
        if cause:
            left.remove(cause)
        scored.append(_scored(event, at, cause))
    alarms = [r for r in found if isinstance(r, AlarmResult) and r.state == "alarm"]
    if not events:
        scored.append(ScoredEvent("nothing", "no alarm", "alarm" if alarms else "no alarm", "", not alarms))
    scored += [ScoredEvent("nothing", "", cause_text(cause), "", right=False) for cause in left]
    return scored


def scenario_table(scored: Sequence[ScoredEvent]) -> Table:
    """Return truth and answer of each event."""
    table = Table("", "truth", "the monitor's answer", "off by", title="Truth of the rig, and answer of the monitor")
    for event in scored:
        table.add_row(*map(escape, (event.what, event.truth, event.answer, event.off)))
    return table


def scenario_summary(scored: Sequence[ScoredEvent]) -> list[dict[str, Any]]:
    """Return the same as values of JSON."""
    return [asdict(event) for event in scored]


def _place(structure: Structure, event: RigEvent) -> Vector:
    if event.body:
        return event.body.at
    assert event.crack
    (member,) = (m for m in structure.member if m.name == event.crack.member)
    x, y, z = member.point(event.crack.distance).tolist()
    return x, y, z


def distance(cause: Cause, at: Vector) -> float:
    """Return the distance of a cause from a place [m]."""
    position = cause.where.position if cause.where else None
    return float(np.linalg.norm(np.subtract(position, at))) if position else np.inf


def is_near(cause: Cause, at: Vector) -> bool:
    """Return whether a cause is at a place, within the tolerance or its own deviations."""
    std = (cause.where.position_std if cause.where else None) or 0.0
    return distance(cause, at) <= max(PLACE, SIGMAS * std)


def _scored(event: RigEvent, at: Vector, cause: Cause | None) -> ScoredEvent:
    what, (truth, size, sized) = ("body added", _body(event, cause)) if event.body else ("crack", _crack(event, cause))
    truth = f"{truth} at ({', '.join(f'{x:.3g}' for x in at)}) m"
    if cause is None:
        return ScoredEvent(what, truth, "not named", "", right=False)
    away = distance(cause, at)
    right = sized and is_near(cause, at)
    answer = "; ".join(filter(None, (cause_text(cause), breathing_text(cause))))
    return ScoredEvent(what, truth, answer, f"{1000 * away:.0f} mm; {size}", right)


def _body(event: RigEvent, cause: Cause | None) -> tuple[str, str, bool]:
    """Return the true mass, the error of the answer, and whether it is within its deviations."""
    assert event.body
    truth = f"{1000 * event.body.mass:.0f} g"
    if cause is None:
        return truth, "", False
    mass = cause.parameters["mass"]
    off = mass.value - event.body.mass
    return truth, f"{1000 * off:+.0f} g", abs(off) <= max(MASS * event.body.mass, SIGMAS * mass.std)


def _crack(event: RigEvent, cause: Cause | None) -> tuple[str, str, bool]:
    """Return the true flexibilities, the error of the answer, and whether it is stated and within its deviations.

    Of a crack that is open half of the time, the true share that is absent while it is closed is known. Otherwise, the
    flexibilities and the moment are compared, which do not depend on the time.
    """
    assert event.crack
    found, crack = cause.breathing if cause else None, event.crack
    if crack.opens in ("within", "beyond", "slips") or crack.moment != 0:
        return _opening(crack, found)
    share = (crack.flexibility - crack.closed) / (crack.flexibility + crack.closed)
    truth = f"{100 * share:.0f} % of the flexibility absent while closed, open half of the time,"
    if found is None:
        return truth, "not tested", False
    off = found.share.value - share
    right = found.significant and abs(off) <= SIGMAS * found.share.std
    return truth, f"{100 * off:+.0f} %", right


def _opening(crack: RigCrack, found: Breathing | None) -> tuple[str, str, bool]:
    """Return the true flexibilities and moment, the errors of the answer, and whether they are within deviations."""
    opens = "slips beyond" if crack.opens == "slips" else f"open {crack.opens}"
    truth = (
        f"{1000 * crack.flexibility:.3g} mm while open, {1000 * crack.closed:.3g} mm while closed, "
        f"{opens} a moment of {crack.moment:.3g} N m,"
    )
    opening = found.opening if found else None
    if opening is None:
        return truth, "opening not stated" if found else "not tested", False
    stated = {name: getattr(opening, name) for name in ("flexibility", "closed", "moment")}
    off = {name: quantity.value - getattr(crack, name) for name, quantity in stated.items()}
    error = f"{1000 * off['flexibility']:+.2g} mm open, {1000 * off['closed']:+.2g} mm closed, {off['moment']:+.2g} N m"
    inside = all(abs(off[name]) <= SIGMAS * quantity.std for name, quantity in stated.items())
    return truth, error, inside and opening.opens == crack.opens

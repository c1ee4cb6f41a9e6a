"""Comparison of the last diagnosis with the events of a shipped scenario."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from monitor.results.windows import AlarmResult, Result, WindowResult
from monitor.rig import RigEvent
from monitor.rig.scenario import Vector
from monitor.text.causes import breathing_text, cause_text
from updater import Cause, Structure

PLACE = 0.10  #: m: tolerance of a correct place ..
SIGMAS = 3.0  #: .. or so many of its own deviations
MASS = 0.15  #: tolerance of a correct mass, relative, or so many deviations; a share has its deviations alone


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
        name = "added_mass" if event.body else "local_stiffness"
        near = sorted((c for c in left if c.cause == name), key=lambda c: distance(c, at))
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
    """Return the true share that is absent while it is closed, the error of the answer, and whether it is stated."""
    assert event.crack
    found = cause.breathing if cause else None
    half = event.crack.opens in ("above", "below") and event.crack.moment == 0
    open_time = 0.5 if half or found is None or found.open_time is None else found.open_time.value
    mean = open_time * event.crack.flexibility + (1 - open_time) * event.crack.closed
    share = open_time * (event.crack.flexibility - event.crack.closed) / mean
    when = "half of the time" if half else f"{event.crack.opens} a moment of {event.crack.moment:.3g} N m"
    truth = f"{100 * share:.0f} % of the flexibility absent while closed, open {when},"
    if found is None:
        return truth, "not tested", False
    off = found.share.value - share
    right = found.significant and abs(off) <= SIGMAS * found.share.std
    return truth, f"{100 * off:+.0f} %", right

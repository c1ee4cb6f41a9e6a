"""Diagnosis of a record within which the structure changed: of the state at its end, and of the change itself."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from monitor.analysis.explanation import Explanation
from monitor.analysis.observation import Observation
from monitor.analysis.states.present_state import without_drift
from monitor.analysis.states.stationarity import in_order_of_time
from monitor.errors import StateError
from monitor.results.comparison import ChangeRate, CoursePoint, WithinRecord
from oma import ModalEstimate
from updater import Cause, Structure
from updater.modal_data import Course, find_course
from updater.quantities import SIGNIFICANT

_SURROUNDINGS = frozenset({"temperature", "global_stiffness", "amplitude_softening", "sampling_clock"})
_AMOUNTS = frozenset({"mass", "loss", "force"})  # parameters that are zero without their cause
_BODY = "added_mass"
_HOUR = 3600.0

#: of a structure's states before and now
Explain = Callable[[Structure, Observation | None, Observation, Observation | None], Explanation]


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordStates:
    """States at the beginning and at the end of a record, or before and after a step."""

    course: Course
    observation: Observation  #: all windows in the order of time
    first: Observation
    last: Observation

    @property
    def between(self) -> tuple[int, int]:
        """Mean times of the windows of both states [ns UTC]."""
        first, last = (_mean_time(side.estimates) for side in (self.first, self.last))
        return first, last


def record_states(observation: Observation) -> RecordStates | None:
    """Return the states at both ends of a record within which the structure changed, else None.

    The drift within each of the two groups of windows is removed: the windows show the state at the group's mean time.
    """
    ordered, seconds = in_order_of_time(observation)
    course = find_course(ordered.modes, seconds, ordered.temperature, ordered.rms)
    if course is None or course.kind == "irregular":
        return None
    first, last = ordered.chosen(course.first), ordered.chosen(course.last)
    if course.kind == "gradual":
        first, last = (replace(side, estimates=without_drift(side.estimates, side.tracks)) for side in (first, last))
    return RecordStates(course=course, observation=ordered, first=first, last=last)


def explain_record(
    explain_states: Explain,
    structure: Structure,
    before: Observation | None,
    now: Observation,
    heldout: Observation | None = None,
) -> Explanation:
    """Explain logs; of logs within which the structure changed, the state at the end.

    What changed within them is explained with their beginning as the reference (`Explanation.diagnosis.within_record`).
    A change by temperature or amplitude does not count: the mean of all windows is explained then. A body that grows
    has part of its mass at the beginning already, which increases the modal masses: then the change is explained once
    more, with this part in the model.

    Parameters
    ----------
    explain_states : `explain` with its options
    structure, before, now, heldout : as for `explain`, whose errors are raised
    """
    states = record_states(now)
    if states is None:
        return explain_states(structure, before, now, heldout)
    try:
        change = explain_states(structure, states.first, states.last, None)
    except StateError:  # too few modes at one of both ends
        return explain_states(structure, before, now, heldout)
    causes = {cause.cause for cause in change.diagnosis.causes}
    of_all = change.diagnosis.verdict != "unexplained" and causes <= _SURROUNDINGS
    found = explain_states(structure, before, states.observation if of_all else states.last, heldout)
    if _grown(found) and _grown(change):
        try:
            begun = _with_grown(structure, explain_states(structure, before, states.first, None), found)
            again = explain_states(begun, states.first, states.last, None) if begun else change
        except StateError:  # too few modes in common with the state before
            again = change
        change = again if _grown(again) else change
    within = _within_record(states, change, of_all=of_all)
    return replace(found, diagnosis=found.diagnosis.model_copy(update={"within_record": within}))


def _grown(one: Explanation) -> Cause | None:
    """Return the body that explains a state, alone or with other causes; None if none does, or several may."""
    bodies = [cause for cause in one.diagnosis.causes if cause.cause == _BODY]
    return bodies[0] if one.diagnosis.verdict == "explained" and len(bodies) == 1 else None


def _with_grown(structure: Structure, begun: Explanation, ended: Explanation) -> Structure | None:
    """Return the structure with the mass that a growing body has in the first state; None if it has none there.

    Parameters
    ----------
    structure : as in its file
    begun, ended : the first and the last state
    """
    first, last, extended = _grown(begun), _grown(ended), ended.explained.extended
    if not (first and last and extended and _is_at_one_place(first, last)):
        return None
    new = extended.body[len(structure.body) :]
    if len(new) != 1:  # bodies of the file were changed too
        return None
    return structure.with_bodies([new[0].times(first.parameters["mass"].value / last.parameters["mass"].value)])


def _is_at_one_place(one: Cause, other: Cause) -> bool:
    """Return whether two stated places agree within two deviations."""
    first, second = one.where, other.where
    if not (first and second and first.position and second.position):
        return False
    std = math.hypot(first.position_std or 0.0, second.position_std or 0.0)
    return math.dist(first.position, second.position) < SIGNIFICANT * std


def _within_record(states: RecordStates, change: Explanation, *, of_all: bool) -> WithinRecord:
    start, end = states.between
    course, estimates = states.course, states.observation.estimates
    causes = change.diagnosis.causes
    hours = (end - start) * 1e-9 / _HOUR
    return WithinRecord(
        kind="sudden" if course.kind == "sudden" else "gradual",
        start=start,
        end=end,
        of_all=of_all,
        verdict=change.diagnosis.verdict,
        causes=causes,
        rates=tuple(r for cause in causes for r in _rates(cause, hours)) if course.kind == "gradual" else (),
        step=(estimates[course.first[-1]].end, estimates[course.last[0]].start) if course.kind == "sudden" else None,
        course=tuple(
            CoursePoint(time=(e.start + e.end) // 2, share=float(share), std=float(std))
            for e, share, std in zip(estimates, course.share, course.share_std, strict=True)
        ),
        p_value=course.p_value,
    )


def _rates(cause: Cause, hours: float) -> list[ChangeRate]:
    """Return the mean rates of a cause's amounts."""
    found = [(name, q.value, q.std, q.unit) for name, q in cause.parameters.items() if name in _AMOUNTS]
    for change in cause.changes:
        if change.before is not None:
            std = math.sqrt(max(change.std**2 - change.before_std**2, 0.0)) or change.std
            found.append((change.name, change.after - change.before, std, change.unit))
    return [
        ChangeRate(cause=cause.cause, parameter=name, per_hour=value / hours, std=std / hours, unit=unit)
        for name, value, std, unit in found
    ]


def _mean_time(estimates: Sequence[ModalEstimate]) -> int:
    return sum((estimate.start + estimate.end) // 2 for estimate in estimates) // len(estimates)

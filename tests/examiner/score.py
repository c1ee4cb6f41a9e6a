"""Compares a diagnosis, as the JSON of the command, with the true change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from daq import FloatArray
from tests.examiner.draws import Hidden

_SHORTEST = 1e-3  # m: a region of no length
_OFF_AXIS = 0.1  # m: by which a place may be beside the axis of a member, to which a region belongs
RIGHT, ALIAS, WRONG, MISPLACED, REFUSED, MISSED = "right", "alias", "wrong", "misplaced", "refused", "missed"


#: what any file gets a little wrong, and what says the same of one record
_OF_FILES = {
    *("model_parameters", "support_stiffness", "joint_stiffness"),
    *("global_stiffness", "global_density", "temperature", "sampling_clock"),
}


@dataclass(frozen=True, kw_only=True)
class Score:
    """One word, and how far off a place and sizes are."""

    outcome: str
    reported: str  #: verdict and names
    away: float | None = None  #: m
    errors: dict[str, float] = field(default_factory=dict)  #: of parameters, as stated less true
    deviations: dict[str, float] = field(default_factory=dict)  #: stated standard deviations of these parameters
    inside: bool | None = None  #: whether the true place is in the stated 95 % region; None where there is none
    probability: float | None = None  #: stated, of the first set of causes; None where nothing is named
    first_is_right: bool | None = None  #: whether this set is the true one, or holds it as an alternative

    @property
    def fine(self) -> bool:
        """Right, or among a stated alias set."""
        return self.outcome in {RIGHT, ALIAS}


def score(
    answer: Mapping[str, Any], hidden: Sequence[Hidden], kind: str, *, near: float = 0.1, built: bool = False
) -> Score:
    """Judge.

    - right: the verdict and every name, channel and position (as near as `near`, or on its extent) are the true ones;
    - alias: ambiguous, and each thing done is in an alias set that is stated;
    - wrong: something else was named, whether surely or not; misplaced: the right name at another place;
    - refused: unexplained; missed: nothing to explain. Both are right where there is nothing that could be named.

    Parameters
    ----------
    answer : the JSON of `diagnose`
    hidden : the true change
    kind : of the case, which determines the expected verdict
    near : a cause named farther from where it is than this [m] is not the one that was done
    built : whether a file, which has small errors everywhere, is the only knowledge: to state these errors too is right
    """
    if built:
        named = [cause for cause in answer["causes"] if cause["cause"] not in _OF_FILES]
        verdict = answer["verdict"] if named or answer["verdict"] == "unexplained" else "nothing_to_explain"
        answer = {**answer, "causes": named, "verdict": verdict}
    outcome = _outcome(answer, hidden, kind, near)
    first = answer["causes"][0] if len(answer["causes"]) == 1 and len(hidden) == 1 else None
    same = first if first is not None and first["cause"] == hidden[0].cause else None
    leading = _leading(answer["causes"])
    return Score(
        outcome=outcome,
        reported=_said(answer),
        away=_away(same, hidden[0]) if same else None,
        errors=_errors(same, hidden[0]) if same else {},
        deviations={name: same["parameters"][name]["std"] for name in _errors(same, hidden[0])} if same else {},
        inside=_inside(same, hidden[0]) if same else None,
        probability=leading[0]["probability"] if leading else None,
        first_is_right=_is_right(leading, hidden, near) if leading else None,
    )


def _leading(causes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the causes of the first set: those that share its probability."""
    return [cause for cause in causes if cause["probability"] == causes[0]["probability"]]


def _is_right(leading: Sequence[Mapping[str, Any]], hidden: Sequence[Hidden], near: float) -> bool:
    """Return whether the first set of causes is the true one; where it states alternatives, whether it holds it."""
    if len(leading) != len(hidden):
        return False
    sure = not any(cause["cannot_be_told_from"] for cause in leading)
    return _named(leading, hidden, near, sure=sure) in {RIGHT, ALIAS}


def _outcome(answer: Mapping[str, Any], hidden: Sequence[Hidden], kind: str, near: float) -> str:
    verdict = answer["verdict"]
    if verdict == "nothing_to_explain":
        return RIGHT if kind in {"nothing", "small"} else MISSED
    if verdict == "unexplained":
        return RIGHT if kind == "outside" else REFUSED
    if kind in {"nothing", "outside"}:
        return WRONG
    return _named(answer["causes"], hidden, near, sure=verdict == "explained")


def _named(causes: Sequence[Mapping[str, Any]], hidden: Sequence[Hidden], near: float, *, sure: bool) -> str:
    """Judge the names: the same multiset if it is sure of them, each in some set if not."""
    reported = sorted(str(cause["cause"]) for cause in causes)
    done = sorted(one.cause for one in hidden)
    if sure:
        if reported != done:
            return WRONG
        return RIGHT if all(any(_there(c, one, near) for c in causes) for one in hidden) else MISPLACED
    sets = [{str(cause["cause"]), *map(str, cause["cannot_be_told_from"])} for cause in causes]
    return ALIAS if all(any(one.cause in names for names in sets) for one in hidden) else WRONG


def _there(cause: Mapping[str, Any], one: Hidden, near: float) -> bool:
    if cause["cause"] != one.cause:
        return False
    if one.channels:
        return set(cause["where"]["channels"]) & set(one.channels) != set() and _all_of(cause, one)
    away = _away(cause, one)
    return away is None or away < max(near, one.reach)


def _all_of(cause: Mapping[str, Any], one: Hidden) -> bool:
    """A channel is meant alone; of a device, its channels."""
    reported = set(cause["where"]["channels"])
    return reported <= set(one.channels) and (
        len(one.channels) == 1 or one.cause != "sensor_swap" or len(reported) == len(one.channels)
    )


def _away(cause: Mapping[str, Any] | None, one: Hidden) -> float | None:
    if cause is None or one.position is None or not cause["where"] or cause["where"]["position"] is None:
        return None
    return float(np.linalg.norm(np.subtract(cause["where"]["position"], one.position)))


def _inside(cause: Mapping[str, Any], one: Hidden) -> bool | None:
    """Return whether a place is in the stated region, by its position along the member."""
    if _away(cause, one) is None or not cause["where"]["region"]:
        return None
    return any(_between(np.array(one.position), *np.array(ends)) for ends in cause["where"]["region"])


def _between(point: FloatArray, start: FloatArray, end: FloatArray) -> bool:
    along = end - start
    length = float(np.linalg.norm(along))
    if length < _SHORTEST:
        return float(np.linalg.norm(point - start)) < _SHORTEST
    share = float((point - start) @ along) / length**2
    return 0 <= share <= 1 and float(np.linalg.norm(point - start - share * along)) < _OFF_AXIS


def _errors(cause: Mapping[str, Any], one: Hidden) -> dict[str, float]:
    reported = cause["parameters"]
    return {name: reported[name]["value"] - true for name, true in one.parameters.items() if name in reported}


def _said(answer: Mapping[str, Any]) -> str:
    names = [
        " or ".join([str(cause["cause"]), *map(str, cause["cannot_be_told_from"])]) + _where(cause)
        for cause in answer["causes"]
    ]
    return "; ".join([str(answer["verdict"]), *names])


def _where(cause: Mapping[str, Any]) -> str:
    where = cause["where"]
    if not where:
        return ""
    if where["position"] is not None:
        return " at ({:.3f}, {:.3f}, {:.3f})".format(*where["position"])
    return f" of {', '.join(where['channels'])}"

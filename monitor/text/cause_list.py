"""Causes of a diagnosis as they are listed: one entry for one part of the structure.

A diagnosis has alternatives of one or more causes each; the causes of one alternative have its probability. A cause
that several alternatives have in common is one entry with the sum of their probabilities. A foot or joint and a stretch
of a member next to it are one entry too: only the model distinguishes them.
"""

import math
from collections.abc import Sequence

import numpy as np

from updater import Cause
from updater.diagnosis import Alternative, FittedCause

_CONNECTIONS = ("support_stiffness", "joint_stiffness", "local_stiffness")  # the one that names the entry comes first
_LEAST = 1e-12  # probability that a ratio is taken of
_SAME_VALUE = 2.0  # standard deviations within which parameters of two alternatives are the same


def listed_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return one cause for each entry, in the order of the diagnosis."""
    entries: list[list[Cause]] = []
    for cause in causes:
        entry = next((entry for entry in entries if all(_belongs(cause, other) for other in entry)), None)
        if entry is None:
            entries.append([cause])
        else:
            entry.append(cause)
    return tuple(_merged(entry) for entry in entries)


def _belongs(one: Cause, other: Cause) -> bool:
    """Return whether two causes are of one part of the structure, or one cause of two alternatives."""
    if one.cause in _CONNECTIONS and other.cause in _CONNECTIONS:
        return _place(one) is not None and _place(one) == _place(other)
    same = one.cause == other.cause and one.probability != other.probability and _near(one, other)
    values = ([(c.parameters[k].value, c.parameters[k].std) for k in one.parameters] for c in (one, other))
    return same and one.parameters.keys() == other.parameters.keys() and all(map(_alike, *values))


def _alike(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return abs(one[0] - other[0]) <= _SAME_VALUE * max(one[1], other[1])


def _place(cause: Cause) -> object:
    """Return the foot or joint that a cause is at; None for a stretch elsewhere."""
    where = cause.where
    if where is None or where.position is None:
        return None
    if cause.cause != "local_stiffness":
        return where.name or where.position
    return where.name if where.name.startswith(("foot of", "joint of", "support ")) else None


def _near(one: Cause, other: Cause) -> bool:
    """Return whether two places are the same, within their deviations; those of sensors are their channels."""
    first, second = one.where, other.where
    if first is None or second is None or first.position is None or second.position is None:
        return first == second or (first is not None and second is not None and first.channels == second.channels)
    std = max(first.position_std or 0.0, second.position_std or 0.0)
    apart = float(np.linalg.norm(np.subtract(first.position, second.position)))
    return first.member == second.member and apart <= _SAME_VALUE * std


def _merged(entry: list[Cause]) -> Cause:
    """Return one cause with the parameters of all and the probability that one of their alternatives is true."""
    if len(entry) == 1:
        return entry[0]
    entry = sorted(entry, key=lambda c: _CONNECTIONS.index(c.cause) if c.cause in _CONNECTIONS else 0)
    first = entry[0]
    own = [c for c in entry if c.cause == first.cause]
    others = (name for c in entry for name in (c.cause, *c.cannot_be_told_from))
    fitted = {other.cause: other for c in reversed(entry) for other in _alternatives(c, first)}
    parameters = {name: quantity for c in reversed(own) for name, quantity in c.parameters.items()}
    changes = {change.name: change for c in reversed(own) for change in c.changes}
    return first.model_copy(
        update={
            "probability": min(1.0, sum({c.probability for c in entry})),
            "parameters": dict(sorted(parameters.items())),
            "changes": tuple(changes[name] for name in sorted(changes)),
            "cannot_be_told_from": (names := tuple(dict.fromkeys(name for name in others if name != first.cause))),
            "alternatives": tuple(fitted[name] for name in names if name in fitted),
        }
    )


def _alternatives(cause: Cause, first: Cause) -> list[Alternative]:
    """Return a cause and its alternatives as alternatives of the first one of its entry."""
    if cause.cause == first.cause:
        return list(cause.alternatives)
    own = {name: getattr(cause, name) for name in FittedCause.model_fields}
    relative = math.log(max(cause.probability, _LEAST) / max(first.probability, _LEAST))
    return [*cause.alternatives, Alternative(**own, log_evidence=relative)]

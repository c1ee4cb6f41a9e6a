"""Feet, bearings and joints of the kind of one that changed: the changes of their stiffness that the data permit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from updater.causes.base import Nothing
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.causes.stiffness.connections import Springs, same_connection
from updater.inference import Comparison, fit
from updater.structure import Axis, Joint, Support

_WIDE = 10.0  # prior standard deviation of a flexibility added, relative to the spring's own
_DETERMINED = 0.25  # standard deviation of the flexibility, relative to that before and now: with more nothing is known
_MOST = 8  # others that are estimated: the cost rises with their number


@dataclass(frozen=True, kw_only=True)
class OtherSpring:
    """A spring of a connection like one that changed, and the relative change of its stiffness."""

    connection: Support | Joint
    axis: Axis
    change: float  #: relative change of the stiffness [-]
    std: float  #: [-]
    deviations: float  #: change of the flexibility, whose error is nearly Gaussian, over its standard deviation [-]


def other_springs(data: Comparison, chosen: Sequence[SelectedCause], named: SelectedCause) -> tuple[OtherSpring, ...]:
    """Estimate the change of the springs of other connections, about the same axes as those of one that changed.

    The parameters of all causes and the flexibilities of all others of the kind are fitted together; these have a wide
    prior. Connections without the same springs, those that were rigid, which have no relative change, and those that
    another cause changes are left out, and so are springs that the data do not determine. More than eight others are
    not estimated.

    Parameters
    ----------
    data : compared
    chosen : causes of the answer
    named : one of them, whose connection changed
    """
    cause = named.cause
    if not isinstance(cause, Springs):
        return ()
    free = [_widened(cause, row) for row in _others(cause, chosen, named.row)]
    if not 0 < len(free) <= _MOST:
        return ()
    joint: JointHypothesis[Any] = JointHypothesis(Nothing(comparison=data), (*chosen, *free))
    found = fit(data, joint, refine=False, start=np.concatenate([c.theta for c in (*chosen, *free)])[None])
    std = np.sqrt(np.diagonal(found.covariance[0]))
    begin, springs = len(std) - 3 * len(free), []
    for i, one in enumerate(free):
        for a in np.flatnonzero(cause.active[one.row]).tolist():
            k, own = begin + 3 * i + a, cause.own_flexibility(one.row)[a]
            added = found.theta[0, k]
            if std[k] < _DETERMINED * min(own, own + added):
                left = own / (own + added)
                springs.append(
                    OtherSpring(
                        connection=cause.connections[one.row],
                        axis=cause.axes[one.row][a],
                        change=float(left - 1),
                        std=float(left**2 * std[k] / own),
                        deviations=float(added / std[k]),
                    )
                )
    return tuple(springs)


def _others(cause: Springs, chosen: Sequence[SelectedCause], named: int) -> Iterator[int]:
    """Yield the alternative of each other connection with the springs of the one named."""
    taken = [c.cause.connections[c.row] for c in chosen if isinstance(c.cause, Springs)]
    for row in range(len(cause.connections)):
        alike = cause.axes[row] == cause.axes[named] and (cause.active[row] == cause.active[named]).all()
        known = not (cause.rigid[row] & cause.active[row]).any()
        if alike and known and not any(same_connection(cause.connections[row], one) for one in taken):
            taken.append(cause.connections[row])
            yield row


def _widened(cause: Springs, row: int) -> SelectedCause:
    """Return an alternative without a change, with a prior that has no information of its springs."""
    own = _WIDE * cause.own_flexibility(row)
    return SelectedCause(replace(cause, prior_std=np.where(cause.active[row], own, cause.prior_std)), row, np.zeros(3))

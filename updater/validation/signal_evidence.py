"""Evidence for a loss of stiffness by the signals: it opens and closes, which no linear change does."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from daq import FloatArray
from updater.causes import Cause, LocalStiffness, Springs
from updater.inference import Fit
from updater.modal_data import ModalMean, OpeningEvidence, Signals
from updater.quantities import BREATHES
from updater.structure import ON_MEMBER
from updater.validation.nonlinear_part import ONE_AXIS, PROBABLE, ActionTest, Loss, LossTests

_APART, _FINER = 0.06, 0.02  # of the longest member: distance of places; that of places near the significant ones
_MAX_PLACES = 30  # of one cause, each time
_LEAST_LOSS = 0.05  # of the logarithm of stiffness: the action of a smaller one, or of a gain, is found with it
_NOT_TESTED = OpeningEvidence(path=np.empty(0, np.intp), distance=np.empty(0), log_ratio=np.empty((0, 3)))
_DOUBTFUL = 0.05  # p value in the window alone, above which the window before the change is not tested


def opens_significantly(event: ModalMean, parts: Sequence[Fit[Cause]], signals: Signals) -> bool:
    """Return whether a place of a loss of stiffness opens and closes significantly; parameters as below.

    The p value of the most significant place is multiplied by the number of places and actions that are tested.
    """
    p_values = [p for _, _, _, own in _of_losses(event, parts, signals) for p in own]
    return bool(p_values) and len(p_values) * min(p_values) < BREATHES


def opening_evidence(event: ModalMean, parts: Sequence[Fit[Cause]], signals: Signals) -> Mapping[str, OpeningEvidence]:
    """Return the evidence for each loss of stiffness by its name, also at places between the most probable ones.

    Half of all losses are assumed to open and close. It is empty if the signals cannot be tested.

    Parameters
    ----------
    event : (n_tracks,) modes of the window
    parts : fits of causes, each alone
    signals : of the window, and of one before the change: forces that are not symmetric, such as blows from one side,
        have a nonlinear part on a linear structure too
    """
    found, n_tests = dict[str, OpeningEvidence](), 0
    for part, tests, evidence, p_values in _of_losses(event, parts, signals):
        found[part.hypotheses.name], finer = _with_probable_places(part, tests, evidence, _FINER)
        n_tests += len(p_values) + len(finer)
    return {name: replace(evidence, n_tests=n_tests) for name, evidence in found.items()}


def _of_losses(
    event: ModalMean, parts: Sequence[Fit[Cause]], signals: Signals
) -> list[tuple[Fit[Any], LossTests, OpeningEvidence, list[float]]]:
    """Return each loss of stiffness with its tests, its evidence, and the p value of each test; empty without tests."""
    found = list[tuple[Fit[Any], LossTests, OpeningEvidence, list[float]]]()
    for part in parts:
        cause = part.hypotheses
        if isinstance(cause, LocalStiffness | Springs):
            tests = LossTests.of(cause, event, signals.now, signals.before)
            if tests is None:
                return []
            found.append((part, tests, *_with_probable_places(part, tests, _NOT_TESTED, _APART)))
    return found


def _with_probable_places(
    part: Fit[Any], tests: LossTests, known: OpeningEvidence, share: float
) -> tuple[OpeningEvidence, list[float]]:
    """Return the evidence with that at all probable places, and the p value of each further test.

    The most probable place by the modes and by the signals at tested places is tested, until none that is farther from
    these is left.

    Parameters
    ----------
    known : evidence so far
    share : distance of places over the longest member [-]
    """
    cause: Loss = part.hypotheses
    found, p_values = known, list[float]()
    apart = ON_MEMBER  # of connections: each is a path
    if isinstance(cause, LocalStiffness):
        apart = share * max(member.length for member in cause.reference.structure.member)
    by_modes, sites = part.log_density + cause.log_prior, cause.sites(part.theta, np.arange(len(part.theta)))
    axes = sites.share[by_modes > by_modes.max() - PROBABLE].max(0) >= ONE_AXIS
    theta = _at_least(cause, part.theta)
    for _ in range(_MAX_PLACES):
        density = by_modes + found.at(sites)
        near = (sites.path[:, None] == found.path) & (np.abs(sites.distance[:, None] - found.distance) < apart)
        left = np.where(near.any(1), -np.inf, density)
        row = int(left.argmax())
        if left[row] < density.max() - PROBABLE:
            break
        log_ratio = np.zeros(3)
        for test in tests.at(theta[row], row, share=axes.astype(float)):
            laws = [_of_law(tests, law) for law in (test, test.of_both_sides())]
            p_values += [p_value for _, p_value in laws]
            log_ratio[test.action.axis] = np.logaddexp(laws[0][0], laws[1][0]) - np.log(2)
        found = OpeningEvidence(
            path=np.append(found.path, sites.path[row]),
            distance=np.append(found.distance, sites.distance[row]),
            log_ratio=np.vstack([found.log_ratio, log_ratio]),
        )
    return found, p_values


def _of_law(tests: LossTests, test: ActionTest) -> tuple[float, float]:
    """Return the log likelihood ratio of a law to a linear structure, and the p value."""
    if test.against(None)[2] > _DOUBTFUL:
        return 0.0, 1.0
    usual = tests.before(test)
    return test.log_likelihood(usual), test.against(usual)[2]


def _at_least(cause: Loss, theta: FloatArray) -> FloatArray:
    """Return parameters (n, n_parameters) that are losses: the action at a place does not depend on their size."""
    if isinstance(cause, Springs):
        return np.maximum(theta, _LEAST_LOSS)
    return np.column_stack([np.maximum(theta[:, 0], _LEAST_LOSS), theta[:, 1:]])

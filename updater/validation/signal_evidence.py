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
from updater.validation.nonlinear_part import Loss, LossTests, probable_places, spacing

_APART, _FINER = 0.06, 0.02  # of the longest member: distance of places; that of places near the significant ones
_MAX_PLACES = 30  # of one cause, each time
_LEAST_LOSS = 0.05  # of the logarithm of stiffness: the action of a smaller one, or of a gain, is found with it
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
        found[part.hypotheses.name], finer = _refined(part, tests, evidence)
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
            found.append((part, tests, *_evidence(part, tests, _APART)))
    return found


def _evidence(part: Fit[Any], tests: LossTests, share: float) -> tuple[OpeningEvidence, list[float]]:
    """Return the evidence at the probable places of a cause, and the p value of each test.

    Parameters
    ----------
    share : distance of places over the longest member [-]
    """
    cause, apart = part.hypotheses, spacing(part.hypotheses, share)
    rows = np.array(probable_places(cause, part, apart=apart, most=_MAX_PLACES))
    theta = _at_least(cause, part.theta)
    log_ratio, p_values = np.zeros(len(rows)), list[float]()
    for k, row in enumerate(rows.tolist()):
        each = list[float]()
        for test in tests.at(theta[row], row):
            doubtful = test.against(None)[2] > _DOUBTFUL
            usual = None if doubtful else tests.before(test)
            p_values.append(1.0 if doubtful else test.against(usual)[2])
            each.append(0.0 if doubtful else test.log_likelihood(usual))
        if each:
            closes = float(np.logaddexp.reduce(each)) - np.log(len(each))
            log_ratio[k] = np.logaddexp(0.0, closes) - np.log(2)
    return OpeningEvidence(position=cause.places(part.theta[rows], rows), log_ratio=log_ratio, reach=apart), p_values


def _refined(part: Fit[Any], tests: LossTests, evidence: OpeningEvidence) -> tuple[OpeningEvidence, list[float]]:
    """Return the evidence at places that are closer together, the most probable ones by modes and signals.

    The second value has the p value of each further test.
    """
    cause = part.hypotheses
    if isinstance(cause, Springs):
        return evidence, []
    own = evidence.at(cause.places(part.theta, np.arange(len(part.theta))))
    return _evidence(replace(part, log_density=part.log_density + own), tests, _FINER)


def _at_least(cause: Loss, theta: FloatArray) -> FloatArray:
    """Return parameters (n, n_parameters) that are losses: the action at a place does not depend on their size."""
    if isinstance(cause, Springs):
        return theta
    return np.column_stack([np.maximum(theta[:, 0], _LEAST_LOSS), theta[:, 1:]])

"""Parameters of the extended model: refitted to the frequencies within noise.

The comparison of causes allows for errors of the reference in predicted changes. The next record has the same error:
parameters that compensate for it predict that record better, although they are no closer to the truth.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from updater.causes import Cause, CommonFactor, JointHypothesis, Nothing, SelectedCause, prediction
from updater.inference import Comparison, fit
from updater.modal_data import COMMON_STD

_SHARE = 0.2  # of the model error of frequencies: five times as close
_SIGNIFICANT = 3.0  # standard deviations of a drift that is kept


def agreeing(data: Comparison, chosen: Sequence[SelectedCause]) -> tuple[SelectedCause, ...]:
    """Return the same alternatives as they agree best with the frequencies."""
    alone = fixed(data, chosen)
    return alone.best(fit(data.trusting(_SHARE), alone))[1:]


def fixed(data: Comparison, chosen: Sequence[SelectedCause]) -> JointHypothesis[Any]:
    """Return chosen causes as the only alternative, their parameters free."""
    return JointHypothesis(Nothing(comparison=data), tuple(chosen))


def drift_beside(data: Comparison, chosen: Sequence[SelectedCause], factor: Cause | None) -> tuple[SelectedCause, ...]:
    """Return the drift common to all frequencies that chosen causes leave, as a factor on stiffness.

    The drift is a nuisance without a name; a model that agrees with the next record contains it. None if it is not
    significant, or if the causes have a common factor already.

    Parameters
    ----------
    data : measured
    chosen : causes with their parameters
    factor : cause that represents the drift
    """
    if not isinstance(factor, CommonFactor) or any(isinstance(c.cause, CommonFactor) for c in chosen):
        return ()
    if not any(c.cause.drifting for c in chosen):
        return ()
    matrix = data.trusting(_SHARE).plain.matrix
    ones, off = matrix.sum(1), matrix @ (data.log_ratio - prediction(data, chosen).log_ratio[0])
    precision = float(ones @ ones) + COMMON_STD**-2
    drift = float(ones @ off) / precision
    if abs(drift) < _SIGNIFICANT / np.sqrt(precision):
        return ()
    return (SelectedCause(factor, 0, np.array([(drift - factor.centre) / factor.spread])),)

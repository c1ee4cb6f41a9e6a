"""A law moved to where the structure is now: a change that is accepted is no scatter, and teaches none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from monitor.detection.constant import less_sure
from monitor.detection.detectors import LawState, ScoredWindows
from monitor.detection.trend import next_state


@dataclass(frozen=True, eq=False, kw_only=True)
class Shift:
    """By how much a law was moved; leading dimensions are sites."""

    log_frequency: FloatArray  #: (..., n_tracks) relative change of each frequency [-]; NaN where a mode is not seen
    std: FloatArray  #: (..., n_tracks) [-]; likewise


def shift_of(watched: LawState, judged: Sequence[ScoredWindows]) -> Shift:
    """Return the distance of windows of the changed structure from the prediction of the law.

    Their own errors are averaged; slow movements are common to all of them and are not reduced.

    Parameters
    ----------
    watched : law and averages of before
    judged : the windows since the change, in one or several pieces
    """
    law = watched.law
    terms = np.concatenate([j.terms for j in judged], axis=-3)
    residual = law.residual(terms, np.concatenate([j.whitened for j in judged], axis=-2))
    n = np.isfinite(residual).sum(-2)
    seen = np.where(n, n, np.nan)
    lasting = np.diagonal(law.slow + law.unobserved, axis1=-2, axis2=-1)
    mean = np.where(np.isfinite(residual), residual, 0.0).sum(-2) / seen
    fast = law.fast * np.concatenate([j.variance for j in judged], axis=-1).mean(-1)
    return Shift(log_frequency=mean * law.scale, std=np.sqrt(fast[..., None] / seen + lasting) * law.scale)


def shifted(watched: LawState, shift: Shift, *, back: bool = False) -> LawState:
    """Return a state whose law predicts the changed frequencies, with temperature and scatter kept.

    The uncertainty of the shift is that of its deviations; it is added to that of the law's constant. A mode without a
    shift is expected at its previous frequency. Averages start again.

    Parameters
    ----------
    watched : law and averages of before
    shift : from `shift_of`
    back : undo it; later learning of the law is kept
    """
    sign = -1.0 if back else 1.0
    law = replace(watched.law, centre=watched.law.centre + sign * np.nan_to_num(shift.log_frequency))
    if not back:
        variance = (shift.std / law.scale) ** 2
        law = less_sure(law, np.where(np.isfinite(variance), variance, np.nanmean(variance, axis=-1, keepdims=True)))
    scatter = replace(watched.scatter, residual=np.full_like(watched.scatter.residual, np.nan))
    average, weekly = np.zeros_like(watched.average), next_state(watched.weekly)
    return replace(watched, law=law, average=average, scatter=scatter, weekly=weekly)

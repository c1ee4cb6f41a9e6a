"""Extended model: its parameters, refitted to the frequencies within noise and to all measured modes.

The comparison of causes allows for errors of the reference in predicted changes. The next record has the same error:
parameters that compensate for it predict that record better, although they are no closer to the truth.

A change may excite a mode that was not measured before, such as a twist that an eccentric body couples to bending.
Until the causes are known, its counterpart in the model is unknown. Its frequency is then compared with the model's
own, whose error counts.

A change may also move a mode so far that it is not recognized: a clamped foot that yields lowers a mode to a third
of its frequency. Once causes are found, the changed model identifies such a mode by its shape, although the parameters,
fitted without it, do not yet predict its frequency.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from daq import BoolArray, FloatArray, IndexArray
from oma import mac_matrix
from updater.causes import (
    CATALOGUE,
    AddedMass,
    Cause,
    CommonFactor,
    JointHypothesis,
    Nothing,
    Parametric,
    SelectedCause,
    effect_of,
    prediction,
)
from updater.diagnosis.weighing import Candidate
from updater.inference import Comparison, Fit, fit, reanalyse, residual
from updater.modal_data import COMMON_STD, ModalMean
from updater.quantities import ECCENTRIC, FREQUENCY_STD
from updater.reference import Calibration
from updater.structure import Structure, rounded, simplified, with_few_digits

_SHARE = 0.2  # of the model error of frequencies: five times as close
_NEAR = 0.03  # ln f between measured and predicted modes that may be the same
_ALIKE = 0.8  # MAC, likewise
_FAR = 0.5  # ln f between modes that are the same by their shapes alone
_OF_SHIFT = 0.5  # of the predicted shift: error that the parameters, fitted without these modes, may have
_SAME_SHAPE = 0.9  # MAC of these, if no other is similar
_ROUNDING = 1e-9  # of ln f
_SIGNIFICANT = 3.0  # standard deviations of a drift that is kept


def agreeing(data: Comparison, chosen: Sequence[SelectedCause]) -> tuple[SelectedCause, ...]:
    """Return the same alternatives as they agree best with the frequencies."""
    alone = fixed(data, chosen)
    return alone.best(fit(data.trusting(_SHARE), alone))[1:]


def as_reported(data: Comparison, chosen: tuple[SelectedCause, ...], best: Candidate) -> tuple[SelectedCause, ...]:
    """Return causes with added bodies at the places and with the sizes that are reported, offsets only if significant.

    Reported are means of the posterior. Where the measured modes contradict them, which include those that the baseline
    lacks, the causes are returned as they are.

    Parameters
    ----------
    data : with all modes
    chosen : the causes of `best`, as they agree with these
    best : candidate that is reported
    """
    bodies = [_added_body(one, part) for one, part in zip(chosen, best.parts, strict=True)]
    if not any(bodies):
        return chosen
    moved = [
        SelectedCause(*body.at_reported_place(part, one.theta)) if body else one
        for one, part, body in zip(chosen, best.parts, bodies, strict=True)
    ]
    found = tuple(
        replace(one, theta=body.reported_size(part, one.theta)) if body else one
        for one, part, body in zip(agreeing(data, moved), best.parts, bodies, strict=True)
    )
    return found if _misfit(data, found) < _misfit(data, chosen) + ECCENTRIC**2 else chosen


def _added_body(chosen: SelectedCause, part: Fit[Cause]) -> AddedMass | None:
    """Return the alternatives of a body that was added; None for other causes."""
    cause = part.hypotheses
    return cause if isinstance(cause, AddedMass) and chosen.theta[0] > 0 else None


def _misfit(data: Comparison, chosen: Sequence[SelectedCause]) -> float:
    """Return the chi-square that `agreeing` minimises."""
    trusting = data.trusting(_SHARE)
    whitener = trusting.drifting if any(c.cause.drifting for c in chosen) else trusting.plain
    prior = sum(float(((c.theta / c.cause.prior_std) ** 2).sum()) for c in chosen)
    return float((residual(trusting, prediction(trusting, chosen), whitener) ** 2).sum()) + prior


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


def with_further_modes(
    data: Comparison,
    model_std: FloatArray,
    model_error: float,
    event: ModalMean,
    every: ModalMean,
    chosen: tuple[SelectedCause, ...],
    *,
    displaced: IndexArray | None = None,
) -> Comparison:
    """Return data with the measured modes that the baseline lacks and the model has, once causes act on it.

    Parameters
    ----------
    data : the event compared with the baseline
    model_std : (n_modes,) deviation of ln f of the reference's modes by its mesh and by walls that bend
    model_error : of the reference at any point, relative to a mode's typical displacement
    event : (n_tracks,) in the order of the baseline's tracks
    every : (n_modes,) all modes measured, in any order
    chosen : causes that are found
    displaced : modes of the reference that are sought by their shapes, farther from the predicted frequencies than the
        others, which are then left out
    """
    if data.circumstances.trend is not None or not np.isfinite(every.shape).all():
        return data
    added = data.tracks < 0  # by an earlier call
    known = data.log_ratio[added] + np.log(data.frequency[data.paired[added]])
    taken = np.isin(every.log_frequency, event.log_frequency)
    taken |= np.isclose(every.log_frequency[:, None], known, rtol=0, atol=_ROUNDING).any(1)
    others = every.only(np.flatnonzero(~taken))
    measured, modes = _answers(data, chosen, others.at(data.channels), displaced)
    if not len(measured):
        return data
    log_ratio = others.log_frequency[measured] - np.log(data.frequency[modes])
    std = np.hypot(others.log_frequency_std[measured], np.hypot(FREQUENCY_STD, model_std[modes]))
    by_model = 2 * np.hypot(model_error, model_std[modes]) * np.abs(log_ratio)
    return data.with_frequencies(modes, log_ratio, std, by_model)


def _answers(
    data: Comparison, chosen: tuple[SelectedCause, ...], others: ModalMean, displaced: IndexArray | None
) -> tuple[IndexArray, IndexArray]:
    """Return modes measured (n,) and the modes of the reference (n,) that have become these by the causes."""
    changed = reanalyse(data, effect_of(chosen))
    value, vector, weighed = changed.value[0], changed.vector[0], changed.weighed[0]
    n_modes = len(data.frequency)
    log_frequency = -0.5 * np.log(value) - np.log(2 * np.pi)
    mac = mac_matrix(others.shape, (data.at_channels @ vector[:n_modes]).T)
    off = np.abs(others.log_frequency[:, None] - log_frequency)
    alike = (mac > _ALIKE) & (off < _NEAR) if displaced is None else _same_shapes(mac, off)
    alike[:, changed.pick[0]] = False
    found = np.argmax(np.where(alike, mac, -1.0), axis=1)
    measured = np.flatnonzero(alike.any(1))
    modes = np.argmax((vector * weighed)[:n_modes, found[measured]], axis=0)
    fresh = ~np.isin(modes, data.paired) & (np.bincount(modes, minlength=n_modes)[modes] == 1)
    if displaced is not None:
        there = log_frequency[found[measured]]
        moved = np.abs(there - np.log(data.frequency[modes]))
        fresh &= np.isin(modes, displaced) & (off[measured, found[measured]] < _NEAR + _OF_SHIFT * moved)
    return measured[fresh], modes[fresh]


def _same_shapes(mac: FloatArray, off: FloatArray) -> BoolArray:
    """Return pairs (n_measured, n_modes) off by more than 3 % whose shapes are the same, and not similar to any other.

    Parameters
    ----------
    mac : (n_measured, n_modes) of measured and predicted modes
    off : likewise, difference of ln f
    """
    similar = (mac > _ALIKE) & (off < _FAR)
    alone = (similar.sum(1, keepdims=True) == 1) & (similar.sum(0) == 1)
    return np.asarray(similar & alone & (mac > _SAME_SHAPE) & (off > _NEAR), bool)


def extended_structure(
    calibration: Calibration, chosen: Sequence[SelectedCause], parts: Sequence[Fit[Cause]]
) -> Structure:
    """Return a calibrated structure with causes written in."""
    extended = calibration.structure
    acting = chosen[::-1]  # the last named acts first: a gain on exchanged channels is another's
    for part in sorted(acting, key=_turn):
        extended = part.cause.extend(extended, part.row, part.theta)
    return _as_known(calibration, extended, parts)


def _as_known(calibration: Calibration, extended: Structure, parts: Sequence[Fit[Cause]]) -> Structure:
    """Return an extended structure without springs and welds that have no effect, rounded to its accuracy."""
    std = calibration.physical_std()
    for part in parts:
        if isinstance(part.hypotheses, Parametric):
            std |= part.hypotheses.physical_std(part)
    knobs = calibration.knobs
    return with_few_digits(rounded(simplified(extended, knobs), knobs, std), calibration.structure)


def _turn(chosen: SelectedCause) -> int:
    """Return the order in which a cause is written: errors of the file first, a factor on everything last."""
    return 0 if CATALOGUE[chosen.cause.name].of_the_file else 1 + chosen.cause.place_free

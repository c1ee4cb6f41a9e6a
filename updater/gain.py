"""What causes gain on data that did not choose them: held-out records, or each mode in its turn.

A gain that may be chance is none: the log likelihood must rise by more than two standard deviations of that rise, which
by independent noise are the whitened distance between the two predictions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from updater.agreement import agreeing
from updater.causes.composite import Chosen
from updater.comparison import Comparison, Whitener
from updater.lags import without_mode
from updater.prediction import mac_of, prediction
from updater.residual import Prediction, residual
from updater.verdict import Gain, Pair

_SIGNIFICANT = 2.0  # standard deviations
_BY_MODE = ("log_ratio", "shape", "lag", "log_damping")  # of a prediction
_UNKNOWN = 1e4  # variance of a log frequency that was not measured


@dataclass(frozen=True, eq=False)
class Gained:
    """A gain and how sure it is."""

    gain: Gain
    std: Gain  #: standard deviations of the same figures
    significant: bool  #: whether the log likelihood has risen by more than chance may do


def gain_on_heldout(heldout: Comparison, chosen: Sequence[Chosen]) -> Gained:
    """Return what causes gain on a record that was not used."""
    return _gained(heldout, prediction(heldout, chosen), chosen, heldout=True)


def gain_left_out(data: Comparison, chosen: Sequence[Chosen]) -> Gained:
    """Return what causes gain on each mode when their parameters are fitted to the others.

    Places, channels and the causes themselves stay as they were found with all modes.
    """
    whole = prediction(data, chosen)
    predicted = replace(whole, **{name: getattr(whole, name).copy() for name in _BY_MODE})
    for i in range(len(data.log_ratio)):
        without = prediction(data, agreeing(_blind(data, i), chosen))
        for name in _BY_MODE:
            getattr(predicted, name)[:, i] = getattr(without, name)[:, i]
    return _gained(data, predicted, chosen, heldout=False)


def _blind(data: Comparison, mode: int) -> Comparison:
    """Return the same data with one mode as if it had not been measured."""
    seen = (np.arange(len(data.log_ratio)) != mode).astype(float)
    return replace(
        data,
        plain=_without(data.plain, mode),
        drifting=_without(data.drifting, mode),
        shape_whitener=seen[:, None, None] * data.shape_whitener,
        lag_whitener=without_mode(data.lag_whitener, mode, len(data.channels)),
        damping_weight=seen * data.damping_weight,
    )


def _without(whitener: Whitener, mode: int) -> Whitener:
    root = np.linalg.inv(whitener.matrix)
    covariance = root @ root.T
    covariance[mode, mode] += _UNKNOWN
    matrix: FloatArray = np.linalg.inv(np.linalg.cholesky(covariance)).astype(np.float64)
    return Whitener(matrix, whitener.log_det)


def _gained(data: Comparison, after: Prediction, chosen: Sequence[Chosen], *, heldout: bool) -> Gained:
    before = prediction(data, None)
    whitener = data.drifting if any(c.cause.drifting for c in chosen) else data.plain
    rests = [residual(data, before, data.plain)[0], residual(data, after, whitener)[0]]
    likelihood = [-0.5 * float(r @ r) + w.log_det for r, w in zip(rests, (data.plain, whitener), strict=True)]
    error, error_std = zip(*(_frequency_error(data, p) for p in (before, after)), strict=True)
    apart, apart_std = zip(*(_one_minus_mac(data, p) for p in (before, after)), strict=True)
    distance = float(np.linalg.norm(residual(data, before, whitener)[0] - rests[1]))
    return Gained(
        gain=Gain(
            heldout=heldout,
            frequency_error_percent=_pair(error),
            one_minus_mac=_pair(apart),
            log_likelihood=_pair(likelihood),
        ),
        std=Gain(
            heldout=heldout,
            frequency_error_percent=_pair(error_std),
            one_minus_mac=_pair(apart_std),
            log_likelihood=_pair([float(np.linalg.norm(r)) for r in rests]),
        ),
        significant=likelihood[1] - likelihood[0] > _SIGNIFICANT * distance,
    )


def _pair(values: Sequence[float | None]) -> Pair:
    return Pair(before=values[0], after=values[1])


def _frequency_error(data: Comparison, predicted: Prediction) -> tuple[float, float]:
    """Return root mean square and its standard deviation [%]."""
    rest = data.log_ratio - predicted.log_ratio[0]
    rms = float(np.sqrt(np.mean(rest**2)))
    std = np.linalg.norm(np.linalg.inv(data.plain.matrix), axis=1)
    return 100 * rms, 100 * float(np.linalg.norm(rest * std)) / (len(rest) * max(rms, 1e-12))


def _one_minus_mac(data: Comparison, predicted: Prediction) -> tuple[float | None, float | None]:
    """Return the mean and its standard deviation; None where no shape was measured, or is known to within its length.

    1 - MAC is the squared length of what a unit shape d has beside the predicted one: its variance is
    4 d^T C d + 2 tr(C^2).
    """
    shaped = np.flatnonzero(data.shaped)
    root: FloatArray = np.linalg.inv(data.shape_whitener[shaped]).astype(np.float64)
    covariance = root @ root.transpose(0, 2, 1)
    known = np.trace(covariance, axis1=1, axis2=2) < 1
    shaped, covariance = shaped[known], covariance[known]
    if not len(shaped):
        return None, None
    apart = 1 - mac_of(data, predicted.shape[0])[shaped]
    shape = predicted.shape[0, shaped] / np.linalg.norm(predicted.shape[0, shaped], axis=1, keepdims=True)
    beside = data.shape[shaped] - (data.shape[shaped] * shape).sum(1, keepdims=True) * shape
    variance = 4 * np.einsum("ic,icd,id->i", beside, covariance, beside) + 2 * (covariance**2).sum((1, 2))
    return float(apart.mean()), float(np.sqrt(variance.sum())) / len(shaped)

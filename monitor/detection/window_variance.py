"""Variance of a window's frequencies, common to all modes, from stated deviations, the RMS, and its own recent past.

The log variance is linear in the logarithms of the stated variance and of the squared RMS, with coefficients that are
learned, plus a part that decays within hours. It is observed through differences between windows, which a change of the
structure enters once. Three Kalman filters, each with another size of that part, are weighted by their likelihood.

References
----------
Harvey, A., Ruiz, E., Shephard, N. (1994). Multivariate stochastic variance models. Review of Economic Studies 61,
247-264: log squares are observations of the log variance with additive errors of known mean and variance.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import polygamma, psi

from daq import FloatArray

_HOURS = 6.0  # in which the part that nothing explains decays
_SIZES = np.array([0.05, 0.4, 1.0])  # its standard deviations, of log variance ...
_LIKELY = np.log([0.6, 0.3, 0.1])  # ... and how likely each is before anything is measured
_PRIOR_MEAN = np.array([0.0, 1.0, 0.0, 0.0])  # level, exponents of the stated variance and of the squared RMS, own past
_PRIOR_STD = np.array([0.5, 0.5, 0.5, 0.0])
_EFFICIENCY = 2 / 3  # of successive differences, which share a window
_CLIP = 6.6  # times the variance: squares beyond (1 % of normal ones) count as that
_MAX_INNOVATION = 2.0  # standard deviations


@dataclass(frozen=True, eq=False, kw_only=True)
class ScatterState:
    """Three filters of the log variance, and the last windows, which the next ones are compared with."""

    mean: FloatArray  #: (..., 3, 4) of level, exponents and own past
    covariance: FloatArray  #: (..., 3, 4, 4)
    log_weight: FloatArray  #: (..., 3) log likelihood, prior included
    centre: FloatArray  #: (..., 2) log stated variance and log squared RMS of the baseline
    residual: FloatArray  #: (..., lag, n_tracks) of the last windows, whitened
    regressors: FloatArray  #: (..., lag, 2) of the last windows


@dataclass(frozen=True, eq=False, kw_only=True)
class Scatter:
    """Variances of windows, predicted before each."""

    variance: FloatArray  #: (..., n_windows) over the square of the law's stated deviation
    log_variance: FloatArray  #: (..., n_windows) variance of its logarithm


def regressors(std: FloatArray, scale: FloatArray, rms: FloatArray) -> FloatArray:
    """Return log stated variance over that of the law, and log squared RMS (..., n_windows, 2); NaN where unknown.

    Parameters
    ----------
    std : (..., n_windows, n_tracks) stated, NaN where a mode is missing
    scale : (..., n_tracks) stated deviation by which frequencies are whitened
    rms : (..., n_windows) of the acceleration [m/s2]
    """
    ratio = 2 * np.log(std / scale[..., None, :])
    seen = np.isfinite(ratio)
    stated = np.where(seen, ratio, 0.0).sum(-1) / np.where(seen.any(-1), seen.sum(-1), np.nan)
    loud = 2 * np.log(np.where(rms > 0, rms, np.nan))
    return np.stack([stated, loud], axis=-1)


def first_scatter(regressors: FloatArray, n_tracks: int, variance: FloatArray, lag: int) -> ScatterState:
    """Return the state before a baseline.

    Parameters
    ----------
    regressors : (..., n_windows, 2) of the baseline
    n_tracks : modes
    variance : (...,) of the baseline's windows over the law's stated one
    lag : windows from one to the next that shares no sample with it
    """
    lead = regressors.shape[:-2]
    seen = np.isfinite(regressors)
    centre = np.where(seen, regressors, 0.0).sum(-2) / np.maximum(seen.sum(-2), 1)
    mean = np.broadcast_to(_PRIOR_MEAN, (*lead, len(_SIZES), 4)).copy()
    mean[..., 0] = np.log(variance)[..., None]
    prior = np.eye(4) * _PRIOR_STD**2 + np.diag([0.0, 0.0, 0.0, 1.0]) * _SIZES[:, None, None] ** 2
    return ScatterState(
        mean=mean,
        covariance=np.broadcast_to(prior, (*lead, len(_SIZES), 4, 4)),
        log_weight=np.broadcast_to(_LIKELY, (*lead, len(_SIZES))),
        centre=centre,
        residual=np.full((*lead, lag, n_tracks), np.nan),
        regressors=np.full((*lead, lag, 2), np.nan),
    )


def follow_scatter(
    state: ScatterState, residual: FloatArray, regressors: FloatArray, seconds: FloatArray
) -> tuple[Scatter, ScatterState]:
    """Return the variance of each window as it is predicted from those before, and the state after them.

    Parameters
    ----------
    state : before the windows
    residual : (..., n_windows, n_tracks) whitened, NaN where a mode is missing
    regressors : (..., n_windows, 2)
    seconds : (n_windows,) since the window before [s]
    """
    rows = []
    for k in range(residual.shape[-2]):
        state = _passed(state, float(seconds[k]))
        x = np.nan_to_num(regressors[..., k, :] - state.centre)
        mean, variance = _predicted(state, x)
        rows.append((np.exp(mean), variance))
        state = _observed(state, residual[..., k, :], x, np.exp(mean))
    predicted, unsure = (np.stack(row, axis=-1) for row in zip(*rows, strict=True))
    return Scatter(variance=predicted, log_variance=unsure), state


def _passed(state: ScatterState, seconds: float) -> ScatterState:
    """Return the state a time later: its own past decays."""
    kept = np.exp(-max(seconds, 0.0) / (_HOURS * 3600))
    decay = np.array([1.0, 1.0, 1.0, kept])
    new = np.diag([0.0, 0.0, 0.0, 1 - kept**2]) * _SIZES[:, None, None] ** 2
    return replace(state, mean=state.mean * decay, covariance=state.covariance * np.outer(decay, decay) + new)


def _design(x: FloatArray) -> FloatArray:
    """Return the row (..., 1, 4) of the observation."""
    one = np.ones(x.shape[:-1])
    return np.stack([one, x[..., 0], x[..., 1], one], axis=-1)[..., None, :]


def _predicted(state: ScatterState, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and variance (...,) of the log variance, over the filters."""
    row = _design(x)
    each = (row * state.mean).sum(-1)
    spread = ((state.covariance @ row[..., None])[..., 0] * row).sum(-1)
    weight = np.exp(state.log_weight - state.log_weight.max(-1, keepdims=True))
    weight = weight / weight.sum(-1, keepdims=True)
    mean = (weight * each).sum(-1)
    return mean, (weight * (spread + (each - mean[..., None]) ** 2)).sum(-1)


def _observed(state: ScatterState, residual: FloatArray, x: FloatArray, variance: FloatArray) -> ScatterState:
    """Return the state after a window's differences from the last one that shares no sample with it."""
    half = 0.5 * (residual - state.residual[..., 0, :]) ** 2
    n = np.isfinite(half).sum(-1)
    clipped = np.nansum(np.minimum(half, _CLIP * variance[..., None]), axis=-1) / np.maximum(n, 1)
    freedom = np.maximum(n, 1) / 2
    seen = np.log(np.maximum(clipped, 1e-12)) - psi(freedom) + np.log(freedom)
    error = polygamma(1, freedom) / _EFFICIENCY
    row = _design((x + np.nan_to_num(state.regressors[..., 0, :], nan=0.0)) / 2)
    gain = (state.covariance @ row[..., None])[..., 0]
    total = (gain * row).sum(-1) + error[..., None]
    innovation = seen[..., None] - (row * state.mean).sum(-1)
    most = _MAX_INNOVATION * np.sqrt(total)
    innovation = np.clip(innovation, -most, most)
    known = (n > 0)[..., None]
    step = np.where(known, innovation / total, 0.0)[..., None]
    less = np.where(known, 1 / total, 0.0)[..., None, None] * gain[..., :, None] * gain[..., None, :]
    likely = np.where(known, -0.5 * (np.log(total) + innovation**2 / total), 0.0)
    return replace(
        state,
        mean=state.mean + gain * step,
        covariance=state.covariance - less,
        log_weight=state.log_weight + likely,
        residual=np.concatenate([state.residual[..., 1:, :], residual[..., None, :]], axis=-2),
        regressors=np.concatenate([state.regressors[..., 1:, :], x[..., None, :]], axis=-2),
    )

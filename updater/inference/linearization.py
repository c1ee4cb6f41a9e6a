"""Changes to first order: where fits begin, and screening of very many positions of a mass.

A small mass m at a point where mode i moves by u_i changes ln omega_i by -m |u_i|^2 / 2 and rotates the mode by m (u_i
. u_k) omega_i^2 / (omega_k^2 - omega_i^2) towards mode k (Brincker et al., MSSP 45 (2014) 91-104). Whitened like the
data, residuals are linear in m; the best m and its gain in chi-square have a closed form. Gains are only compared with
each other: the error of first order for a large mass is similar nearby.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.inference.comparison import Comparison
from updater.inference.laplace_fit import Hypotheses, Point, evaluate, normal, slopes
from updater.inference.shape_covariance import beside

_MIN_INFORMATION = 1e-12  # of a parameter without effect and without prior: it starts at zero
_CHUNK = 4096  # positions at a time
_MIN_SEEN = 1e-6  # of a mode at the channels [1/sqrt(kg)]
_MAX_TURNED = 50.0  # omega_i^2 / |omega_k^2 - omega_i^2|: closer modes are no longer first order


def first_order(comparison: Comparison, slope: FloatArray, prior_std: float = np.inf) -> tuple[FloatArray, FloatArray]:
    """Estimate parameters of n alternatives to first order, and the part of chi-square that each explains.

    One Gauss-Newton step from no change, on the frequencies alone, each alternative by itself.

    Parameters
    ----------
    comparison : measured
    slope : (n, k, n_compared) change of each log frequency by a unit of each parameter [1/unit]
    prior_std : standard deviation of each parameter without data [unit]

    Returns
    -------
    theta : (n, k)
        Parameters at which fits begin [unit].
    explained : (n,)
        Reduction of chi-square [-].
    """
    whitener = comparison.drifting.matrix
    white, data = slope @ whitener.T, whitener @ comparison.log_ratio
    score = white @ data
    normal = white @ white.transpose(0, 2, 1) + np.eye(slope.shape[1]) * max(prior_std**-2.0, _MIN_INFORMATION)
    found = np.linalg.solve(normal, score[:, :, None])[:, :, 0]
    return np.asarray(found), np.asarray((found * score).sum(1))


def most_likely(comparison: Comparison, translation: FloatArray, mass_std: float, most: int) -> IndexArray:
    """Return the `most` positions, ascending, where a mass lowers chi-square the most.

    Parameters
    ----------
    comparison : measurement now and before
    translation : (n, 3, n_modes) of the reference's modes at the positions
    mass_std : prior of the mass [kg]
    most : positions to keep
    """
    linear = linear_in_mass(comparison)
    chunks = [slice(i, i + _CHUNK) for i in range(0, len(translation), _CHUNK)]
    gain = np.concatenate([_gain(translation[c], comparison.paired, linear, mass_std) for c in chunks])
    if len(gain) <= most:
        return np.arange(len(gain))
    return np.sort(np.argpartition(-gain, most)[:most])


@dataclass(frozen=True, eq=False)
class Linear:
    """Whitened residuals without a mass, and the prediction for m = 1 kg."""

    log_ratio: FloatArray  #: (n,)
    by_shift: FloatArray  #: (n, n) by |u_i|^2
    shape: FloatArray  #: (n, n_channels)
    by_coupling: FloatArray  #: (n, n_modes, n_channels) of shape i by u_i . u_k


def linear_in_mass(comparison: Comparison) -> Linear:
    """Return the residuals of a comparison, and their change by a small mass."""
    square, paired = comparison.frequency**2, comparison.paired
    gap = square / square[paired, None] - 1
    gap[np.arange(len(paired)), paired] = np.inf
    turned = np.clip(1 / np.where(gap == 0, np.inf, gap), -_MAX_TURNED, _MAX_TURNED)
    along = (comparison.at_channels[:, paired].T * comparison.model_base).sum(1)
    along = np.where(np.abs(along) < _MIN_SEEN, _MIN_SEEN, along)
    moved = beside((turned / along[:, None])[:, :, None] * comparison.at_channels.T, comparison.base[:, None])
    off = beside(comparison.shape, comparison.base)
    white = comparison.drifting.matrix
    return Linear(
        log_ratio=white @ comparison.log_ratio,
        by_shift=-0.5 * white,
        shape=np.einsum("icd,id->ic", comparison.shape_whitener, off),
        by_coupling=np.einsum("icd,ikd->ikc", comparison.shape_whitener, moved),
    )


def _gain(translation: FloatArray, paired: IndexArray, linear: Linear, mass_std: float) -> FloatArray:
    """Return the gain of the best mass at each position (n,) in chi-square."""
    shift = (translation[:, :, paired] ** 2).sum(1) @ linear.by_shift.T
    slope_rest, slope_slope = shift @ linear.log_ratio, (shift**2).sum(1)
    for mode, rest, by_coupling in zip(paired, linear.shape, linear.by_coupling, strict=True):
        slope = np.einsum("pa,pak->pk", translation[:, :, mode], translation) @ by_coupling
        slope_rest += slope @ rest
        slope_slope += (slope**2).sum(1)
    return np.asarray(slope_rest**2 / (slope_slope + mass_std**-2))


def linearised(comparison: Comparison, hypotheses: Hypotheses) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of alternatives at their start, and their change by a step of the parameters.

    Returns
    -------
    rest : (n_alternatives, n_data)
        Whitened residuals [-], without those of the priors.
    slope : (n_alternatives, n_data, n_parameters)
        Their derivatives [1/unit of the parameter].
    """
    everything = np.arange(len(hypotheses.start))
    point = evaluate(comparison, hypotheses, hypotheses.start, everything)
    n_data = point.residual.shape[1] - len(hypotheses.prior_std)
    return point.residual[:, :n_data], slopes(comparison, hypotheses, point, everything)[:, :n_data]


def foreseen(
    comparison: Comparison, hypotheses: Hypotheses, theta: FloatArray, n_own: int, rows: IndexArray
) -> FloatArray:
    """Predict minus the chi-square [-] of each alternative after its fit (len(rows),), to first order.

    Parameters
    ----------
    comparison, hypotheses : measured, and alternatives
    theta : (n_parameters,) where the first `n_own` have no effect yet; the others are fitted with them [unit of each]
    n_own : number of parameters of the alternatives themselves
    rows : numbers of the alternatives
    """
    if not n_own:  # all or nothing: the slope is zero
        whole = evaluate(comparison, hypotheses, np.tile(theta, (len(rows), 1)), rows)
        return -whole.cost
    one, own = _besides(comparison, hypotheses, theta, n_own, rows)
    score = own.transpose(0, 2, 1) @ one.residual[0]
    gain = np.einsum("pj,pj->p", score, np.linalg.solve(normal(own), score[..., None])[..., 0])
    return np.asarray(gain - one.cost[0])


def size_deviations(comparison: Comparison, hypotheses: Hypotheses, theta: FloatArray, n_own: int) -> FloatArray:
    """Return the standard deviation of each alternative's first parameter near no effect (n_alternatives,) [its unit].

    By the data alone, without the prior of that parameter; infinite where it has no effect.

    Parameters
    ----------
    comparison, hypotheses : measured, and alternatives
    theta : (n_parameters,) where the first `n_own` have no effect; those after them are fitted too [unit of each]
    n_own : number of parameters of the alternatives themselves
    """
    one, own = _besides(comparison, hypotheses, theta, n_own, np.arange(len(hypotheses.log_prior)))
    n_data = one.residual.shape[1] - len(theta)
    information = (own[:, :, 0] ** 2).sum(1) - own[:, n_data, 0] ** 2
    return np.asarray(np.maximum(information, _MIN_INFORMATION) ** -0.5)


def _besides(
    comparison: Comparison, hypotheses: Hypotheses, theta: FloatArray, n_own: int, rows: IndexArray
) -> tuple[Point, FloatArray]:
    """Return the state at theta, and derivatives (len(rows), n_residuals, n_own) beyond the other parameters'."""
    n_all = len(theta)
    one = evaluate(comparison, hypotheses, theta[None], np.zeros(1, np.intp))
    own = slopes(comparison, hypotheses, one.rows(np.zeros(len(hypotheses.log_prior), np.intp)), rows, range(n_own))
    if n_all > n_own:
        others = slopes(comparison, hypotheses, one, np.zeros(1, np.intp), range(n_own, n_all))[0]
        basis = np.linalg.qr(others)[0]
        own = own - basis @ (basis.T @ own)
    return one, own


def pulls(comparison: Comparison, hypotheses: Hypotheses, rows: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return the residuals without any effect, and their change by a step of each alternative.

    Returns
    -------
    rest : (n_data,)
        Whitened residuals [-], without those of the priors.
    slope : (len(rows), n_data, n_parameters)
        Their derivatives [1/unit of the parameter].
    """
    n, n_all = len(hypotheses.prior_std), len(hypotheses.log_prior)
    one = evaluate(comparison, hypotheses, np.zeros((1, n)), np.zeros(1, np.intp))
    n_data = one.residual.shape[1] - n
    slope = slopes(comparison, hypotheses, one.rows(np.zeros(n_all, np.intp)), rows)
    return one.residual[0, :n_data], slope[:, :n_data]

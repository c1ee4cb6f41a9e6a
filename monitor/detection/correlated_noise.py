"""Linear regression with errors that are partly independent and partly an Ornstein-Uhlenbeck process.

The share of the correlated part and its time constant are not known: both are integrated over a grid, weighted by
marginal likelihood. Standard deviations thus contain what a short record leaves open of the autocorrelation.

References
----------
Diggle, P. J., Heagerty, P., Liang, K.-Y., Zeger, S. L. (2002). Analysis of Longitudinal Data, 2nd ed. Oxford
University Press, chapter 5: measurement error and serial correlation.
Harville, D. A. (1977). Maximum likelihood approaches to variance component estimation. Journal of the American
Statistical Association 72, 320-338: restricted likelihood.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from daq import FloatArray

SHARES = (0.3, 0.7, 0.95)  #: of the correlated part in the error variance, beside none
_ITERATIONS = 4  # of the error variance, which weighs the coefficients' prior


@dataclass(frozen=True, eq=False, kw_only=True)
class Regression:
    """Posterior of the coefficients of one response, and of its errors."""

    coefficient: FloatArray  #: (q,)
    std: FloatArray  #: (q,)
    effective: float  #: independent values that are worth as much for the mean as the n correlated ones


def regress(
    y: FloatArray,
    x: FloatArray,
    prior_std: FloatArray,
    time: FloatArray,
    time_constants: tuple[float, ...],
    weight: FloatArray | None = None,
) -> Regression:
    """Return the posterior of the coefficients.

    Parameters
    ----------
    y : (n,)
    x : (n, q)
    prior_std : (q,) of coefficients about zero
    time : (n,)
    time_constants : of the correlated part, in the unit of `time`
    weight : (n,) inverse variances of the independent part, up to a factor
    """
    n = len(y)
    white = np.ones(n) if weight is None else weight.mean() / weight
    apart = np.abs(time[:, None] - time)
    grid = [(0.0, 1.0)] + [(share, constant) for share in SHARES for constant in time_constants]
    fits = [_fit(y, x, prior_std, (1 - share) * np.diag(white) + share * np.exp(-apart / t)) for share, t in grid]
    likelihood = np.array([fit[0] for fit in fits])
    posterior = np.exp(likelihood - likelihood.max())
    posterior /= posterior.sum()
    each, variance = np.array([fit[1] for fit in fits]), np.array([fit[2] for fit in fits])
    mean = posterior @ each
    spread = posterior @ (variance + (each - mean) ** 2)
    # the mean of the reciprocal: variances of a mean add up, numbers do not
    effective = 1 / float(posterior @ np.array([1 / fit[3] for fit in fits]))
    return Regression(coefficient=mean, std=np.sqrt(spread), effective=effective)


def _fit(
    y: FloatArray, x: FloatArray, prior_std: FloatArray, covariance: FloatArray
) -> tuple[float, FloatArray, FloatArray, float]:
    """Return log marginal likelihood, coefficients (q,), their variances, and the effective number of values."""
    n, q = x.shape
    root = cholesky(covariance, lower=True)
    columns = solve_triangular(root, np.column_stack([x, y, np.ones(n)]), lower=True)
    xw, yw, one = columns[:, :q], columns[:, q], columns[:, q + 1]
    gram, moment = xw.T @ xw, xw.T @ yw
    error = float(np.var(y)) + 1e-30
    for _ in range(_ITERATIONS):
        prior = error / prior_std**2
        inverse = np.linalg.inv(gram + np.diag(prior))
        coefficient = inverse @ moment
        residual = float(((yw - xw @ coefficient) ** 2).sum() + prior @ coefficient**2)
        freedom = max(n - float((inverse * gram).sum()), 1.0)
        error = residual / freedom + 1e-30
    likelihood = -n * np.log(error) - 2 * np.log(np.diag(root)).sum() + np.linalg.slogdet(inverse)[1]
    likelihood += np.log(prior).sum() - residual / error
    wider = freedom / max(freedom - 2, 1.0)  # Student's variance over the normal one
    return 0.5 * float(likelihood), coefficient, error * wider * np.diag(inverse), float(one @ one)

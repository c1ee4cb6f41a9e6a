"""Linear regression with errors that are partly independent and partly an Ornstein-Uhlenbeck process.

The share of the correlated part and its time constant are unknown: both are integrated over a grid, weighted by
marginal likelihood. Standard deviations thus include the uncertainty of the autocorrelation in a short record.

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

SHARES = (0.3, 0.7, 0.95)  #: shares of the correlated part in the error variance, in addition to none
_ITERATIONS = 4  # of the error variance, which weighs the coefficients' prior


@dataclass(frozen=True, eq=False, kw_only=True)
class Regression:
    """Posterior of the coefficients of one response."""

    coefficient: FloatArray  #: (q,)
    std: FloatArray  #: (q,)


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
    fits = [_fit(y, x, prior_std, covariance) for covariance in _covariances(time, time_constants, weight)]
    likelihood = np.array([fit[0] for fit in fits])
    posterior = np.exp(likelihood - likelihood.max())
    posterior /= posterior.sum()
    each, variance = np.array([fit[1] for fit in fits]), np.array([fit[2] for fit in fits])
    mean = posterior @ each
    return Regression(coefficient=mean, std=np.sqrt(posterior @ (variance + (each - mean) ** 2)))


def effective_number(
    y: FloatArray, x: FloatArray, prior_std: FloatArray, time: FloatArray, time_constants: tuple[float, ...]
) -> float:
    """Return the number of independent values that determine a mean as well as the correlated ones do.

    Independent errors are as likely as correlated ones before anything is measured.

    Parameters
    ----------
    y : (n, p) responses of one autocorrelation, NaN where missing
    x, prior_std, time, time_constants : as of `regress`
    """
    covariances = _covariances(time, time_constants, None)
    likelihood = np.zeros(len(covariances))
    for values in y.T:
        known = np.isfinite(values)
        if known.sum() > x.shape[1] + 2:
            inside = np.ix_(known, known)
            likelihood += [_fit(values[known], x[known], prior_std, c[inside])[0] for c in covariances]
    likelihood[1:] -= np.log(len(covariances) - 1)
    posterior = np.exp(likelihood - likelihood.max())
    variance_of_mean = [1 / np.linalg.solve(c, np.ones(len(c))).sum() for c in covariances]
    return float(posterior.sum() / (posterior @ variance_of_mean))


def _covariances(time: FloatArray, time_constants: tuple[float, ...], weight: FloatArray | None) -> list[FloatArray]:
    """Return covariances (n, n) over the error variance: of independent errors, then of each share and constant."""
    white = np.ones(len(time)) if weight is None else weight.mean() / weight
    apart = np.abs(time[:, None] - time)
    correlated = [(1 - s) * np.diag(white) + s * np.exp(-apart / t) for s in SHARES for t in time_constants]
    return [np.diag(white), *correlated]


def _fit(
    y: FloatArray, x: FloatArray, prior_std: FloatArray, covariance: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return log marginal likelihood, coefficients (q,) and their variances."""
    n, q = x.shape
    root = cholesky(covariance, lower=True)
    columns = solve_triangular(root, np.column_stack([x, y]), lower=True)
    xw, yw = columns[:, :q], columns[:, q]
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
    return 0.5 * float(likelihood), coefficient, error * wider * np.diag(inverse)

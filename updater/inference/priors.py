"""A magnitude of unknown order: its prior is uniform in its logarithm, whatever its sign.

A Gaussian prior wide enough for the largest magnitude makes small ones improbable, and prefers places where even a
large magnitude has hardly any effect. The fit has a Gaussian prior nevertheless, because it requires a slope
everywhere; here its result is weighted again.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray

_POINTS = 200  # of the quadrature over the logarithm: steps are shorter than the narrowest posterior is wide
_SPREADS = 60  # of the quadrature over the order of several parameters
_NARROW = 0.05  # relative to the magnitude: for a narrower posterior the prior is constant


@dataclass(frozen=True, eq=False)
class Magnitude:
    """The posterior of a magnitude at each of some alternatives."""

    log_ratio: FloatArray  #: (n,) log evidence with this prior over the one with the Gaussian prior
    mean: FloatArray  #: (n,)
    variance: FloatArray  #: (n,)


def log_uniform(
    value: FloatArray, std: FloatArray, *, gaussian: float | FloatArray, least: float, most: float
) -> Magnitude:
    """Return the posterior under a prior 1/(2 ln(most/least) |x|) in place of a Gaussian one.

    Parameters
    ----------
    value, std : (n,) Gaussian posterior under the Gaussian prior [unit of the parameter]
    gaussian : standard deviation of the Gaussian prior, of all or (n,) of each [unit]
    least, most : smallest and largest magnitude [unit]
    """
    size = np.exp(np.linspace(np.log(least), np.log(most), _POINTS))
    x = np.concatenate([-size[::-1], size])
    share = np.full(len(x), 1 / (2 * (_POINTS - 1)))  # of the prior at each point, by the trapezoidal rule
    share[[0, _POINTS - 1, _POINTS, -1]] /= 2
    wide = np.flatnonzero(std > _NARROW * np.abs(value))
    off = (x - value[wide, None]) / std[wide, None]
    prior = np.broadcast_to(gaussian, value.shape)[wide, None]
    log_weight = -0.5 * off**2 - np.log(std[wide, None]) + 0.5 * (x / prior) ** 2 + np.log(share * prior)
    top = log_weight.max(axis=1, keepdims=True)
    weight = np.exp(log_weight - top)
    total = weight.sum(1)
    magnitude = np.clip(np.abs(value), least, most)
    log_ratio = 0.5 * (value / gaussian) ** 2 + np.log(np.sqrt(2 * np.pi) * gaussian)
    log_ratio -= np.log(2 * np.log(most / least) * magnitude)
    mean, variance = value.copy(), std**2
    log_ratio[wide] = top[:, 0] + np.log(total)
    mean[wide] = weight @ x / total
    variance[wide] = weight @ x**2 / total - mean[wide] ** 2
    return Magnitude(log_ratio, mean, variance)


def common_magnitude(
    value: FloatArray, covariance: FloatArray, *, gaussian: float, least: float, most: float
) -> FloatArray:
    """Return the log evidence (n,) [-] under a prior with one unknown scale of all parameters, relative to a Gaussian.

    The prior is a mixture of Gaussians of one standard deviation for all parameters, uniform in its logarithm. With
    the posterior precision P, the likelihood has the precision L = P - I / gaussian^2 and the gradient P value. A
    parameter without effect on the data adds nothing.

    Parameters
    ----------
    value, covariance : (n, k), (n, k, k) Gaussian posterior under the Gaussian prior [unit, unit squared]
    gaussian : standard deviation of the Gaussian prior [unit]
    least, most : smallest and largest standard deviation of the mixture [unit]
    """
    spread = np.append(np.exp(np.linspace(np.log(least), np.log(most), _SPREADS)), gaussian)
    posterior = np.linalg.inv(covariance)
    gradient = np.einsum("pij,pj->pi", posterior, value)
    information, axes = np.linalg.eigh(posterior - np.eye(value.shape[1]) / gaussian**2)
    information = np.maximum(information, 0.0)[:, None]
    square = np.einsum("pij,pi->pj", axes, gradient)[:, None] ** 2
    precision = information + spread[:, None] ** -2.0
    log = 0.5 * (square / precision - np.log(precision * spread[:, None] ** 2)).sum(2)
    return np.asarray(logsumexp(log[:, :-1], axis=1) - np.log(_SPREADS) - log[:, -1])

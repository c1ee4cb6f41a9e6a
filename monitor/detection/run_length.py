"""Limits from the run length: how far a detector may go by chance, once in the stated time.

Of `n` modes, each detector looks at a distance that is chi-square distributed while nothing has changed, over a
variance that a baseline has estimated with some degrees of freedom. A false alarm is the start of a run of windows over
the limit; its rate is taken for a known variance first, successive windows being correlated as overlap and averaging
make them, and then averaged over what the baseline leaves open of the variance.

References
----------
Lowry, C. A., Woodall, W. H., Champ, C. W., Rigdon, S. E. (1992). A multivariate exponentially weighted moving average
control chart. Technometrics 34, 46-53.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy  # its parts at their first use
from scipy.special import ndtr

from daq import FloatArray

_DISTANCES = np.concatenate([np.linspace(0.25, 60, 120), np.linspace(62, 240, 60)])
_NODES = 120  # of integrals over a distance
_COARSE, _FINE = 23, 13  # intervals of a limit, and parts of the one that has it


@dataclass(frozen=True)
class DetectionSettings:
    """Rules by which windows are judged."""

    rate: float  #: false alarms a window that a detector may give [-]
    overlap: float  #: share of a window that the next one repeats [-]
    hold: int  #: windows in a row over the limit that make an alarm


def overlapping(overlap: float, lag: int) -> float:
    """Return the correlation of windows that far apart."""
    return max(0.0, 1 - lag * (1 - overlap))


def averaged(weight: float, overlap: float) -> tuple[float, float]:
    """Return the variance of an EWMA of unit variances, and the correlation of successive ones.

    Parameters
    ----------
    weight : of the newest window
    overlap : of windows
    """
    lags = np.arange(int(np.ceil(1 / (1 - overlap))) + 1)
    alike = np.array([overlapping(overlap, int(lag)) for lag in lags])
    fading = (1 - weight) ** lags
    variance = weight / (2 - weight) * (2 * (fading * alike).sum() - 1)
    ahead = weight**2 * (fading[:-1] * alike[1:]).sum()
    return float(variance), float(1 - weight + ahead / variance)


@lru_cache(maxsize=4096)
def jump_limit(n: int, lasting: int, freedom: float, watching: DetectionSettings) -> float:
    """Return the limit of one window's T2 over its number of modes, for `hold` windows in a row.

    Parameters
    ----------
    n : modes that the window has
    lasting : directions in which windows differ from the law alike for a long time
    freedom : degrees of freedom of the variance
    watching : rate, overlap, hold
    """
    return _limit(_run_rate(n, min(lasting, n), watching.overlap, watching.hold), n, freedom, watching.rate)


@lru_cache(maxsize=4096)
def drift_limit(n: int, freedom: float, weight: float, watching: DetectionSettings) -> float:
    """Return the limit of an EWMA's squared distance over its number of modes."""
    correlation = averaged(weight, watching.overlap)[1]
    return _limit(_crossing_rate(n, correlation), n, freedom, watching.rate)


def _limit(rate: FloatArray, n: int, freedom: float, wanted: float) -> float:
    """Return the distance over n at which the rate, averaged over the variance's posterior, is the wanted one.

    `rate` is that of a known variance at `_DISTANCES`; beyond, its logarithm is extrapolated linearly.
    """
    known = np.log(np.maximum(rate, 1e-280))
    variance, share = _variances(freedom)
    slope = (known[-1] - known[-21]) / (_DISTANCES[-1] - _DISTANCES[-21])

    def rarity(distance: FloatArray) -> FloatArray:
        there = distance[:, None] / variance
        beyond = known[-1] + slope * (there - _DISTANCES[-1])
        logs = np.where(there > _DISTANCES[-1], beyond, np.interp(there, _DISTANCES, known))
        return np.asarray(-np.log(np.exp(logs) @ share))

    tried, rare = np.geomspace(0.5 * n, 60.0 * n, _COARSE * _FINE + 1), -np.log(wanted)
    k = int(np.clip(np.searchsorted(rarity(tried[::_FINE]), rare) - 1, 0, _COARSE - 1))
    near = tried[_FINE * k : _FINE * (k + 1) + 1]
    return float(np.interp(rare, rarity(near), near) / n)


@lru_cache(maxsize=64)
def _variances(freedom: float) -> tuple[FloatArray, FloatArray]:
    """Return nodes of the variance's posterior, over its estimate, and their weights."""
    node, weight = np.polynomial.legendre.leggauss(60)
    normal = 7.0 * node
    variance = freedom / scipy.stats.chi2.ppf(ndtr(normal), freedom) if freedom < 1e4 else np.ones(len(node))
    return variance, 7.0 * weight * scipy.stats.norm.pdf(normal)


@lru_cache(maxsize=1024)
def _run_rate(n: int, lasting: int, overlap: float, hold: int) -> FloatArray:
    """Return how often a run of `hold` windows over each distance begins; `lasting` of n directions never change."""
    free = n - lasting
    alone = scipy.stats.chi2.sf(_DISTANCES, n)
    if hold == 1 or free == 0:
        return np.asarray(alone)
    single = scipy.stats.chi2.sf(_DISTANCES, free)
    pair = _pair(free, overlapping(overlap, 1))
    run = pair * (pair / single) ** (hold - 2)
    if not lasting:
        return np.asarray(run)
    root, density = _distances_under(lasting)
    left = np.interp(_DISTANCES[:, None] - root**2, np.append(0.0, _DISTANCES), np.append(0.0, np.log(run)))
    return np.asarray((density * np.exp(left)).sum(-1) + scipy.stats.chi2.sf(_DISTANCES, lasting))


def _pair(n: int, correlation: float) -> FloatArray:
    """Return the chance that two successive distances are over each of `_DISTANCES`."""
    alone = scipy.stats.chi2.sf(_DISTANCES, n)
    if correlation == 0:
        return np.asarray(alone**2)
    return np.asarray(np.maximum(alone - _crossing_rate(n, correlation), 1e-300))


@lru_cache(maxsize=256)
def _crossing_rate(n: int, correlation: float) -> FloatArray:
    """Return the chance that a distance is under each of `_DISTANCES` and the next one over it.

    The vector is Gaussian and its next value, given the present one, too: the next distance is non-central chi-square.
    """
    left = 1 - correlation**2
    root, density = _distances_under(n)
    over = scipy.stats.ncx2.sf(_DISTANCES[:, None] / left, n, correlation**2 * root**2 / left)
    return np.asarray((density * over).sum(-1))


@lru_cache(maxsize=64)
def _distances_under(n: int) -> tuple[FloatArray, FloatArray]:
    """Return roots of distances under each of `_DISTANCES`, and their chi-square density times the weight.

    The root takes the density's pole at zero away.
    """
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    half = np.sqrt(_DISTANCES)[:, None] / 2
    root = half * (node + 1)
    return root, np.asarray(scipy.stats.chi2.pdf(root**2, n) * 2 * root * half * weight)

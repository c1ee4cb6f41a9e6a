"""Significance of mass increments: a limit on the largest |z| that few windows can support.

An empirical 99th percentile does not exist for 8 to 24 baseline windows. The propagated covariance gives the
correlation of increments. The windows show its error at each place: their variance of z, shrunk towards the mean over
all places (a moderated t statistic; Smyth 2004). The distribution of the largest of these without a change is simulated
with both: windows to learn from and an event to judge, a few thousand times.

References
----------
Smyth, G. K. (2004). Linear models and empirical Bayes methods for assessing differential expression in microarray
experiments. Statistical Applications in Genetics and Molecular Biology 3(1), 3.
"""

import numpy as np

from daq import FloatArray

_FALSE_FLAGS = 0.01  # share of undisturbed events with a flag anywhere
_PRIOR_WINDOWS = 8  # that the mean over all places counts for at each
_DRAWS = 4000
_CHUNK = 500
_SEED = 1  # a log replayed gives the same limit
_MAX_PLACES = 2000  # that are simulated; of more every n-th, between which increments are smooth
_NEGLIGIBLE = 1e-6  # standard deviation of an increment, given those before it
_PREFERENCE = 0.1  # how much less an increment counts as a pivot from the first to the last: no two are equal


def moderated_variance(z: FloatArray) -> FloatArray:
    """Return the variance (..., n) of z (..., n_windows, n), drawn towards its mean over all n places."""
    n_windows = z.shape[-2]
    own = (z**2).mean(-2)
    pooled = own.mean(-1, keepdims=True)
    return np.asarray((_PRIOR_WINDOWS * pooled + n_windows * own) / (_PRIOR_WINDOWS + n_windows))


def z_limit(noise: FloatArray, common: FloatArray, degrees_of_freedom: int) -> float:
    """Return the |z| that one undisturbed event in 100 passes anywhere.

    Parameters
    ----------
    noise : (n, n_inputs) effect of one standard deviation of each input on each increment
    common : (n,) the same for a common change of all frequencies, about which windows give no information
    degrees_of_freedom : of the variances learned from windows: one fewer than there are; 0 if none were
    """
    every = -(-len(noise) // _MAX_PLACES)
    noise, common = noise[::every], common[::every]
    scale = np.linalg.norm(noise, axis=1)
    root = _correlation_root(noise / scale[:, None])
    random = np.random.default_rng(_SEED)
    largest = []
    for _ in range(_DRAWS // _CHUNK):
        z = random.standard_normal((_CHUNK, degrees_of_freedom + 1, root.shape[1])) @ root.T
        variance = moderated_variance(z[:, 1:]) if degrees_of_freedom else 1.0
        event = z[:, 0] + random.standard_normal((_CHUNK, 1)) * (common / scale)
        largest.append((np.abs(event) / np.sqrt(variance + (common / scale) ** 2)).max(-1))
    return float(np.quantile(np.concatenate(largest), 1 - _FALSE_FLAGS))


def _correlation_root(noise: FloatArray) -> FloatArray:
    """Return (n, rank) with the correlation of (n, n_inputs) by Cholesky's decomposition with pivots.

    Other than singular vectors, which are free in sign and mix where values are equal, it is a smooth function of the
    correlation, so that the limit simulated with it does not depend on how a processor rounds.
    """
    left = noise.copy()  # part that the pivots so far leave unexplained
    preference = np.linspace(1.0, 1.0 - _PREFERENCE, len(noise))
    columns: list[FloatArray] = []
    for _ in range(min(noise.shape)):
        pivot = int(np.argmax(preference * np.linalg.norm(left, axis=1)))
        length = float(np.linalg.norm(left[pivot]))
        if length < _NEGLIGIBLE:
            break
        direction = left[pivot] / length
        columns.append(left @ direction)
        left = left - np.outer(columns[-1], direction)
    return np.column_stack(columns)

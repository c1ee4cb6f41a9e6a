"""Information about hypotheses that is expected of a measurement before it is made.

References
----------
Lindley, D. V. (1956). On a measure of the information provided by an experiment. Annals of Mathematical Statistics
27(4), 986-1005.
"""

import numpy as np

from daq import FloatArray

_DRAWS = 2000  # simulated measurements per hypothesis: the information is then known to about 2 %


def entropy(probability: FloatArray) -> FloatArray:
    """Return the entropy (...) [bit] of probabilities (..., n) [-], which sum to one over the last axis."""
    logs = np.log2(probability, where=probability > 0, out=np.zeros_like(probability))
    return np.asarray(-(probability * logs).sum(-1))


def expected_information(probability: FloatArray, distance: FloatArray) -> float:
    """Return by how much a measurement is expected to lower the entropy of hypotheses [bit].

    The hypotheses predict its result with normal errors. Results are simulated for each hypothesis, and give
    probabilities by Bayes' theorem.

    Parameters
    ----------
    probability : (n,) of the hypotheses, their sum is 1
    distance : (n, n) of their predictions, in standard deviations
    """
    n = len(probability)
    noise = np.random.default_rng(0).standard_normal((_DRAWS, n))
    points = _points(distance)
    result = points[:, None] + np.concatenate([noise, -noise])  # (n, 2 n_draws, n), of each true hypothesis
    square = ((result[:, :, None] - points) ** 2).sum(-1)
    log_odds = np.log(np.maximum(probability, np.finfo(float).tiny)) - square / 2
    later = np.exp(log_odds - log_odds.max(-1, keepdims=True))
    later /= later.sum(-1, keepdims=True)
    return max(0.0, float(entropy(probability) - probability @ entropy(later).mean(1)))


def _points(distance: FloatArray) -> FloatArray:
    """Return points (n, n) at these distances from each other (classical multidimensional scaling)."""
    n = len(distance)
    centre = np.eye(n) - 1 / n
    value, vector = np.linalg.eigh(-centre @ distance**2 @ centre / 2)
    return np.asarray(vector * np.sqrt(np.maximum(value, 0.0)))

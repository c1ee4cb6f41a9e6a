"""First-order effect of hypotheses on the data, before any of them is fitted."""

import numpy as np

from daq import FloatArray, IndexArray
from updater.comparison import Comparison
from updater.fit import Hypotheses, Point, evaluate, normal, slopes


def linearised(comparison: Comparison, hypotheses: Hypotheses) -> tuple[FloatArray, FloatArray]:
    """Return where alternatives leave the data at their start, and what a step in their parameters does to that.

    Returns
    -------
    rest : (n_alternatives, n_data)
        Whitened residuals, without the priors'.
    slope : (n_alternatives, n_data, n_parameters)
        Their derivatives.
    """
    everything = np.arange(len(hypotheses.start))
    point = evaluate(comparison, hypotheses, hypotheses.start, everything)
    n_data = point.residual.shape[1] - len(hypotheses.prior_std)
    return point.residual[:, :n_data], slopes(comparison, hypotheses, point, everything)[:, :n_data]


def foreseen(comparison: Comparison, hypotheses: Hypotheses, theta: FloatArray, n_own: int) -> FloatArray:
    """Return minus the chi-square that each alternative would come to, to first order (n_alternatives,).

    Parameters
    ----------
    theta : (n_parameters,) where the first `n_own` do nothing yet; the others give way with them
    """
    n = len(hypotheses.log_prior)
    if not n_own:  # all or nothing: no slope tells
        whole = evaluate(comparison, hypotheses, np.tile(theta, (n, 1)), np.arange(n))
        return -whole.cost
    one = evaluate(comparison, hypotheses, theta[None], np.zeros(1, np.intp))
    n_all = len(theta)
    own = slopes(comparison, hypotheses, _repeated(one, n), np.arange(n), range(n_own))
    others = slopes(comparison, hypotheses, one, np.zeros(1, np.intp), range(n_own, n_all))[0]
    if n_all > n_own:
        basis = np.linalg.qr(others)[0]
        own = own - np.einsum("dk,pkj->pdj", basis, np.einsum("dk,pdj->pkj", basis, own))
    score = own.transpose(0, 2, 1) @ one.residual[0]
    gain = np.einsum("pj,pj->p", score, np.linalg.solve(normal(own), score[..., None])[..., 0])
    return np.asarray(gain - one.cost[0])


def pulls(comparison: Comparison, hypotheses: Hypotheses, rows: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return where the data are if no alternative does anything, and what a step of each does to that.

    Returns
    -------
    rest : (n_data,)
        Whitened residual, without the priors'.
    slope : (len(rows), n_data, n_parameters)
        Its derivatives.
    """
    n, n_all = len(hypotheses.prior_std), len(hypotheses.log_prior)
    one = evaluate(comparison, hypotheses, np.zeros((1, n)), np.zeros(1, np.intp))
    n_data = one.residual.shape[1] - n
    return one.residual[0, :n_data], slopes(comparison, hypotheses, _repeated(one, n_all), rows)[:, :n_data]


def _repeated(one: Point, n: int) -> Point:
    """Return what one alternative does as that of n: at nothing all are alike."""
    rows = np.zeros(n, np.intp)
    return Point(one.theta[rows], one.effect.rows(rows), one.changed.rows(rows), one.residual[rows])

"""Covariance of fitted parameters with masses and sections that a structure file has wrong.

Files lack bodies: cables, brackets, bolts, a box. Parameters absorb them, and the fit is as good as with them. The law
of total variance over the alternatives states how far: each alternative is a body at one place and of one order of
size, with its probability given the data.

With whitened residuals r and their derivatives A by the parameters, both with the priors, the covariance is the inverse
C of A^T A. A body of one kilogram at a place changes r by g; the parameters follow by t = -C A^T g, and h = g + A t
remains. With a prior N(0, s^2) of its mass, the variance of the mass is v = 1 / (h^T h + s^-2) and its mean -v h^T r;
the evidence relative to no body is (v / s^2)^1/2 exp(v (h^T r)^2 / 2). A parameter that is held at its value in the
file adds its prior variance in the same way.
"""

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from daq import FloatArray
from updater.causes.base import Cause
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.causes.mass.added_mass import propose_added_mass
from updater.inference import Comparison, evaluate, slopes
from updater.reference import Reference
from updater.structure import size

_SPACING = 0.1  # m on a frame of 1.5 m, between places
_SMALLEST, _LARGEST = 0.002, 0.05  # of the structure's mass: bodies that files lack, uniform in the logarithm
_ORDERS = 8  # standard deviations of the mass between these


def covariance_with_unlisted(
    reference: Reference, data: Comparison, chosen: tuple[SelectedCause, ...], n_held: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance (n, n) of the fitted parameters, and the part (n, n) to add for errors of the file.

    Rows and columns are in the units of the parameters.

    Parameters
    ----------
    reference : whose structure may bear bodies that its file lacks
    data : that the parameters were fitted to
    chosen : causes at their best parameters
    n_held : last parameters of all, which were not fitted but held at the values of the file
    """
    if not any(c.cause.drifting for c in chosen):
        data = replace(data, drifting=data.plain)
    bodies = propose_added_mass(reference, data, _SPACING * size(reference.structure))
    joint: JointHypothesis[Cause] = JointHypothesis(bodies, chosen)
    rows, n_own = np.arange(len(bodies.position)), len(bodies.prior_std)
    theta = np.concatenate([np.zeros(n_own), *(c.theta for c in chosen)])
    fitted = slice(n_own, len(theta) - n_held)
    at = evaluate(data, joint, theta[None], rows[:1])
    n_data = at.residual.shape[1] - len(theta)
    kept = np.r_[:n_data, n_data + fitted.start : n_data + fitted.stop]  # the data, and the priors of fitted parameters
    slope = slopes(data, joint, at, rows[:1], range(n_own, len(theta)))[0, kept]
    by_fitted, by_held = slope[:, : fitted.stop - n_own], slope[:, fitted.stop - n_own :]
    by_mass = slopes(data, joint, at.rows(np.zeros(len(rows), np.intp)), rows, range(1))[:, kept, 0]
    covariance = np.linalg.inv(by_fitted.T @ by_fitted)
    rest = at.residual[0, kept]

    def follow(by_error: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how parameters follow a unit of each error (n, k), and what remains of it in the residuals."""
        parameters = -by_error.T @ by_fitted @ covariance
        return parameters, by_error + by_fitted @ parameters.T

    by_body, left = follow(by_mass.T)
    std = reference.model.total_mass() * np.geomspace(_SMALLEST, _LARGEST, _ORDERS)
    variance = 1 / ((left**2).sum(0)[:, None] + std**-2.0)
    mean = -variance * (rest @ left)[:, None]
    log_weight = bodies.log_prior[:, None] + 0.5 * (np.log(variance / std**2) + mean**2 / variance)
    weight = np.exp(log_weight - logsumexp(log_weight))
    of_bodies = (by_body.T * (weight * (variance + mean**2)).sum(1)) @ by_body
    by_file, left = follow(by_held)
    held = np.linalg.inv(left.T @ left + np.diag(joint.prior_std[fitted.stop :] ** -2.0))
    moved = held @ left.T @ rest
    return covariance, of_bodies + by_file.T @ (held + np.outer(moved, moved)) @ by_file

"""Mass of a removed body that the model never had.

The reference was measured with the body on, and the model was calibrated to its frequencies without the body's mass.
The change that took place is the removal of the body's mass M from the structure with it. Taking a mass m off the model
is another change. For one mode of modal displacement phi the frequency ratios are sqrt(1 + M phi^2) and
1 / sqrt(1 - m phi^2), so that m is smaller than M by the share M phi^2 of the modal mass. Modes that mix add as much.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment, minimize_scalar

from daq import FloatArray, IndexArray

_MAX_ITERATIONS = 60  # until the loaded structure has the reference's frequencies
_CONVERGED = 1e-8  # of a frequency
_NEGLIGIBLE = 1e-4  # of a mode's mass
_MAX_RATIO = 3.0  # of the body's mass to the mass taken off the model
_STEP = 0.05  # between ratios that are tried


def mass_outside_model(
    mass: float, gram: FloatArray, omega: FloatArray, paired: IndexArray, whitener: FloatArray
) -> float:
    """Return the mass [kg] of a body whose removal has the same effect as removing `mass` from the model.

    Parameters
    ----------
    mass : that is taken off the model, positive [kg]
    gram : (n_modes, n_modes) modal mass of 1 kg at the place [1/kg]
    omega : (n_modes,) of the reference [rad/s]
    paired : (n,) modes that are compared
    whitener : (k, n) of log frequencies
    """
    if mass * np.diag(gram)[paired].max() < _NEGLIGIBLE:
        return mass
    identity = np.eye(len(omega))
    target = np.log(_omega(identity - mass * gram, omega) / omega)[paired]

    def misfit(ratio: float) -> float:
        bare = omega.copy()  # frequencies of the structure without the body; with the body they are the reference's
        for _ in range(_MAX_ITERATIONS):
            step = omega / _omega(identity + ratio * mass * gram, bare)
            bare *= step
            if np.abs(step - 1).max() < _CONVERGED:
                return float(((whitener @ (np.log(bare / omega)[paired] - target)) ** 2).sum())
        return np.inf

    # the first minimum: farther ones are of modes that have changed places
    ratios = np.arange(1.0, _MAX_RATIO + _STEP, _STEP)
    best, least = 1.0, misfit(1.0)
    for ratio in ratios[1:]:
        found = misfit(ratio)
        if not found < least:
            break
        best, least = float(ratio), found
    bounds = (max(best - _STEP, 1.0), best + _STEP)
    return mass * float(minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": _STEP / 100}).x)


def _omega(modal_mass: FloatArray, omega: FloatArray) -> FloatArray:
    """Return the angular frequencies (n_modes,) of modes that move to a modal mass, each as the one it resembles."""
    value, vector = np.linalg.eigh(modal_mass / np.outer(omega, omega))
    order = linear_sum_assignment(vector**2, maximize=True)[1]
    return np.asarray(np.maximum(value[order], np.finfo(float).tiny) ** -0.5)

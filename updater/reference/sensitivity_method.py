"""The iterative sensitivity method, the paper's alternative to one step: parameters until model and measurement agree.

Whitened residuals r(x) and a prior, which regularises: parameters without information keep their values. The cost
|r(x)|^2 + |(x - x0) / s|^2 is reduced by Gauss-Newton steps in a trust region, inside bounds, with exact sensitivities.

References
----------
Friswell, M. I. & Mottershead, J. E. (1995). Finite Element Model Updating in Structural Dynamics, ch. 8.
Fox, R. L. & Kapoor, M. P. (1968). Rates of change of eigenvalues and eigenvectors. AIAA Journal 6(12), 2426-2429.
"""

from dataclasses import dataclass
from typing import Literal, Protocol, get_args

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from daq import FloatArray

#: why an iteration ended, the first five by the status of `scipy.optimize.least_squares`
Convergence = Literal[
    "iteration_limit", "no_lower_cost", "cost_converged", "parameters_converged", "both_converged", "no_parameters"
]
_ENOUGH = 1e-6  # of the cost: an iteration that gains less is the last


class Problem(Protocol):
    """Data to be explained."""

    def residual(self, x: FloatArray) -> FloatArray:
        """Return whitened residuals (n_data,) at parameters (n,)."""
        ...

    def slope(self, x: FloatArray) -> FloatArray:
        """Return their derivatives (n_data, n)."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Prior:
    """Prior of parameters (n,)."""

    mean: FloatArray  #: mean of the prior
    std: FloatArray
    lower: FloatArray
    upper: FloatArray
    start: FloatArray  #: start of the iteration


@dataclass(frozen=True, eq=False, kw_only=True)
class SensitivityFit:
    """Parameters after the last iteration."""

    value: FloatArray  #: (n,)
    std: FloatArray  #: (n,) of noise and prior, where no bound holds
    at_bound: npt.NDArray[np.bool_]  #: (n,) parameters that a bound holds
    chi_square: float  #: chi-square of data and prior
    log_evidence: float  #: Laplace's, of the parameters that no bound holds; up to the data's own constant
    iterations: int  #: models solved on the way
    reason: Convergence  #: why it ended

    @property
    def converged(self) -> bool:
        """True if a minimum was reached."""
        return self.reason != "iteration_limit"


def fit_parameters(problem: Problem, prior: Prior, *, most: int = 200) -> SensitivityFit:
    """Iterate from the prior's start to the nearest minimum.

    Parameters
    ----------
    problem : with exact sensitivities; a minimum is local, so start near
    prior : regularises; bounds may be infinite
    most : iterations
    """
    if not len(prior.mean):
        return _without_parameters(problem)
    regular = np.diag(1 / prior.std)

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([problem.residual(x), (x - prior.mean) / prior.std])

    def jacobian(x: FloatArray) -> FloatArray:
        return np.vstack([problem.slope(x), regular])

    bounds = prior.lower, prior.upper
    found = least_squares(
        residual, prior.start, jac=jacobian, bounds=bounds, x_scale=prior.std, ftol=_ENOUGH, max_nfev=most
    )
    slope = np.asarray(found.jac)
    normal = slope.T @ slope
    free = found.active_mask == 0
    log_det = np.linalg.slogdet(normal[np.ix_(free, free)])[1]
    return SensitivityFit(
        value=found.x,
        std=np.sqrt(np.diag(np.linalg.inv(normal))),
        at_bound=~free,
        chi_square=2 * float(found.cost),
        log_evidence=float(-found.cost - 0.5 * log_det - np.log(prior.std[free]).sum()),
        iterations=int(found.nfev),
        reason=get_args(Convergence)[found.status],
    )


def _without_parameters(problem: Problem) -> SensitivityFit:
    """Return the result where nothing may be updated."""
    none = np.empty(0)
    cost = float((problem.residual(none) ** 2).sum())
    return SensitivityFit(
        value=none,
        std=none,
        at_bound=np.empty(0, bool),
        chi_square=cost,
        log_evidence=-cost / 2,
        iterations=1,
        reason="no_parameters",
    )


def frequency_slope(omega: FloatArray, shape: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Return d ln omega (n_modes,) by a parameter of the stiffness alone, d omega^2 = b^T dK b.

    Parameters
    ----------
    omega : (n_modes,) [rad/s]
    shape : (n_dofs, n_modes) mass-normalised b
    stiffness : (n_dofs, n_modes) dK b
    """
    return np.asarray((shape * stiffness).sum(0) / (2 * omega**2))

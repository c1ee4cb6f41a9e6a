"""The iterative sensitivity method, the paper's alternative to one step: parameters until model and measurement agree.

Whitened residuals r(x) and a prior, which regularises: parameters without information keep their values. The cost
|r(x)|^2 + |(x - x0) / s|^2 is reduced by Gauss-Newton steps with exact sensitivities; a parameter that would leave its
bounds stays at the bound, and a step that raises the cost is tried again with Levenberg's damping. The damping follows
the ratio of the cost's reduction to the expected one.

References
----------
Friswell, M. I. & Mottershead, J. E. (1995). Finite Element Model Updating in Structural Dynamics, ch. 8.
Fox, R. L. & Kapoor, M. P. (1968). Rates of change of eigenvalues and eigenvectors. AIAA Journal 6(12), 2426-2429.
Fletcher, R. (1971). A modified Marquardt subroutine for non-linear least squares. AERE-R 6799, Harwell.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from daq import FloatArray

#: why the iteration ended
Convergence = Literal["iteration_limit", "no_lower_cost", "cost_converged", "no_parameters"]

_ENOUGH = 1e-6  # of the cost: a step that is expected to gain less is not taken
# of chi-square: a damped step that is expected to gain less, or 0.03 standard deviations, is not taken
_SLIGHT = 1e-3
_DAMPING = 1e-3  # first damping after a step that failed, over the diagonal of the normal matrix
_FACTOR = 10.0  # of the damping after each further one
_AS_EXPECTED, _LESS = 0.75, 0.25  # of the expected reduction, from which on the damping falls, and under which it rises
_LEAST_FREE = 1e-6  # smallest 1 - leverage of a datum


class Problem(Protocol):
    """Data to be explained."""

    def residual(self, x: FloatArray) -> FloatArray:
        """Return whitened residuals (n_data,) at parameters (n,)."""

    def slope(self, x: FloatArray) -> FloatArray:
        """Return their derivatives (n_data, n)."""


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
    left_out: FloatArray  #: (n_data,) whitened residuals, each as if it alone were not fitted, to first order
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

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([problem.residual(x), (x - prior.mean) / prior.std])

    def slopes(x: FloatArray) -> FloatArray:
        return np.vstack([problem.slope(x), np.diag(1 / prior.std)])

    x = prior.start
    now, slope = residual(x), slopes(x)
    damping = 0.0
    reason: Convergence = "iteration_limit"
    for iterations in range(1, most + 1):  # noqa: B007 - the number is part of the result
        step = _bounded_step(slope, now, prior.lower - x, prior.upper - x, damping)
        expected = now @ now - ((now + slope @ step) ** 2).sum()
        if expected <= max(_ENOUGH * (now @ now), _SLIGHT if damping else 0.0):
            reason = "cost_converged" if damping < 1 else "no_lower_cost"
            break
        tried = residual(x + step)
        if tried @ tried < now @ now:
            gained = (now @ now - tried @ tried) / expected
            x, now = x + step, tried
            slope, damping = slopes(x), _next_damping(damping, float(gained))
        else:
            damping = max(_FACTOR * damping, _DAMPING)
    normal = slope.T @ slope
    gradient = slope.T @ now
    at_bound = ((x <= prior.lower) & (gradient > 0)) | ((x >= prior.upper) & (gradient < 0))
    free = ~at_bound
    log_det = np.linalg.slogdet(normal[np.ix_(free, free)])[1]
    cost = float(now @ now) / 2
    rest = now + slope @ _bounded_step(slope, now, prior.lower - x, prior.upper - x, 0.0)  # at the minimum
    return SensitivityFit(
        value=x,
        std=np.sqrt(np.diag(np.linalg.inv(normal))),
        at_bound=at_bound,
        chi_square=2 * cost,
        log_evidence=float(-cost - 0.5 * log_det - np.log(prior.std[free]).sum()),
        left_out=_left_out(rest[: -len(x)], slope[: -len(x), free], normal[np.ix_(free, free)]),
        iterations=iterations,
        reason=reason,
    )


def _next_damping(damping: float, gained: float) -> float:
    """Return the damping after a step that has reduced the cost by a share of what was expected."""
    if gained < _LESS:
        return max(_FACTOR * damping, _DAMPING)
    if gained < _AS_EXPECTED:
        return damping
    return damping / _FACTOR if damping > _DAMPING else 0.0


def _bounded_step(
    slope: FloatArray, residual: FloatArray, lower: FloatArray, upper: FloatArray, damping: float
) -> FloatArray:
    """Return the Gauss-Newton step (n,) that is best within bounds of the step, damped by Levenberg's method."""
    damped = np.diag(np.sqrt(damping * (slope**2).sum(0)))
    problem = np.vstack([slope, damped]), -np.append(residual, np.zeros(len(lower)))
    return np.asarray(lsq_linear(*problem, bounds=(lower, upper), method="bvls", tol=1e-12).x)


def _left_out(residual: FloatArray, slope: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the residuals r / (1 - h) of data that are left out, h their leverage (Allen 1974, Technometrics 16).

    Parameters
    ----------
    residual : (n_data,) whitened, of the best fit to all data
    slope : (n_data, n) of the parameters that no bound holds
    normal : (n, n) normal matrix of these, with their prior
    """
    leverage = np.einsum("ij,ji->i", slope, np.linalg.solve(normal, slope.T))
    return np.asarray(residual / np.maximum(1 - leverage, _LEAST_FREE))


def _without_parameters(problem: Problem) -> SensitivityFit:
    """Return the result where nothing may be updated."""
    none = np.empty(0)
    residual = problem.residual(none)
    cost = float(residual @ residual)
    return SensitivityFit(
        value=none,
        std=none,
        at_bound=np.empty(0, bool),
        chi_square=cost,
        log_evidence=-cost / 2,
        left_out=residual,
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

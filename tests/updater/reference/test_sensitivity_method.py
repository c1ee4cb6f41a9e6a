"""The iterative sensitivity method: against closed forms, and on a structure that is not the model's."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.frames import t_frame, unmoved
from tests.support.updater.one_step import Rig
from updater import Body, calibrate, mean_modes, stack_tracks
from updater.localization import spread_mass
from updater.reference import Prior, best_model, fit_parameters
from updater.reference.calibration import _Misfit
from updater.reference.sensitivity_method import frequency_slope
from updater.structure import model_parameters_of


class Linear:
    """A x = b with unit noise."""

    def __init__(self, matrix: FloatArray, goal: FloatArray) -> None:
        self.matrix, self.goal = matrix, goal

    def residual(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.matrix @ x - self.goal)

    def slope(self, x: FloatArray) -> FloatArray:
        return self.matrix


def prior(n: int, std: float, *, lower: float = -np.inf, start: float = 0.1) -> Prior:
    return Prior(
        mean=np.zeros(n),
        std=np.full(n, std),
        lower=np.full(n, lower),
        upper=np.full(n, np.inf),
        start=np.full(n, start),
    )


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig(3)


@pytest.mark.parametrize("seed", range(3))
def test_linear_problem_has_the_gaussian_posterior(seed: int) -> None:
    """Mean, deviations and the ratio of evidences of two priors, in closed form, to 1e-6 of the cost."""
    random = np.random.default_rng(seed)
    matrix, goal = random.standard_normal((5, 9)), 3 * random.standard_normal(5)
    found = {std: fit_parameters(Linear(matrix, goal), prior(9, std)) for std in (0.5, 2.0)}
    covariance = np.linalg.inv(matrix.T @ matrix + np.eye(9) / 4)
    np.testing.assert_allclose(found[2.0].value, covariance @ matrix.T @ goal, atol=1e-6)
    np.testing.assert_allclose(found[2.0].std, np.sqrt(np.diag(covariance)), rtol=1e-9)
    marginal = {s: multivariate_normal.logpdf(goal, cov=np.eye(5) + s**2 * matrix @ matrix.T) for s in found}
    gain = found[2.0].log_evidence - found[0.5].log_evidence
    assert gain == pytest.approx(marginal[2.0] - marginal[0.5], abs=1e-5)
    assert found[2.0].converged


def test_residual_of_a_datum_that_is_left_out_is_that_of_a_fit_without_it() -> None:
    """Of a linear problem with a prior exactly; the fit to all data has far smaller residuals."""
    random = np.random.default_rng(7)
    matrix, goal = random.standard_normal((6, 9)), 3 * random.standard_normal(6)
    found = fit_parameters(Linear(matrix, goal), prior(9, 2.0))
    for i, left_out in enumerate(found.left_out):
        others = np.delete(matrix, i, axis=0), np.delete(goal, i)
        value = fit_parameters(Linear(*others), prior(9, 2.0)).value
        assert left_out == pytest.approx(matrix[i] @ value - goal[i], rel=1e-5)
    assert np.abs(matrix @ found.value - goal).max() < 0.3 * np.abs(found.left_out).max()


def test_damped_steps_end_when_they_gain_nothing() -> None:
    """A curved valley with large residuals, in which Gauss-Newton steps go too far: within 1e-3 of the least cost."""

    class Curved(Linear):
        def residual(self, x: FloatArray) -> FloatArray:
            return np.array([5 + 10 * (x[1] - x[0] ** 2), 4 - x[0], 4 + 0.1 * x[0] * x[1]])

        def slope(self, x: FloatArray) -> FloatArray:
            return np.array([[-20 * x[0], 10.0], [-1.0, 0.0], [0.1 * x[1], 0.1 * x[0]]])

    found = fit_parameters(Curved(np.eye(2), np.zeros(2)), prior(2, 10.0, start=-1.2))
    problem = Curved(np.eye(2), np.zeros(2))

    def cost(x: FloatArray) -> float:
        return float((problem.residual(x) ** 2).sum() + (x**2).sum() / 100)

    least = minimize(cost, found.value, tol=1e-10).fun
    print(found.iterations, found.chi_square, least)
    assert found.chi_square < least + 1e-3
    assert found.iterations < 50  # 58 with a damping that falls after every step, and no end before 1e-6 of the cost


def test_parameter_is_limited_by_its_bound_and_reported() -> None:
    found = fit_parameters(Linear(np.eye(2), np.array([3.0, -3.0])), prior(2, 1e3, lower=-1.0))
    np.testing.assert_allclose(found.value, [3.0, -1.0], atol=1e-3)
    assert found.at_bound.tolist() == [False, True]


def test_missing_convergence_is_reported() -> None:
    class Valley(Linear):
        """Rosenbrock's."""

        def residual(self, x: FloatArray) -> FloatArray:
            return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

        def slope(self, x: FloatArray) -> FloatArray:
            return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])

    problem = Valley(np.eye(2), np.zeros(2))
    assert not fit_parameters(problem, prior(2, 1e6, start=-1.2), most=3).converged
    found = fit_parameters(problem, prior(2, 1e6, start=-1.2))
    assert found.converged
    np.testing.assert_allclose(found.value, 1, atol=1e-3)


def test_frequency_slope_with_respect_to_modulus_is_one_half() -> None:
    """E doubled is K doubled: d ln omega / d ln E is a half for all, exactly."""
    model = best_model(t_frame())
    modes = model.modes(8)
    slope = frequency_slope(modes.omega, modes.shape, model.stiffness @ modes.shape)
    np.testing.assert_allclose(slope, 0.5, rtol=1e-8)


def test_calibration_slope_matches_finite_differences(rig: Rig) -> None:
    """Central differences of a thousandth: (1e-3)^2 of curvatures of a few times the slope."""
    knobs = model_parameters_of(t_frame())
    baseline = rig.reference.baseline
    no_mesh = np.zeros(len(baseline.log_frequency))
    problem = _Misfit(t_frame(), knobs, baseline, no_mesh, [], int(rig.reference.paired.max()) + 1)
    x = np.array([0.02, *np.full(len(knobs) - 1, 0.01)])
    slope, step = problem.slope(x), 1e-3 * np.array([1.0, *np.full(len(knobs) - 1, 0.01)])
    for i in range(len(knobs)):
        ahead, behind = x.copy(), x.copy()
        ahead[i] += step[i]
        behind[i] -= step[i]
        difference = (problem.residual(ahead) - problem.residual(behind)) / (2 * step[i])
        np.testing.assert_allclose(slope[:, i], difference, rtol=1e-5, atol=1e-5 * np.abs(slope[:, i]).max())


@pytest.mark.parametrize("seed", few_of([4, 5]))
def test_calibrated_frequencies_are_within_the_model_error(seed: int) -> None:
    """Seven parameters with priors, eight frequencies of a frame of another kind: 0.2 % is allowed for the model."""
    truth = Rig(seed).truth
    model = truth.model()
    windows = truth.windows(model.modes(8), model.sensor_rows, 4, 1, noise=1e-3)
    found = calibrate(t_frame(), mean_modes(stack_tracks(windows, unmoved(4))))
    error = found.modes.frequency[found.paired] / model.modes(8).frequency - 1
    before = found.nominal_frequency / model.modes(8).frequency - 1
    print(found.reason, np.abs(error).max(), np.abs(before).max())
    assert np.abs(error).max() < 2e-3
    assert np.abs(error).max() < 0.3 * np.abs(before).max()
    assert found.reason != "iteration_limit"
    steel, true = found.structure.material["steel"], truth.structure.material["steel"]
    ratio = (steel.youngs_modulus / steel.density) / (true.youngs_modulus / true.density)
    assert ratio == pytest.approx(1, abs=4 * found.parameters[0].std)


def test_unchanged_data_give_no_spread_mass(rig: Rig) -> None:
    assert np.abs(spread_mass(rig.reference, rig.reference.baseline).mass).max() < 1e-6


@pytest.mark.parametrize(
    "body",
    [Body(at=(0.25, 0, 1.48), mass=0.304), Body(at=(0, 0, 0.92), mass=0.152)],
    ids=["location 1", "location 2"],
)
def test_spread_mass_lies_around_the_true_position(rig: Rig, body: Body) -> None:
    """Ill-posed as it is, the largest node lies within 0.2 m; the sum, which frequencies carry, within a fifth."""
    modes = rig.truth.model(body).modes(8)
    event = rig.reference.mean_of(stack_tracks(rig.windows(modes, 4, 2), unmoved(4)))
    found = spread_mass(rig.reference, event)
    place = rig.reference.model.nodes[found.node[np.argmax(found.mass)]]
    print(found.mass.sum(), place, found.prior_std, found.iterations, found.reason)
    assert np.linalg.norm(place - body.at) < 0.2
    assert found.mass.sum() == pytest.approx(body.mass, rel=0.2)
    assert found.reason == "cost_converged"
    assert not len(found.at_bound)
    assert found.mass.max() < 0.5 * body.mass  # it cannot say that it is one body


def test_removed_mass_is_limited_by_the_nodal_mass(rig: Rig) -> None:
    """Frequencies as of a tenth of the frame taken off its ends: bounds hold nodes there."""
    base = rig.reference.baseline
    found = spread_mass(rig.reference, replace(base, log_frequency=base.log_frequency + np.linspace(0.05, 0.3, 8)))
    own = 3.292 * 0.05  # kg, a node of the crossbeam; the joint's has more
    assert len(found.at_bound)
    assert found.mass.min() > -2 * own

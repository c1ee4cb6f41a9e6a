"""Gauss-Newton within bounds, on linear residuals with bounded least squares by scipy."""

import sys
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from daq import FloatArray, IndexArray
from updater.inference import fit
from updater.inference.laplace_fit import Point, _adopt, _newton, normal

PRIOR = np.array([10.0, 20.0, 5.0])
# the second parameter makes up for the first: without bounds it is far off
A = np.array([[1.0, 1.0, 0.0], [0.9, 1.0, 0.2], [1.0, 0.8, -0.3], [0.1, 0.3, 1.0], [0.0, 0.2, 0.4]])


@dataclass(frozen=True, eq=False)
class Linear:
    """Alternatives (n,) with residuals A theta - b, and priors."""

    b: FloatArray  # (n, n_data)
    lower: FloatArray  # (n, 3)
    start: FloatArray  # (n, 3)
    prior_std: FloatArray
    drifting: bool = False

    @property
    def log_prior(self) -> FloatArray:
        return np.full(len(self.b), -np.log(len(self.b)))

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        del rows
        return np.zeros(len(theta))

    def refined(self, log_density: FloatArray, theta: FloatArray) -> None:
        return None


@pytest.fixture
def linear(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Replace the residuals of a structure by linear ones; return the measured data."""
    module = sys.modules["updater.inference.laplace_fit"]

    def evaluate(_: object, h: Linear, theta: FloatArray, rows: IndexArray) -> Point:
        residual = np.concatenate([theta @ A.T - h.b[rows], theta / h.prior_std], axis=1)
        effect = SimpleNamespace(own=np.zeros((len(rows), 0)))
        return Point(theta.copy(), effect, SimpleNamespace(), residual)  # type: ignore[arg-type]

    def slopes(_: object, h: Linear, point: Point, rows: IndexArray) -> FloatArray:
        return np.tile(np.vstack([A, np.diag(1 / h.prior_std)]), (len(rows), 1, 1))

    monkeypatch.setattr(module, "evaluate", evaluate)
    monkeypatch.setattr(module, "slopes", slopes)
    return SimpleNamespace(
        log_det_of_frequencies=lambda drifting: 0.0, freedom=5.0, freedom_of_new=lambda n: 0.0, log_ratio=np.zeros(2)
    )


def best(b: FloatArray, lower: FloatArray) -> FloatArray:
    """Return the least squares of data and priors under the bounds."""
    whole = np.vstack([A, np.diag(1 / PRIOR)])
    return np.asarray(lsq_linear(whole, np.append(b, np.zeros(3)), (lower, np.inf), tol=1e-12).x)


@pytest.mark.parametrize("seed", range(4))
def test_fit_without_bounds_equals_least_squares(linear: Any, seed: int) -> None:
    b = np.random.default_rng(seed).normal(0.0, 3.0, (5, 5))
    found = fit(linear, Linear(b, np.full((5, 3), -1e9), np.zeros((5, 3)), PRIOR))  # type: ignore[type-var]
    for theta, one in zip(found.theta, b, strict=True):
        assert theta == pytest.approx(best(one, np.full(3, -np.inf)), abs=1e-6)
    whole = np.vstack([A, np.diag(1 / PRIOR)])
    np.testing.assert_allclose(found.covariance[0], np.linalg.inv(whole.T @ whole), rtol=1e-9)
    evidence = -0.5 * found.chi_square + 0.5 * np.linalg.slogdet(found.covariance[0])[1] - np.log(PRIOR).sum()
    np.testing.assert_allclose(found.log_density, evidence, rtol=1e-9)
    assert found.best == int(np.argmax(evidence))
    assert found.freedom == pytest.approx(5.0 - np.trace(A @ found.covariance[0] @ A.T))
    np.testing.assert_allclose(found.frequency_residual, found.theta @ A[:2].T - b[:, :2], atol=1e-9)


@pytest.mark.parametrize("scale", [1.0, 50.0])
def test_parameter_at_its_bound_does_not_bias_the_others(
    linear: Any, scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Data that require a parameter below its bound, along it and off it: a step that is cut there fits worse.

    Also where all parameters, and so all steps, are less than one.
    """
    monkeypatch.setattr(sys.modules[__name__], "A", scale * A)
    monkeypatch.setattr(sys.modules[__name__], "PRIOR", PRIOR / scale)
    free = np.array([[-8.0, 9.0, 1.0], [-20.0, 19.0, -2.0]]) / scale
    b = free @ A.T
    lower = np.array([[0.0, -1e9, -1e9], [-0.5 / scale, -1e9, -1e9]])
    found = fit(linear, Linear(b, lower, np.zeros((2, 3)), PRIOR))  # type: ignore[type-var]
    for theta, one, least in zip(found.theta, b, lower, strict=True):
        expected = best(one, least)
        whole = np.vstack([A, np.diag(1 / PRIOR)])
        cost = np.sum((whole @ expected - np.append(one, np.zeros(3))) ** 2)
        reached = np.sum((whole @ theta - np.append(one, np.zeros(3))) ** 2)
        print(theta, expected, reached - cost)
        assert np.all(theta >= least)
        assert reached - cost < 0.2  # of chi-square: a tenth of the evidence


def test_step_without_predicted_gain_is_not_evaluated(linear: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Alternatives that begin at their best, free or at a bound, are evaluated once: there are no steps to try."""
    b = np.random.default_rng(9).normal(0.0, 3.0, (4, 5))
    lower = np.array([[-np.inf] * 3, [0.0] * 3, [-np.inf, 0.0, -np.inf], [-np.inf] * 3])
    start = np.array([best(one, least) for one, least in zip(b, lower, strict=True)])
    module = sys.modules["updater.inference.laplace_fit"]
    evaluate, rows_evaluated = module.evaluate, []

    def counted(comparison: object, h: Linear, theta: FloatArray, rows: IndexArray) -> Point:
        rows_evaluated.append(len(rows))
        point: Point = evaluate(comparison, h, theta, rows)
        return point

    monkeypatch.setattr(module, "evaluate", counted)
    alternatives = Linear(b, lower, np.zeros((4, 3)), PRIOR)
    cold = fit(linear, alternatives)  # type: ignore[type-var]
    assert len(rows_evaluated) > 1
    rows_evaluated.clear()
    found = fit(linear, alternatives, start=start)  # type: ignore[type-var]
    assert rows_evaluated == [4]
    np.testing.assert_allclose(found.theta, start, rtol=0, atol=0)
    # chi-square of the cold fit: its last step may leave what is not evaluated
    np.testing.assert_allclose(found.log_density, cold.log_density, rtol=0, atol=0.1)


def test_evidence_includes_the_determinant_of_the_used_whitener(linear: Any) -> None:
    """A drift common to all frequencies is allowed, or not: two covariances of the same data."""
    linear.log_det_of_frequencies = lambda drifting: -0.7 if drifting else 1.5
    one = Linear(b=np.ones((1, 5)), lower=np.full((1, 3), -np.inf), start=np.zeros((1, 3)), prior_std=PRIOR)
    density = [fit(linear, replace(one, drifting=drifting)).log_density[0] for drifting in (False, True)]  # type: ignore[type-var]
    assert density[0] - density[1] == pytest.approx(2.2)
    whole = np.eye(5) + A @ np.diag(PRIOR**2) @ A.T  # covariance of the data under the prior
    exact = -0.5 * np.linalg.slogdet(whole)[1] - 0.5 * np.ones(5) @ np.linalg.solve(whole, np.ones(5))
    assert density[0] == pytest.approx(exact + 1.5)


def test_left_out_alternatives_have_zero_probability(linear: Any) -> None:
    b = np.random.default_rng(5).standard_normal((3, 5))
    found = fit(linear, Linear(b=b, lower=np.full((3, 3), -np.inf), start=np.zeros((3, 3)), prior_std=PRIOR))  # type: ignore[type-var]
    some = found.only(np.array([True, False, True]))
    assert some.probability[1] == 0
    assert some.probability[[0, 2]] == pytest.approx(found.probability[[0, 2]] / found.probability[[0, 2]].sum())
    assert some.best != 1


def test_effect_whose_rows_change_in_a_fit_is_refused() -> None:
    """A row per alternative that comes later would not be taken over."""
    theta, cost = np.zeros((2, 1)), np.ones((2, 1))
    first = Point(theta.copy(), SimpleNamespace(mass=np.zeros((1, 3))), SimpleNamespace(), cost)  # type: ignore[arg-type]
    later = Point(theta + 1, SimpleNamespace(mass=np.ones((2, 3))), SimpleNamespace(), 0 * cost)  # type: ignore[arg-type]
    both = np.arange(2), np.ones(2, bool)
    with pytest.raises(ValueError, match=r"Effect\.mass: expected 1 rows, as at the start of the fit, found 2"):
        _adopt(first, later, *both)
    with pytest.raises(ValueError, match=r"Effect\.mass: expected 2 rows, as at the start of the fit, found 1"):
        _adopt(later, first, *both)


@pytest.mark.parametrize("seed", range(3))
def test_step_within_bounds_equals_bounded_least_squares(seed: int) -> None:
    """Of 12 correlated parameters, some at their bound, of which a clipped step may leave the minimum."""
    random = np.random.default_rng(seed)
    slope = random.normal(size=(40, 20, 3)) @ random.normal(size=(40, 3, 12)) + 0.1 * random.normal(size=(40, 20, 12))
    residual = 3 * random.normal(size=(40, 20))
    room = np.where(random.uniform(size=(40, 12)) < 0.3, np.inf, np.maximum(random.normal(size=(40, 12)), 0.0))
    step, promised = _newton(slope, residual, room)
    for k in range(40):
        closed = lsq_linear(slope[k], residual[k], (-np.inf, room[k]), tol=1e-14, max_iter=1000)
        assert promised[k] == pytest.approx(residual[k] @ residual[k] - 2 * closed.cost, abs=1e-6)
        assert step[k] == pytest.approx(closed.x, abs=1e-4)


def test_normal_matrix_of_parallel_derivatives_is_not_singular() -> None:
    """Far larger than those of the priors, which rounding loses: powers of two, of which differences are exactly 0."""
    parallel = 2.0**36 * np.outer(2.0 ** np.arange(5), 2.0 ** np.arange(4))
    slope = np.concatenate([parallel, np.eye(4)])[None]
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.solve(slope.transpose(0, 2, 1) @ slope, np.ones((1, 4, 1)))
    assert np.isfinite(np.linalg.solve(normal(slope), np.ones((1, 4, 1)))).all()

"""Changes of feet, bearings and joints: alternatives, starts, priors, stated deviations and coverage."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from monitor.text.causes import change_texts
from tests.examiner.designs import DESIGNS
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import Reference, learn_reference, nominal_reference
from updater.causes import CATALOGUE, CONNECTIONS, JointHypothesis, SelectedCause, prediction
from updater.causes.stiffness.connections import Springs
from updater.fe import build_model
from updater.inference import Comparison, Fit, compare, fit
from updater.structure import AXES, Axis, Joint, Support, all_knobs, flexibility_unit

TURNS: tuple[Axis, Axis, Axis] = ("rx", "ry", "rz")


@cache
def learnt(design: str) -> tuple[Reference, Comparison]:
    """Return a reference with the model's own modes, and no change since, by frequencies alone."""
    state = DESIGNS[design].draw(40)
    before = observation(state, estimated(state, 8, np.random.default_rng(40), noise="law"))
    found = learn_reference(structure_of(f"{design}: "), before.estimates, before.tracks, before.lateness.delays)
    modes = found.calibration.modes
    reference = replace(found, frequency=modes.frequency, shape=modes.shape)
    data = compare(reference, reference.baseline)
    silent: dict[str, Any] = {
        name: np.zeros_like(getattr(data, name)) for name in ("shape_whitener", "imaginary_whitener", "damping_weight")
    }
    return reference, replace(data, base=data.model_base, log_ratio=np.zeros_like(data.log_ratio), **silent)


def springs(design: str, name: str, log_ratio: float = 0.0) -> tuple[Reference, Springs]:
    reference, data = learnt(design)
    cause = CATALOGUE[name].propose(reference, replace(data, log_ratio=data.log_ratio + log_ratio))
    assert isinstance(cause, Springs)
    return reference, cause


def spring(connection: Support | Joint, axis: Axis) -> float:
    return dict[Axis, float](connection.stiffness.items())[axis]


def of_rows(cause: Springs, rows: list[int]) -> Springs:
    """Return some of the alternatives."""
    arrays: dict[str, Any] = {
        n: getattr(cause, n)[rows] for n in ("lower", "active", "before_std", "rigid", "unit", "couple", "begun")
    }
    picked: dict[str, Any] = {n: tuple(getattr(cause, n)[row] for row in rows) for n in ("connections", "axes")}
    return replace(cause, **arrays, **picked)


EVERY = [("bridge", "support_stiffness"), ("portal", "joint_stiffness"), ("portal", "support_stiffness")]


@pytest.mark.parametrize(("design", "name"), EVERY)
def test_every_spring_set_of_a_connection_has_two_starts(design: str, name: str) -> None:
    """Springs that turn and springs that slide are alternatives of their own; nothing that is held is one."""
    reference, cause = springs(design, name)
    expected = []
    for axes in (TURNS, ("x", "y", "z")) if name == "support_stiffness" else (TURNS,):
        for connection in CONNECTIONS[name](reference.structure):
            free = [axis in connection.stiffness for axis in axes]
            sets = [
                s for s in np.ndindex(2, 2, 2) if any(s) and all(f or not on for on, f in zip(s, free, strict=True))
            ]
            expected += [(connection.at, axes, tuple(map(bool, s))) for s in sets]
    half = len(cause.lower) // 2
    found = [
        (c.at, a, tuple(map(bool, o))) for c, a, o in zip(cause.connections, cause.axes, cause.active, strict=True)
    ]
    assert sorted(found[:half]) == sorted(expected)
    assert found[:half] == found[half:]
    for each in (cause.unit, cause.before_std, cause.couple, cause.lower):
        assert each.shape[:2] == (2 * half, 3)
        np.testing.assert_array_equal(each[:half], each[half:])
    assert not cause.start[:half].any()
    assert np.exp(cause.log_prior).sum() == pytest.approx(1)
    assert not cause.couple[~cause.active].any()


@pytest.mark.parametrize(("design", "name"), EVERY)
def test_a_spring_changes_once_in_an_answer_of_two_causes(design: str, name: str) -> None:
    """Two halves of one change would be two causes, each with a size that the structure does not have."""
    _, cause = springs(design, name)
    for row in range(len(cause.lower)):
        together = JointHypothesis(cause, (SelectedCause(cause, row, cause.begun[row]),))
        shared = [
            connection.at == cause.connections[row].at
            and axes == cause.axes[row]
            and bool((active & cause.active[row]).any())
            for connection, axes, active in zip(cause.connections, cause.axes, cause.active, strict=True)
        ]
        np.testing.assert_array_equal(np.isneginf(together.log_prior), shared)


@pytest.mark.parametrize(("design", "name"), EVERY)
def test_large_change_is_fitted_from_several_orders_too_and_each_alternative_then_once(design: str, name: str) -> None:
    """The prior's order follows the change; a usual change is not refined."""
    _, cause = springs(design, name)
    n, half = len(cause.lower), len(cause.lower) // 2
    row = int(np.argmax(cause.active.sum(1)))
    density = -10.0 * (np.arange(n) % half != row) - np.arange(n) / n
    assert cause.refined(density, np.where(cause.active, 1.9 * cause.prior_std, 0.0)) is None
    large = np.where(cause.active, 0.5, 0.0)
    refined = cause.refined(density, large)
    assert refined
    hinges = int(cause.active[:half].sum())
    assert len(refined.lower) == half + 4 * half + hinges
    np.testing.assert_array_equal(refined.begun[half:-hinges].max(1), np.repeat([0.1, 0.3, 1.0, 3.0], half))
    assert (refined.begun[-hinges:].max(1) == refined.prior_std[0]).all()
    np.testing.assert_array_equal(refined.active[:half], cause.active[:half])
    assert np.exp(refined.log_prior).sum() == pytest.approx(1)
    again = refined.rescaled(np.zeros(len(refined.lower)), np.where(refined.active, 0.5, 0.0))
    assert again
    assert len(again.lower) == half
    assert again.prior_std == pytest.approx(1.5)
    assert again.rescaled(np.zeros(half), np.where(again.active, 0.5, 0.0)) is None


@pytest.mark.parametrize(("design", "name"), EVERY)
def test_prior_std_is_a_loose_connection_and_flexibility_is_bounded(design: str, name: str) -> None:
    """Of a spring that turns a tenth of L / (E I), or its own flexibility; of one that slides ten times its own."""
    reference, cause = springs(design, name)
    for row, (connection, axes) in enumerate(zip(cause.connections, cause.axes, strict=True)):
        for a, axis in enumerate(axes):
            if not cause.active[row, a]:
                continue
            own, beam = 1 / spring(connection, axis), 1 / flexibility_unit(reference.structure, axis, connection.at)
            loose = max(0.1 * beam, own) if axis in TURNS else max(10 * own, 0.01 * beam)
            assert cause.prior_std[a] / cause.unit[row, a] == pytest.approx(loose)
            assert own + cause.lower[row, a] / cause.unit[row, a] == pytest.approx(1e-3 * own)
            expected = reference.calibration.flexibility_std(connection, axis)
            assert cause.before_std[row, a] == expected


@pytest.mark.parametrize(("design", "name"), few_of(EVERY, 2))
def test_fits_start_after_one_bounded_gauss_newton_step(design: str, name: str) -> None:
    """Slopes of the frequencies are those of the model with the springs of the extended structure."""
    reference, cause = springs(design, name, log_ratio=-2e-2)
    half, data = len(cause.lower) // 2, cause.comparison
    whitener = data.drifting.matrix
    for row in range(half):
        slope = np.zeros((3, len(data.log_ratio)))
        for a in np.flatnonzero(cause.active[row]).tolist():
            theta = np.zeros(3)
            theta[a] = 1e-4 * cause.unit[row, a] / spring(cause.connections[row], cause.axes[row][a])
            change = [
                np.log(build_model(cause.extend(reference.structure, row, s * theta)).modes(30).frequency)
                for s in (-1, 1)
            ]
            slope[a] = ((change[1] - change[0]) / (2 * theta[a]))[data.paired]
        white = slope @ whitener.T
        step = np.linalg.solve(white @ white.T + 100 * np.eye(3), white @ whitener @ data.log_ratio)
        own = np.where(cause.active[row], -cause.lower[row] / 0.999, 0.0)
        beam = cause.unit[row] / np.array(
            [flexibility_unit(reference.structure, axis, cause.connections[row].at) for axis in cause.axes[row]]
        )
        least = np.where(own > beam, beam - own, cause.lower[row])
        np.testing.assert_allclose(cause.start[half + row], np.maximum(step, least), rtol=0.03, atol=5e-4)


@pytest.mark.parametrize("mesh_error", [0.0, 0.02])
@pytest.mark.parametrize(("design", "name"), EVERY)
def test_stated_stiffness_deviation_follows_from_its_flexibilities(design: str, name: str, mesh_error: float) -> None:
    """Of 1 / (1 / before + change): the deviations of both, times the square of the stiffness.

    A mesh of faces has an error of four times that of its frequencies in the change. A change counts by t / (1 + t) of
    its flexibility t, in which the modes are nearly linear up to a hinge.
    """
    reference, cause = springs(design, name)
    data = cause.comparison
    shifted = replace(
        data, log_ratio=np.full_like(data.log_ratio, 0.01), mesh_error=np.full_like(data.mesh_error, mesh_error)
    )
    cause = replace(cause, comparison=shifted)
    row = int(np.argmax(cause.active.sum(1)))
    theta = np.where(cause.active, 0.9 * cause.prior_std, 0.0)
    by_data = np.array([0.01, 0.02, 0.03])
    covariance = np.tile(np.diag(1 / (by_data**-2 + cause.prior_std**-2)), (len(theta), 1, 1))
    density = np.where(np.arange(len(theta)) == row, 0.0, -1e3)
    cause = replace(cause, before_std=np.where(cause.active, 0.1 / cause.unit, 0.0))
    found: Fit[Any] = Fit(
        hypotheses=cause,
        theta=theta,
        covariance=covariance,
        chi_square=np.zeros(len(theta)),
        log_density=density,
        freedom=5.0,
        frequency_residual=np.zeros((len(theta), 5)),
    )
    assert found.best == row
    connection, axes = cause.connections[row], cause.axes[row]
    parameters, changes = cause.parameters(found), cause.changes(found)
    active = [axes[a] for a in np.flatnonzero(cause.active[row])]
    assert list(parameters) == [f"stiffness_{axis}" for axis in active]
    assert cause.deviations(found) == pytest.approx(max(0.09 * 1.09 / s for s in by_data[cause.active[row]]))
    for axis, (key, quantity) in zip(active, parameters.items(), strict=True):
        a = axes.index(axis)
        flexibility = 1 / spring(connection, axis) + theta[row, a] / cause.unit[row, a]
        assert quantity.value == pytest.approx(1 / flexibility)
        of_change = np.hypot(covariance[row, a, a] ** 0.5, 4 * mesh_error * theta[row, a])
        off = np.hypot(of_change, 0.1) / cause.unit[row, a]
        stiffer, softer = 1 / (flexibility - 1e-3 * off), 1 / (flexibility + 1e-3 * off)
        assert quantity.std == pytest.approx((stiffer - softer) / 2e-3, rel=1e-4)
        assert quantity.unit == ("N m/rad" if axis in TURNS else "N/m")
        (change,) = (c for c in changes if c.after == parameters[key].value)
        before = None if cause.rigid[row, a] else spring(connection, axis)
        assert (change.before, change.std, change.unit) == (before, quantity.std, quantity.unit)
        assert change.position == connection.at
        assert change.name in {knob.key for knob in all_knobs(reference.structure) if knob.axis == axis}
    where = cause.where(found)
    assert where.position == connection.at
    assert where.member == (connection.member if isinstance(connection, Joint) else None)
    extended = cause.extend(reference.structure, row, theta[row])
    (written,) = (
        c for c in CONNECTIONS[name](extended) if c.at == connection.at and getattr(c, "member", None) == where.member
    )
    for axis in active:
        assert spring(written, axis) == pytest.approx(parameters[f"stiffness_{axis}"].value)
    others = [c for c in CONNECTIONS[name](extended) if c is not written]
    assert all(c in CONNECTIONS[name](reference.structure) for c in others)
    small = replace(found, theta=np.where(cause.active, 0.019, 0.0))
    significant = [s for s in np.array([0.01, 0.02, 0.03])[cause.active[row]] if s * 2 < 0.019]
    assert len(cause.parameters(small)) == len(significant)


@pytest.mark.parametrize(
    ("design", "name", "draws"), [("bridge", "support_stiffness", 40), ("portal", "joint_stiffness", 40)]
)
def test_errors_of_fitted_changes_match_stated_deviations(design: str, name: str, draws: int) -> None:
    """Changes of up to 3 % of a frequency, noise as stated: mean square of the standard scores, chi-square at 1e-4."""
    reference, cause = springs(design, name)
    random, data = np.random.default_rng(8), cause.comparison
    scores: list[float] = []
    half = len(cause.lower) // 2
    while len(scores) < draws:
        row = int(random.choice(np.flatnonzero(cause.active[:half].sum(1) == 1)))
        theta = np.where(cause.active[row], cause.prior_std * random.standard_normal(3), 0.0)
        changed = prediction(data, [SelectedCause(cause, row, theta)]).log_ratio[0]
        while (theta < cause.lower[row]).any() or np.abs(changed).max() > 0.03:  # modes keep their order
            theta = theta / 2
            changed = prediction(data, [SelectedCause(cause, row, theta)]).log_ratio[0]
        noise = np.linalg.solve(data.drifting.matrix, random.standard_normal(len(changed)))
        proposed = CATALOGUE[name].propose(reference, replace(data, log_ratio=changed + noise))
        assert isinstance(proposed, Springs)
        found = fit(proposed.comparison, of_rows(proposed, [row, row + half]))
        a = int(np.argmax(cause.active[row]))
        scores.append((found.theta[found.best, a] - theta[a]) / found.covariance[found.best, a, a] ** 0.5)
    squares = float(np.sum(np.square(scores)))
    print(f"seed 8: rms {np.sqrt(squares / draws):.2f}, largest {np.abs(scores).max():.1f} of {draws}")
    assert chi2.ppf(1e-4, draws) < squares < chi2.ppf(1 - 1e-4, draws)


@pytest.mark.parametrize("name", ["joint_stiffness", "support_stiffness"])
def test_changed_spring_was_rigid_where_the_file_has_none(name: str) -> None:
    """The file has clamped feet and rigid joints, the specimen springs: the stand-in's stiffness is not reported."""
    state = DESIGNS["portal"].draw(40)
    measured = observation(state, estimated(state, 8, np.random.default_rng(40), noise="law")).modes
    file = structure_of("portal: ")
    clamped = tuple(s.model_copy(update={"fixed": AXES, "stiffness": {}}) for s in file.support)
    reference = nominal_reference(file.model_copy(update={"joint": (), "support": clamped}), measured)
    data = compare(reference, reference.mean_of(measured))
    cause = CATALOGUE[name].propose(reference, data)
    assert isinstance(cause, Springs)
    changes = cause.changes(fit(data, cause))
    assert changes
    for change in changes:
        assert (change.before, change.before_std, change.relative) == (None, 0.0, None)
        assert change_texts(change)[0] == "rigid"


def test_calibrated_spring_keeps_its_stiffness_before() -> None:
    """The file states springs: none is a stand-in for a rigid connection."""
    reference, cause = springs("portal", "joint_stiffness", log_ratio=-2e-2)
    assert not cause.rigid.any()
    for change in cause.changes(fit(cause.comparison, cause)):
        stated = [k for c in reference.structure.joint if c.at == change.position for k in c.stiffness.values()]
        assert change.before in stated


def test_fitted_spring_was_rigid_unless_its_flexibility_is_significant() -> None:
    """The file has clamped feet and rigid joints, and the calibration gave each a small flexibility."""
    state = DESIGNS["portal"].draw(40)
    before = observation(state, estimated(state, 8, np.random.default_rng(40), noise="law"))
    file = structure_of("portal: ")
    clamped = tuple(s.model_copy(update={"fixed": AXES, "stiffness": {}}) for s in file.support)
    file = file.model_copy(update={"joint": (), "support": clamped})
    found = learn_reference(file, before.estimates, before.tracks, before.lateness.delays).calibration
    held: list[Joint | Support] = [*found.structure.joint, *found.structure.support]
    connections = [(c, axis) for c in held for axis in TURNS]

    def rigid(share: float) -> list[tuple[Joint | Support, Axis]]:
        parameters = tuple(replace(p, value=0.01, std=0.01 * share) for p in found.parameters)
        known = replace(found, parameters=parameters)
        return [(c, axis) for c, axis in connections if known.is_rigid(c, axis)]

    negligible = rigid(0.0)  # too small to change a frequency, whatever its deviation
    assert rigid(0.4) == negligible  # two deviations are less than the flexibility
    assert len(negligible) < len(rigid(0.6)) == len(connections)

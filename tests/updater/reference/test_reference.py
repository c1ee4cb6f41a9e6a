"""The reference and the exact properties of its parts."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.frames import as_estimate, t_frame, t_truth, unmoved
from updater import (
    Body,
    MassUpdater,
    PairingError,
    Reference,
    TrackedModes,
    build_model,
    learn_reference,
    learn_scatter,
    locate_mass,
    stack_tracks,
)
from updater.modal_data import real_shape
from updater.one_step.update import update_mass, update_stiffness


@pytest.fixture(scope="module")
def reference() -> Reference:
    truth = t_truth(3)
    model = truth.model()
    return learn_reference(t_frame(), truth.windows(model.modes(8), model.sensor_rows, 4, 1), unmoved(4))


def test_first_stage_does_not_change_the_mass(reference: Reference) -> None:
    mass = reference.model.mass
    gram = reference.shape.T @ (mass @ reference.shape)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-9)
    paired = reference.paired
    t = (reference.calibration.modes.shape.T @ (mass @ reference.shape))[:, paired]
    change = update_mass(mass @ reference.calibration.modes.shape, t, np.eye(len(gram))[:, paired])
    assert np.abs(change.diagonal()).max() < 1e-9 * mass.diagonal().max()


def test_reference_has_the_measured_frequencies(reference: Reference) -> None:
    np.testing.assert_allclose(reference.frequency[reference.paired], np.exp(reference.baseline.log_frequency))


@pytest.mark.parametrize("at", [(0.25, 0, 1.48), *few_of([((0, 0, 0.92),)], 0)], ids=["location 1", "location 2"])
def test_frequency_shifts_determine_most_of_the_total_mass(at: tuple[float, float, float]) -> None:
    """Eq. 13: at the baseline's frequencies directions gain the losses of others, and the three totals almost cancel.

    Single directions do not vanish (-156, 35, 145 g for 304 g at location 1): the shapes of close modes turn.
    """
    truth = t_truth(3)
    bare, loaded = truth.model(), truth.model(Body(at=at, mass=0.304))
    learnt = learn_reference(t_frame(), truth.windows(bare.modes(8), bare.sensor_rows, 4, 1, 1e-3), unmoved(4))
    windows = truth.windows(loaded.modes(8), loaded.sensor_rows, 4, 2, 1e-3)
    event = learnt.mean_of(stack_tracks(windows, unmoved(4)))
    seen = MassUpdater(learnt).update(event).totals.sum()
    unseen = MassUpdater(learnt).update(replace(event, log_frequency=learnt.baseline.log_frequency)).totals.sum()
    assert seen > 2 * 0.304
    assert abs(unseen) < 0.25 * seen


def test_track_never_measured_in_the_baseline_is_left_out() -> None:
    truth = t_truth(4)
    model = truth.model()
    windows = truth.windows(model.modes(8), model.sensor_rows, 3, 1)
    tracks = [np.append(np.arange(8), -1)] * 3
    assert learn_reference(t_frame(), windows, tracks).calibration.tracks.tolist() == list(range(8))


def test_body_is_located_with_a_coarse_mesh_of_few_modes() -> None:
    coarse = t_frame().with_mesh(0.5)
    truth = t_truth(5)
    bare, loaded = truth.model(), truth.model(Body(at=(0, 0, 0.92), mass=0.3))
    learnt = learn_reference(coarse, truth.windows(bare.modes(8), bare.sensor_rows, 4, 1), unmoved(4))
    assert len(learnt.frequency) < 30
    windows = truth.windows(loaded.modes(8), loaded.sensor_rows, 4, 2)
    change = locate_mass(learnt, learnt.mean_of(stack_tracks(windows, unmoved(4))))
    assert change.member == "column"
    assert change.distance == pytest.approx(0.92, abs=0.05)


def test_modes_of_another_structure_are_refused() -> None:
    random = np.random.default_rng(1)
    channels = t_frame().channels
    strange = [as_estimate([1.0, 2.0, 3.0], random.standard_normal((3, 12)), channels=channels) for _ in range(3)]
    with pytest.raises(PairingError, match="check the structure"):
        learn_reference(t_frame(), strange, unmoved(3, 3))


def test_channel_without_sensor_is_named_in_the_error() -> None:
    shape = np.random.default_rng(1).standard_normal((3, 1))
    windows = [as_estimate([10.0, 20.0, 30.0], shape, channels=("roof_x",)) for _ in range(3)]
    with pytest.raises(PairingError, match="'roof_x'"):
        learn_reference(t_frame(), windows, unmoved(3, 3))


def _well_conditioned(n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    random = np.random.default_rng(seed)
    return tuple(  # type: ignore[return-value]
        np.eye(n) * scale + 0.2 * (a + a.T)
        for scale, a in ((2.0, random.uniform(-1, 1, (n, n)) / n), (5.0, random.uniform(-1, 1, (n, n))))
    )


@pytest.mark.parametrize("seed", range(5))
def test_low_rank_updates_match_the_dense_formulas(seed: int) -> None:
    """Eqs 7 and 8 on well-conditioned matrices: 1e-12; [A B2] are the modes of (M_u, K_u) to 5e-10."""
    from scipy.linalg import eigh

    n, m = 12, 4
    mass, stiffness = _well_conditioned(n, seed)
    square, b = eigh(stiffness, mass)
    omega, random = np.sqrt(square), np.random.default_rng(100 + seed)
    t = np.eye(n)[:, :m] + 0.05 * random.standard_normal((n, m))
    measured = omega[:m] * (1 + 0.02 * random.standard_normal(m))
    replaced, a = np.eye(n)[:, :m], b @ t
    dense_mass = np.linalg.inv(np.linalg.inv(mass) - b[:, :m] @ b[:, :m].T + a @ a.T)
    flexibility = np.linalg.inv(stiffness) - b[:, :m] / square[:m] @ b[:, :m].T + a / measured**2 @ a.T
    updated_mass = mass + update_mass(mass @ b, t, replaced).dense()
    updated_stiffness = stiffness + update_stiffness(stiffness @ b, omega, t, replaced, measured).dense()
    np.testing.assert_allclose(updated_mass, dense_mass, atol=1e-12 * np.abs(dense_mass).max())
    dense_stiffness = np.linalg.inv(flexibility)
    np.testing.assert_allclose(updated_stiffness, dense_stiffness, atol=1e-12 * np.abs(dense_stiffness).max())
    found = np.sqrt(eigh(updated_stiffness, updated_mass, eigvals_only=True))
    np.testing.assert_allclose(found, np.sort(np.r_[measured, omega[m:]]), rtol=5e-10)


def test_shape_scatter_factor_is_recovered() -> None:
    """Noise twice the stated one; 8 x 11 x 5 degrees of freedom: 3.4 % relative, and unit norm costs one channel."""
    random = np.random.default_rng(5)
    true = np.tile(np.eye(6)[:1] + 0.5, (8, 1))
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    shape = true + 2e-3 * random.standard_normal((12, 8, 6))
    shape /= np.linalg.norm(shape, axis=2, keepdims=True)
    noise = 1e-3 * random.standard_normal((12, 8))
    modes = TrackedModes(
        channels=tuple("abcdef"), log_frequency=noise, log_frequency_std=np.full((12, 8), 1e-3),
        damping=np.full((12, 8), 0.01), damping_std=np.full((12, 8), 1e-3),
        shape=shape, shape_std=np.full(shape.shape, 1e-3), imaginary=np.zeros(shape.shape),
    )  # fmt: skip
    assert learn_scatter(modes).shape_factor == pytest.approx(2.0, rel=4 / np.sqrt(2 * 8 * 11 * 5))


def test_baseline_with_each_mode_measured_once_is_refused() -> None:
    once = np.where(np.eye(3, dtype=bool), 1.0, np.nan)
    modes = TrackedModes(
        channels=("a", "b"), log_frequency=once, log_frequency_std=once, damping=once, damping_std=once,
        shape=np.repeat(once[..., None], 2, 2), shape_std=np.repeat(once[..., None], 2, 2),
        imaginary=np.repeat(once[..., None], 2, 2),
    )  # fmt: skip
    with pytest.raises(ValueError, match="at least two windows"):
        learn_scatter(modes)


def test_real_shape_has_unit_norm_and_a_positive_peak() -> None:
    found = real_shape(np.array([[1 + 0.1j, -3 - 0.2j, 0.5j]]))
    np.testing.assert_allclose(found, [[-1 / np.sqrt(10), 3 / np.sqrt(10), 0]])


def test_shapes_at_sensors_do_not_depend_on_the_mesh() -> None:
    """The reference's own mesh moved by half an element changes no sensor's shape by more than 0.2 % of the largest."""
    frame = t_frame()
    halves = {"column": ((0.0, 0.02, 1.46, 1.48), (1, 36, 1)), "crossbeam": ((0.0, 0.025, 0.775, 0.8), (1, 15, 1))}
    members = tuple(
        member.model_copy(
            update={"name": f"{member.name} {i}", "elements": n}
            | {key: tuple(member.point(s)) for key, s in (("start", cuts[i]), ("end", cuts[i + 1]))}
        )
        for member in frame.member
        for cuts, counts in (halves[member.name],)
        for i, n in enumerate(counts)
    )
    shapes = []
    for structure in (frame, frame.model_copy(update={"member": members})):
        model = build_model(structure, shear_flexible=True, mass="consistent")
        seen = model.sensor_rows @ model.modes(8).shape
        shapes.append(seen / np.linalg.norm(seen, axis=0))
    shapes[1] *= np.sign((shapes[0] * shapes[1]).sum(0))
    assert np.abs(shapes[1] - shapes[0]).max() < 2e-3 * np.abs(shapes[0]).max()

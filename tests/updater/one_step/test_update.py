"""The one-step update against its dense formulas, and the exact properties it has."""

import numpy as np
import pytest
from scipy.linalg import eigh

from daq import FloatArray
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import MassUpdater, PairingError, Reference, build_model, learn_reference, mean_modes, stack_tracks
from updater.one_step.update import (
    LowRank,
    mass_slope,
    normalised_increments,
    scale_by_stiffness,
    update_mass,
    update_stiffness,
)
from updater.reference import expand_shape, orthonormal
from updater.reference.expansion import expand

N, M = 40, 8


class Frame:
    """The T-frame's condensed matrices, and eight measured modes in its model modes."""

    def __init__(self) -> None:
        random = np.random.default_rng(5)
        model = build_model(t_frame())
        self.modes = model.modes(N)
        self.stiffness = model.stiffness.toarray()
        self.mass = model.mass.diagonal()
        self.weighed = self.mass > 0
        self.t = np.eye(N)[:, :M] + 0.02 * random.standard_normal((N, M))
        self.replaced = np.eye(N)[:, :M]
        self.omega = self.modes.omega[:M] * (1 + 0.01 * random.standard_normal(M))

    @property
    def mass_times_modes(self) -> FloatArray:
        return np.asarray(self.mass[:, None] * self.modes.shape)


@pytest.fixture(scope="module")
def frame() -> Frame:
    return Frame()


def test_low_rank_mass_update_matches_equation_7(frame: Frame) -> None:
    """Relative to the largest mass, to the rounding of a dense inverse: N eps / 2 = 1.7e-14 at worst, 3e-15 found."""
    b, a = frame.modes.shape[frame.weighed, :M], (frame.modes.shape @ frame.t)[frame.weighed]
    mass = frame.mass[frame.weighed]
    dense = np.linalg.inv(np.diag(1 / mass) - b @ b.T + a @ a.T) - np.diag(mass)
    change = update_mass(frame.mass_times_modes, frame.t, frame.replaced)
    low_rank = change.dense()[np.ix_(frame.weighed, frame.weighed)]
    print(np.abs(low_rank - dense).max() / mass.max())
    np.testing.assert_allclose(low_rank, dense, atol=1e-14 * mass.max())
    np.testing.assert_allclose(change.diagonal()[frame.weighed], np.diag(dense), atol=1e-14 * mass.max())


def test_mass_diagonal_is_not_the_reciprocal_of_the_inverse_diagonal(frame: Frame) -> None:
    """M_u is full: reading increments off the inverse's diagonal is wrong by several per cent of the largest."""
    change = update_mass(frame.mass_times_modes, frame.t, frame.replaced).diagonal()[frame.weighed]
    b, a = frame.modes.shape[frame.weighed, :M], (frame.modes.shape @ frame.t)[frame.weighed]
    mass = frame.mass[frame.weighed]
    short_cut = 1 / (1 / mass - (b**2).sum(1) + (a**2).sum(1)) - mass
    assert np.abs(short_cut - change).max() > 0.02 * np.abs(change).max()


def test_all_modes_with_inertia_sum_to_the_inverse_mass() -> None:
    """Eq. 3 with massless rotations condensed, exactly: 2e-14 of the largest entry; static rows of the rotations."""
    model = build_model(t_frame())
    weighed = model.mass.diagonal() > 0
    modes = model.modes(int(weighed.sum()))
    b = modes.shape[weighed]
    inverse = np.diag(1 / model.mass.diagonal()[weighed])
    np.testing.assert_allclose(b @ b.T, inverse, atol=2e-14 * inverse.max())
    moments = (model.stiffness @ modes.shape[:, :M])[~weighed]
    assert np.abs(moments).max() < 1e-7 * np.abs(model.stiffness.toarray()[~weighed] @ np.abs(modes.shape[:, :M])).max()


def test_low_rank_stiffness_update_matches_equation_8(frame: Frame) -> None:
    b, a = frame.modes.shape[:, :M], frame.modes.shape @ frame.t
    flexibility = np.linalg.inv(frame.stiffness)
    dense = np.linalg.inv(flexibility - b / frame.modes.omega[:M] ** 2 @ b.T + a / frame.omega**2 @ a.T)
    times_modes = frame.stiffness @ frame.modes.shape
    change = update_stiffness(times_modes, frame.modes.omega, frame.t, frame.replaced, frame.omega)
    # the dense inverse itself is right to about cond(K) eps
    scale = np.abs(frame.stiffness).max()
    np.testing.assert_allclose(change.dense(), dense - frame.stiffness, atol=1e-7 * scale)


def test_updated_matrices_have_the_measured_and_kept_modes(frame: Frame) -> None:
    """All 40 frequencies and [A B2] themselves: M_u and K_u leave the span of B to itself, where the pencil is small.

    Eigenvalues from 4.6e3 to 1.6e9: the least is right to 1.6e9 / 4.6e3 * 2e-16 = 8e-11 of itself, times a few.
    """
    shapes = frame.modes.shape
    mass = np.eye(N) + reduced(update_mass(frame.mass_times_modes, frame.t, frame.replaced), shapes)
    times_modes = frame.stiffness @ shapes
    change = update_stiffness(times_modes, frame.modes.omega, frame.t, frame.replaced, frame.omega)
    stiffness = np.diag(frame.modes.omega**2) + reduced(change, shapes)
    value, vector = eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    expected = np.concatenate([frame.omega, frame.modes.omega[M:]])
    order = np.argsort(expected)
    np.testing.assert_allclose(np.sqrt(value), expected[order], rtol=5e-10)
    found = np.column_stack([frame.t, np.eye(N)[:, M:]])[:, order]
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->j", vector, mass @ found)), 1, atol=1e-9)


def reduced(change: LowRank, shapes: FloatArray) -> FloatArray:
    """Return a change of a matrix in the modes' coordinates."""
    left = shapes.T @ change.left
    return np.asarray(left @ change.core @ left.T)


def test_rotation_among_replaced_modes_changes_no_mass(frame: Frame) -> None:
    """Why the first stage orthonormalises: A A^T = B1 B1^T for any rotation, and M_u = M."""
    random = np.random.default_rng(7)
    rotation = orthonormal(np.eye(M) + 0.3 * random.standard_normal((M, M)))
    change = update_mass(frame.mass_times_modes, frame.replaced @ rotation, frame.replaced)
    assert np.abs(change.dense()).max() < 1e-14 * frame.mass.max() * M


def test_small_nodal_mass_gives_first_order_increments_largest_at_node(frame: Frame) -> None:
    """Eqs 7, 12, 13, 14 in one: m M_jj (sum b_i(j) b_i(s))^2 / sum b_i(j)^2 with exact modes of the body's structure.

    The next order is m b(s)^2 = 2.5e-5 of this one, over the gap of the two close modes, 3.5 % of omega^2: 7e-4.
    """
    kilograms, b = 1e-5, frame.modes.shape[frame.weighed, :M]
    mass, omega = frame.mass[frame.weighed], frame.modes.omega[:M]
    share = mass * (b**2).sum(1)
    at = int(np.argmax((b**2).sum(1)))
    value, vector = eigh(np.diag(omega**2), np.eye(M) + kilograms * np.outer(b[at], b[at]))
    t = np.zeros((N, M))
    t[:M] = scale_by_stiffness(vector * np.sign(np.diag(vector)), omega, np.sqrt(value))
    change = update_mass(frame.mass_times_modes, t, frame.replaced).diagonal()[frame.weighed]
    found = normalised_increments(change, 1 / mass, share / mass)
    reported = np.isfinite(found)
    expected = kilograms * mass * (b @ b[at]) ** 2 / (b**2).sum(1)
    np.testing.assert_allclose(found[reported], expected[reported], atol=1e-3 * np.abs(expected[reported]).max())
    assert np.nanargmax(found / mass) == at


def test_small_change_mixes_modes_according_to_first_order_perturbation(frame: Frame) -> None:
    """The local correspondence principle, why few modes about the paired one carry a change of shape.

    d b_i = sum_k b_k b_k^T (omega_i^2 dM) b_i / (omega_k^2 - omega_i^2) - (b_i^T dM b_i) / 2 b_i. The next order
    is a change of 1e-6 over the smallest relative gap of omega^2 once more: 1e-6 / 3.3e-3 = 3e-4.
    """
    random = np.random.default_rng(8)
    omega, size = frame.modes.omega, 1e-6
    root = random.standard_normal((N, N))
    change = size * (root @ root.T) / N
    value, vector = eigh(np.diag(omega**2), np.eye(N) + change)
    vector *= np.sign(np.diag(vector))
    gap = omega[:, None] ** 2 - omega**2
    mixed = change * omega**2 / np.where(gap == 0, np.inf, gap)
    first_order = np.eye(N) + mixed - np.diag(np.diag(change)) / 2
    assert np.diff(omega).min() > 0
    np.testing.assert_allclose(vector, first_order, atol=1e-2 * np.abs(mixed).max())
    assert value == pytest.approx(omega**2 * (1 - np.diag(change)), rel=1e-2 * size)


def test_unchanged_data_give_no_mass_change(frame: Frame) -> None:
    same = update_mass(frame.mass_times_modes, frame.replaced, frame.replaced)
    assert np.abs(same.diagonal()).max() < 1e-14


def test_two_measured_modes_of_equal_shape_are_refused(frame: Frame) -> None:
    twice = frame.t.copy()
    twice[:, 4] = -2 * twice[:, 1]
    with pytest.raises(PairingError, match="measured modes 2 and 5 are the same"):
        update_mass(frame.mass_times_modes, twice, frame.replaced)
    with pytest.raises(PairingError, match="measured modes 2 and 5 are the same"):
        update_stiffness(
            frame.stiffness @ frame.modes.shape, frame.modes.omega, twice, frame.replaced, frame.modes.omega[:M]
        )


def test_mass_diagonal_slope_matches_finite_differences(frame: Frame) -> None:
    """Central differences of 1e-6: 1e-12 curvature and 1e-16 / 1e-6 rounding, over entries of up to 1."""
    slope = mass_slope(frame.mass_times_modes, frame.t, frame.replaced)
    direction = np.random.default_rng(6).standard_normal(frame.t.shape)
    ahead, behind = (
        update_mass(frame.mass_times_modes, frame.t + h * direction, frame.replaced).diagonal() for h in (1e-6, -1e-6)
    )
    np.testing.assert_allclose(np.einsum("ijk,ki->j", slope, direction), (ahead - behind) / 2e-6, atol=1e-8)


def test_expansion_recovers_a_shape_inside_its_cluster_exactly(frame: Frame) -> None:
    model = build_model(t_frame())
    at_channels = (model.sensor_rows @ frame.modes.shape).T
    t = np.zeros(N)
    t[[3, 4]] = 1.0, 0.1
    found = expand(t @ at_channels, at_channels, frame.modes.omega, 3, largest=4)
    np.testing.assert_allclose(found, t, atol=1e-10)


def test_expanded_shape_has_unit_mass_and_correct_slope(frame: Frame) -> None:
    """Central differences of 1e-6: 1e-12 of curvature and 1e-16 / 1e-6 of rounding."""
    at_channels = (build_model(t_frame()).sensor_rows @ frame.modes.shape).T
    random = np.random.default_rng(9)
    shape = at_channels[4] + 0.1 * at_channels[3] + 0.01 * random.standard_normal(12)
    found = expand_shape(-shape, at_channels, frame.modes.omega, 4, largest=4)  # turned as the model's mode
    assert np.linalg.norm(found.t) == pytest.approx(1)
    assert found.t[4] > 0.9
    direction = random.standard_normal(12)
    ahead, behind = (
        expand_shape(-shape + h * direction, at_channels, frame.modes.omega, 4, largest=4).t for h in (1e-6, -1e-6)
    )
    np.testing.assert_allclose(found.by_event @ direction, (ahead - behind) / 2e-6, atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_selected_cluster_best_predicts_left_out_sensors(frame: Frame, seed: int) -> None:
    """Against refits with each sensor left out in turn, one cluster size after the other."""
    at_channels = (build_model(t_frame()).sensor_rows @ frame.modes.shape).T
    near = np.argsort(np.abs(frame.modes.omega**2 - frame.modes.omega[4] ** 2))
    random = np.random.default_rng(seed)
    shape = at_channels[near[:3]].T @ [1.0, 0.2, 0.1] + 0.05 * random.standard_normal(12)
    errors = []
    for size in range(1, 5):
        cluster = at_channels[near[:size]].T
        error = 0.0
        for sensor in range(12):
            kept = np.arange(12) != sensor
            fit = np.linalg.lstsq(cluster[kept], shape[kept], rcond=None)[0]
            error += float((shape[sensor] - cluster[sensor] @ fit) ** 2)
        errors.append(error)
    found = expand(shape, at_channels, frame.modes.omega, 4, largest=4)
    assert np.count_nonzero(found) == 1 + int(np.argmin(errors))


@pytest.mark.parametrize("seed", range(4))
def test_expansion_uses_fewer_modes_than_sensors_with_motion(seed: int) -> None:
    """Three modes at three sensors across a bridge, measured with noise of 0.5 %: the hat matrix is 0 / 0 for each."""
    across = np.array([[0.14, 0.98, 0.14], [-0.71, 0.0, 0.71], [0.66, -0.37, 0.66]])
    upwards = np.array([0.5, 0.7, 0.5, -0.1])
    at_channels = np.zeros((4, 7))
    at_channels[:3, 4:], at_channels[3, :4] = across, upwards
    shape = at_channels[2] + 5e-3 * np.random.default_rng(seed).standard_normal(7)
    found = expand(shape, at_channels, np.array([3.2, 5.3, 6.4, 9.0]), 2, largest=4)
    assert np.count_nonzero(found) < 3


def test_mode_without_motion_at_sensors_is_excluded_from_expansion(frame: Frame) -> None:
    """A mode with 1e-5 of its motion at them would be expanded to 1e5 times its noise."""
    at_channels = (build_model(t_frame()).sensor_rows @ frame.modes.shape).T
    near = np.argsort(np.abs(frame.modes.omega**2 - frame.modes.omega[4] ** 2))[1]
    random = np.random.default_rng(3)
    still = at_channels.copy()
    still[near] = 1e-5 * random.standard_normal(12)
    found = expand(still[4] + 0.01 * still[near] / 1e-5, still, frame.modes.omega, 4, largest=4)
    assert found[near] == 0
    assert found[4] == pytest.approx(1, abs=0.02)


def test_orthonormalised_modes_have_identity_modal_mass() -> None:
    random = np.random.default_rng(1)
    t = orthonormal(np.eye(M) + 0.1 * random.standard_normal((M, M)))
    np.testing.assert_allclose(t.T @ t, np.eye(M), atol=1e-12)


def test_increments_are_divided_by_the_updated_share() -> None:
    """The paper's figures: 0.194 % times 7.5911 / 0.4872; under a share of 1e-3 there is no result.

    Unless all shares are small, as in a fine mesh: then under a hundredth of the largest.
    """
    found = normalised_increments(np.array([0.194, 1.0]), np.array([7.5911, 1.0]), np.array([0.4872, 5e-4]))
    assert found[0] == pytest.approx(0.194 * 7.5911 / 0.4872)
    assert np.isnan(found[1])
    fine = normalised_increments(np.ones(3), np.full(3, 1e4), np.array([5.0, 0.06, 0.04]))
    np.testing.assert_allclose(fine[:2], [1e4 / 5, 1e4 / 0.06])
    assert np.isnan(fine[2])


def reference_and_event(seed: int, grams: float) -> tuple[Reference, FloatArray]:
    from updater import Body

    random = np.random.default_rng(seed)
    bare = np.random.default_rng(seed + 1)
    gain = np.ones(12)
    body = Body(at=(0.25, 0, 1.48), mass=grams / 1000) if grams else None
    tracks = [np.arange(8)] * 4
    before = [
        measure(true_model(np.random.default_rng(seed + 1)), random, gain, noise=1e-7, shape_noise=1e-7)
        for _ in range(4)
    ]
    after = [measure(true_model(bare, body), random, gain, noise=1e-7, shape_noise=1e-7)]
    reference = learn_reference(t_frame(), before, tracks)
    update = MassUpdater(reference).update(mean_modes(stack_tracks(after, tracks[:1])))
    return reference, update.totals


def test_totals_have_only_the_order_of_magnitude_of_the_mass() -> None:
    """304 g at location 1: the paper has 416, 246, 354 g in x, y, z; ours within a factor of 2.2 of it."""
    _, totals = reference_and_event(11, 304)
    assert np.all(totals > 0.304 / 2.2)
    assert np.all(totals < 0.304 * 2.2)


def test_unchanged_structure_has_negligible_totals() -> None:
    """Noise of 1e-7 in, 1e-7 of the structure's 7.5 kg out, times a few for the normalisation."""
    _, totals = reference_and_event(12, 0)
    assert np.abs(totals).max() < 1e-4


def test_mass_increment_vanishes_without_stiffness_scaling(frame: Frame) -> None:
    """Eq. 13 carries the frequencies: at equal shapes and lower frequencies only the scaled modes show more mass."""
    lower = 0.98 * frame.modes.omega[:M]
    scaled = scale_by_stiffness(frame.replaced, frame.modes.omega[:M], lower)
    shapes = frame.modes.shape
    for t, gained in ((scaled, 1 / 0.98**2 - 1), (frame.replaced, 0.0)):
        change = update_mass(frame.mass_times_modes, t, frame.replaced).dense()
        modal = np.einsum("ij,ij->j", shapes, change @ shapes)[:M]
        np.testing.assert_allclose(modal, gained, atol=1e-12)

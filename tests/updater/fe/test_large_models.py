"""Large models: a factor that keeps to symmetry, block Lanczos, many points read at once, few of them fitted."""

from importlib.util import find_spec

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import eigsh

from tests.support.thorough import few_of
from tests.support.updater.frames import N_MODES, beam, clamped, t_frame, t_truth, unmoved
from updater import Body, Model, ModelError, build_model, learn_reference, locate_mass, stack_tracks
from updater.causes import propose_added_mass
from updater.causes.mass import added_mass
from updater.fe.eigen import block_lanczos, lowest_modes
from updater.fe.factorization import factorise
from updater.inference import compare, fit, most_likely

SOLVERS = [False, True] if find_spec("pypardiso") else [False]  # an extra


def _frame() -> Model:
    return build_model(t_frame().with_mesh(0.01), shear_flexible=True, mass="consistent")


@pytest.mark.parametrize("pardiso", SOLVERS)
def test_modes_match_arpack_and_are_orthonormal(pardiso: bool) -> None:
    """1372 DOFs, condition 1e11: a solution with K is right to 1e-5 of its length, its energy to the square of that."""
    model = _frame()
    found = lowest_modes(model.stiffness, model.mass, 12, "frame", pardiso=pardiso)
    start = np.random.default_rng(1).standard_normal(model.n_dofs)
    value = eigsh(model.stiffness, 12, model.mass, sigma=0.0, v0=start, return_eigenvectors=False)
    np.testing.assert_allclose(found.omega**2, np.sort(value), rtol=1e-9)
    np.testing.assert_allclose(found.shape.T @ (model.mass @ found.shape), np.eye(12), atol=1e-12)


def test_both_modes_of_each_repeated_frequency_are_found() -> None:
    """A column that bends alike in both planes, every frequency twice."""
    column = beam(length=1.0, elements=30, support=clamped(), second_moment=(1e-9, 1e-9))
    frequency = build_model(column, mass="consistent").modes(8).frequency
    np.testing.assert_allclose(frequency[::2], frequency[1::2], rtol=1e-8)
    assert np.all(np.diff(frequency[::2]) > 0.1 * frequency[0])


def test_block_lanczos_returns_only_modes_with_inertia() -> None:
    """Twelve elements with particles: 36 translations have mass, 36 rotations none."""
    model = build_model(beam(length=1.0, elements=12, support=clamped()))
    inverse, shape = block_lanczos(factorise(model.stiffness), model.mass, 50, model.mass)
    assert shape.shape == (72, 36)
    np.testing.assert_allclose(1 / inverse, (2 * np.pi * model.modes(36).frequency) ** 2, rtol=1e-6)


@pytest.mark.parametrize("pardiso", SOLVERS)
def test_indefinite_or_singular_stiffness_is_refused(pardiso: bool) -> None:
    indefinite = sparse.csc_array(np.array([[1.0, 2.0], [2.0, 1.0]]))
    with pytest.raises(ModelError, match="indefinite"):
        factorise(indefinite, pardiso=pardiso)
    with pytest.raises(ModelError, match="singular"):
        factorise(sparse.csc_array(np.array([[1.0, 1.0], [1.0, 1.0]])), pardiso=pardiso)


def test_points_read_together_equal_points_read_separately() -> None:
    model = build_model(t_frame())
    random = np.random.default_rng(3)
    points = np.concatenate([m.point(random.uniform(0, m.length, 20)) for m in model.structure.member])
    together = model.reader(points).toarray().reshape(40, 6, -1)
    np.testing.assert_array_equal(together, [model.read(p) for p in points])


@pytest.mark.parametrize("seed", few_of([21, 22]))
@pytest.mark.parametrize("mass", [0.03, 0.3])
def test_positions_kept_by_first_order_contain_the_posterior(seed: int, mass: float) -> None:
    """A third of all positions, by first order, contains the exact posterior of all: all but 1 % of it."""
    truth = t_truth(seed)
    random = np.random.default_rng((seed, 7))
    bare, loaded = truth.model(), truth.model(Body(at=(0, 0, float(random.uniform(0.6, 1.4))), mass=mass))
    before = truth.windows(bare.modes(N_MODES), bare.sensor_rows, 8, seed)
    reference = learn_reference(t_frame(), before, unmoved(8))
    after = truth.windows(loaded.modes(N_MODES), loaded.sensor_rows, 4, seed + 50)
    data = compare(reference, reference.mean_of(stack_tracks(after, unmoved(4))))
    everywhere = propose_added_mass(reference, data)
    kept = most_likely(data, everywhere.translation, everywhere.prior_std[0], len(everywhere.position) // 3)
    assert fit(data, everywhere, refine=False).probability[kept].sum() > 0.99


def test_only_the_most_likely_of_many_positions_are_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same frame taken for a large one: nodes 0.04 and 0.05 m apart, 40 of 54 kept, then finer between them."""
    truth = t_truth(23)
    bare, loaded = truth.model(), truth.model(Body(at=(0.22, 0, 1.48), mass=0.3))
    before = truth.windows(bare.modes(N_MODES), bare.sensor_rows, 8, 23)
    reference = learn_reference(t_frame(), before, unmoved(8))
    event = reference.mean_of(stack_tracks(truth.windows(loaded.modes(N_MODES), loaded.sensor_rows, 4, 24), unmoved(4)))
    exact = locate_mass(reference, event)
    monkeypatch.setattr(added_mass, "_MAX", 100)
    monkeypatch.setattr(added_mass, "_KEPT", 40)
    found = locate_mass(reference, event)
    assert found.member == exact.member
    assert found.distance == pytest.approx(exact.distance, abs=0.2 * exact.distance_std)
    assert found.distance_std == pytest.approx(exact.distance_std, rel=0.3)
    assert found.mass == pytest.approx(exact.mass, rel=0.01)

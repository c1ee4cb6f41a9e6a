"""Particle masses: rotations without inertia follow the translations statically, exactly."""

import numpy as np
import pytest
import scipy.linalg

from tests.support.updater.frames import t_frame
from updater import Body, Model, build_model
from updater.structure import Joint


def _model(bodies: tuple[Body, ...] = (), n: int = 6) -> Model:
    joint = Joint(member="crossbeam", at=(0, 0, 1.48), stiffness={"rx": 3e4, "ry": 2e4, "rz": 5e4})
    structure = t_frame().with_mesh(1.48 / n).model_copy(update={"joint": (joint,)})
    return build_model(structure.with_bodies(bodies), shear_flexible=True)


@pytest.mark.parametrize("elements", [6, 40], ids=["all of the matrix", "its lowest modes"])
def test_modes_match_the_condensed_matrices(elements: int) -> None:
    """K_c = K_tt - K_tr K_rr^-1 K_rt over the translations, and the rotations are -K_rr^-1 K_rt times them."""
    model = _model(n=elements)
    stiffness, mass = model.stiffness.toarray(), model.mass.toarray()
    heavy = np.diag(mass) > 0
    turn = -np.linalg.solve(stiffness[np.ix_(~heavy, ~heavy)], stiffness[np.ix_(~heavy, heavy)])
    condensed = stiffness[np.ix_(heavy, heavy)] + stiffness[np.ix_(heavy, ~heavy)] @ turn
    value = scipy.linalg.eigh(condensed, mass[np.ix_(heavy, heavy)], eigvals_only=True)
    modes = model.modes(12)
    # both lose digits to the axial stiffness, 1e4 of the bending one of an element, in eps times condition, 1e-9
    np.testing.assert_allclose(modes.omega**2, value[:12], rtol=1e-7)
    scale = np.abs(modes.shape[~heavy]).max(0)
    np.testing.assert_allclose((turn @ modes.shape[heavy] - modes.shape[~heavy]) / scale, 0, atol=1e-6)


def test_exactly_the_modes_with_inertia_are_found() -> None:
    """As many as there are masses that move; together they are the inverse of the mass (eq. 3)."""
    model = _model()
    heavy = model.mass.diagonal() > 0
    modes = model.modes(int(heavy.sum()))
    inverse = modes.shape[heavy] @ modes.shape[heavy].T
    np.testing.assert_allclose(inverse * model.mass.diagonal()[heavy], np.eye(heavy.sum()), atol=1e-9)


def test_body_with_offset_and_inertia_adds_three_modes() -> None:
    """Six more masses at one node, of which its translations had three: three modes more than without the body."""
    body = Body(at=(0.0, 0.0, 1.48), mass=0.3, offset=(0.02, 0.03, 0.05), inertia=(1e-4, 2e-4, 3e-4))
    counts = []
    for bodies in ((), (body,)):
        model = _model(bodies)
        mass = model.mass.toarray()
        rank = int((np.linalg.eigvalsh(mass) > 1e-9 * np.abs(mass).max()).sum())
        modes = model.modes(rank)
        np.testing.assert_allclose(modes.shape.T @ mass @ modes.shape, np.eye(rank), atol=1e-8)
        counts.append(rank)
    assert counts[1] == counts[0] + 3

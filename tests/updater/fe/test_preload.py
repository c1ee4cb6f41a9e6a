"""Axial preload: frequencies and buckling loads against closed forms."""

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.frames import beam, clamped
from updater import Model, ModelError, Structure, build_model
from updater.fe import Element
from updater.structure import Support

# E = rho = A = L = 1, slender: rotary inertia and stretch do not show
MOMENT = 1e-8
EULER = np.pi**2 * MOMENT
PINNED = (Support(at=(0, 0, 0), fixed=("x", "y", "z", "rx")), Support(at=(1, 0, 0), fixed=("y", "z")))


def _loaded(force: float, elements: int, support: tuple[Support, ...], moment: float = MOMENT) -> Structure:
    plain = beam(length=1.0, elements=elements, support=support, second_moment=(moment, moment), torsion_constant=1.0)
    member = plain.member[0].model_copy(update={"preload": force})
    return plain.model_copy(update={"member": (member,)})


def _bending(force: float, elements: int) -> FloatArray:
    """Return the frequencies of three bending modes, each there twice."""
    return build_model(_loaded(force, elements, PINNED), mass="consistent").modes(6).frequency[::2]


@pytest.mark.parametrize("share", [-0.9, -0.5, 1.0, 100.0])
def test_pinned_beam_under_axial_force_has_the_closed_form_frequencies(share: float) -> None:
    """f_n = n^2 pi / 2 sqrt(E I / rho A L^4) sqrt(1 + N / (n^2 N_Euler)); at 100 times Euler's load it is a string."""
    n = np.arange(1, 4)
    closed = n**2 * np.pi / 2 * np.sqrt(MOMENT) * np.sqrt(1 + share / n**2)
    # an element of fourth order: (n pi h)^4 / 720 in omega^2 at most, and the string's part (n pi h)^2 times less
    np.testing.assert_allclose(_bending(share * EULER, 16), closed, rtol=1e-4)


def test_frequencies_under_preload_converge_with_fourth_order() -> None:
    n = np.arange(1, 4)
    closed = n**2 * np.pi / 2 * np.sqrt(MOMENT) * np.sqrt(1 - 0.5 / n**2)
    error = [_bending(-0.5 * EULER, elements) / closed - 1 for elements in (6, 12)]
    np.testing.assert_allclose(np.log2(error[0] / error[1]), 4, atol=0.25)


def _buckling_load(model: Model) -> float:
    """Return the force at which a beam without preload buckles, from its matrices and those under a unit of tension."""
    stiffness = model.stiffness.toarray()
    element = model.elements[0][2]
    assert isinstance(element, Element)
    tensioned = build_model(_with_preload(model.structure, 1.0), shear_flexible=element.shear_flexible)
    geometric = tensioned.stiffness.toarray() - stiffness
    return float(1 / np.linalg.eigvals(np.linalg.solve(stiffness, geometric)).real.max())


def _with_preload(structure: Structure, force: float) -> Structure:
    return structure.model_copy(update={"member": (structure.member[0].model_copy(update={"preload": force}),)})


@pytest.mark.parametrize(
    ("support", "effective_length"),
    [
        (PINNED, 1.0),
        (clamped(), 2.0),
        ((*clamped(), Support(at=(1, 0, 0), fixed=("y", "z", "ry", "rz"))), 0.5),
        ((*clamped(), Support(at=(1, 0, 0), fixed=("y", "z"))), 0.69915566),  # tan x = x
    ],
    ids=["pinned", "cantilever", "clamped", "clamped and pinned"],
)
def test_buckling_load_matches_euler(support: tuple[Support, ...], effective_length: float) -> None:
    model = build_model(_loaded(0.0, 16, support, moment=1e-3))  # stout, so that K is well conditioned
    error = (np.pi / 16 / effective_length) ** 4 / 720  # of the cubics, leading term
    assert _buckling_load(model) == pytest.approx(np.pi**2 * 1e-3 / effective_length**2, rel=1.1 * error)


def test_buckling_load_of_shear_flexible_beam_matches_engesser() -> None:
    """N = N_Euler / (1 + N_Euler / (kappa G A)), Timoshenko & Gere (1961), eq. 2-59."""
    moment = 1e-2
    euler, shear = np.pi**2 * moment, 5 / 6 * 0.4
    error = [
        _buckling_load(build_model(_loaded(0.0, n, PINNED, moment=moment), shear_flexible=True))
        / (euler / (1 + euler / shear))
        - 1
        for n in (8, 16)
    ]
    # elements shorter than the section is deep are of second order, as in vibration
    assert np.log2(error[0] / error[1]) == pytest.approx(2, abs=0.05)
    assert abs(4 * error[1] - error[0]) / 3 < 1e-5  # and what is left is of fourth


def test_tension_increases_torsional_stiffness_by_the_polar_radius() -> None:
    """A shaft under tension twists as one of G J + N (I_y + I_z) / A (McGuire et al. 2000, s. 9.2)."""
    structure = beam(
        length=1.0, elements=4, support=clamped(), second_moment=(0.02, 0.03), torsion_constant=0.04, shear_modulus=0.4
    )
    turn = []
    for force in (0.0, 0.1):
        model = build_model(_with_preload(structure, force))
        row = model.read(np.array([1.0, 0, 0]), 3)
        turn.append(row @ np.linalg.solve(model.stiffness.toarray(), row))
    assert 1 / turn[0] == pytest.approx(0.4 * 0.04)
    assert 1 / turn[1] == pytest.approx(0.4 * 0.04 + 0.1 * 0.05)


def test_rigid_translation_under_preload_causes_no_force() -> None:
    """A translation does no work against the preload."""
    model = build_model(_with_preload(beam(length=1.0, elements=3, support=()), 5.0))
    for axis in range(3):
        rigid = np.zeros(model.n_dofs)
        rigid[model.dofs[:, axis]] = 1
        assert np.abs(model.stiffness @ rigid).max() < 1e-12 * abs(model.stiffness).max()


@pytest.mark.parametrize("elements", [4, 40])
@pytest.mark.parametrize("share", [-1.05, -5.0])
def test_compression_beyond_buckling_is_refused(share: float, elements: int) -> None:
    with pytest.raises(ModelError, match="beyond buckling"):
        build_model(_loaded(share * EULER, elements, PINNED), mass="consistent").modes(4)


def test_compression_just_below_buckling_is_accepted() -> None:
    assert build_model(_loaded(-0.99 * EULER, 40, PINNED), mass="consistent").modes(1).frequency[0] > 0

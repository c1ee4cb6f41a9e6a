"""Elements and assembly against closed forms."""

import itertools

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from daq import FloatArray
from tests.support.updater.frames import ALL, all_modes, beam, clamped, of_axis
from updater import Model, ModelError, build_model
from updater.structure import Support

# roots of cos x cosh x = -1, Blevins (1979), table 8-1
CANTILEVER = np.array([1.87510406871196, 4.69409113297417, 7.85475743823761, 10.9955407348755])
SKEW = (0.36, -0.48, 0.8)


def _cantilever_frequencies(elements: int, direction: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> FloatArray:
    # rotary inertia, which the closed form lacks, is (beta r)^2 = 1e-7 of it at most
    model = build_model(beam(length=1.0, elements=elements, support=clamped(), direction=direction), mass="consistent")
    return model.modes(6).frequency


def _closed_form() -> FloatArray:
    """Return both planes' frequencies, E = rho A = L = 1."""
    weak, strong = np.sqrt(1e-9), np.sqrt(4e-9)
    return np.asarray(np.sort(np.r_[CANTILEVER**2 * weak, CANTILEVER**2 * strong] / (2 * np.pi))[:6], np.float64)


def test_cantilever_bending_frequencies_match_closed_form_in_both_planes() -> None:
    # a finite element of fourth order: (beta h)^4 / 720, 6e-5 for the fourth mode of 24 elements
    np.testing.assert_allclose(_cantilever_frequencies(24), _closed_form(), rtol=(CANTILEVER[3] / 24) ** 4 / 700)


def test_cantilever_frequencies_do_not_depend_on_its_direction() -> None:
    np.testing.assert_allclose(
        _cantilever_frequencies(8, SKEW), _cantilever_frequencies(8), rtol=2e-6
    )  # EA is 1e9 EI: rounding


def test_cantilever_frequency_converges_with_fourth_order() -> None:
    error = [_cantilever_frequencies(n) / _closed_form() - 1 for n in (4, 8)]
    order = np.log2(error[0] / error[1])
    np.testing.assert_allclose(order[:4], 4, atol=0.25)


def test_lumped_mass_converges_with_second_order() -> None:
    found = [
        build_model(beam(length=1.0, elements=n, support=clamped()), mass="lumped").modes(2).frequency for n in (16, 32)
    ]
    order = np.log2(np.abs(found[0] / _closed_form()[:2] - 1) / np.abs(found[1] / _closed_form()[:2] - 1))
    np.testing.assert_allclose(order, 2, atol=0.1)


def _rod(wave_number: FloatArray, speed: float, h: float) -> FloatArray:
    """Frequencies of a chain of linear elements with consistent mass: exact for fixed-free and free-free rods."""
    c = np.cos(wave_number * h)
    return np.asarray(speed * np.sqrt(6 * (1 - c) / (2 + c)) / h / (2 * np.pi))


def _thick(elements: int, support: tuple[Support, ...]) -> Model:
    structure = beam(
        length=2.0, elements=elements, support=support, modulus=3.0, shear_modulus=0.7, density=1.3,
        second_moment=(0.02, 0.03), torsion_constant=0.04,
    )  # fmt: skip
    return build_model(structure, mass="consistent")


@pytest.mark.parametrize(
    ("axis", "speed"),
    [(0, np.sqrt(3.0 / 1.3)), (3, np.sqrt(0.7 * 0.04 / (1.3 * 0.05)))],
    ids=["axial", "torsion"],
)
def test_fixed_free_rod_matches_the_closed_form(axis: int, speed: float) -> None:
    model = _thick(10, clamped())
    wave_number = (2 * np.arange(1, 6) - 1) * np.pi / 4  # (2 j - 1) pi / (2 L), L = 2
    found = of_axis(model, all_modes(model), axis)[:5]
    np.testing.assert_allclose(found, _rod(wave_number, speed, 0.2), rtol=1e-9)
    # and the chain tends to the rod: the first frequency is (k h)^2 / 24 too high
    assert found[0] * 4 * 2 / speed - 1 == pytest.approx((np.pi / 4 * 0.2) ** 2 / 24, rel=0.05)


def test_free_free_rod_on_soft_springs_matches_the_closed_form() -> None:
    soft = dict.fromkeys(ALL, 1e-5)
    model = _thick(10, (Support.model_validate({"at": (0, 0, 0), "stiffness": soft}),))
    found = of_axis(model, all_modes(model), 0)
    assert found[0] == pytest.approx(np.sqrt(1e-5 / (2.0 * 1.3)) / (2 * np.pi), rel=1e-4)  # rides on the spring
    # a spring k adds about k / (E A / L) / (j pi)^2 = 7e-7 to a frequency
    np.testing.assert_allclose(found[1:4], _rod(np.arange(1, 4) * np.pi / 2, np.sqrt(3.0 / 1.3), 0.2), rtol=2e-6)


@pytest.mark.parametrize("n", [1, 8])
@pytest.mark.parametrize("elements", [4, 40])
@pytest.mark.parametrize(
    "fixed", [(), ("x", "y", "z"), ("x", "y", "z", "rx", "ry")], ids=["free", "pinned", "free to turn"]
)
def test_mechanism_is_refused(fixed: tuple[str, ...], elements: int, n: int) -> None:
    support = (Support.model_validate({"at": (0, 0, 0), "fixed": fixed}),) if fixed else ()
    model = build_model(
        beam(length=1.0, elements=elements, support=support, second_moment=(1e-3, 2e-3)), mass="consistent"
    )
    with pytest.raises(ModelError, match="support"):
        model.modes(n)


def test_more_modes_than_the_mesh_has_are_refused() -> None:
    model = build_model(beam(length=1.0, elements=2, support=clamped()))
    assert len(model.modes(6).frequency) == 6
    with pytest.raises(ModelError, match="expected 7 modes, found 6"):
        model.modes(7)


def _timoshenko_pinned(k: FloatArray, e: float, g: float, i: float, kappa: float) -> FloatArray:
    """Return the lower root of the frequency equation of a pinned beam, rho = A = 1 (Weaver et al. 1990, s. 5.12)."""
    a, b, c = i / (kappa * g), 1 + k**2 * i * (1 + e / (kappa * g)), e * i * k**4
    return np.asarray(np.sqrt((b - np.sqrt(b**2 - 4 * a * c)) / (2 * a)) / (2 * np.pi))


def test_pinned_timoshenko_beam_matches_the_closed_form() -> None:
    moment = 2e-3
    support = (
        Support(at=(0, 0, 0), fixed=("x", "y", "z", "rx")),
        Support(at=(1, 0, 0), fixed=("y", "z")),
    )
    error = []
    for n in (10, 20):
        structure = beam(
            length=1.0, elements=n, support=support, second_moment=(moment, moment), torsion_constant=moment
        )
        model = build_model(structure, shear_flexible=True, mass="consistent")
        k = np.array([1.0, 2.0, 3.0]) * np.pi
        closed = _timoshenko_pinned(k, 1.0, 0.4, moment, 5 / 6)
        found = np.array(
            [model.modes(30).frequency[np.abs(model.modes(30).frequency / f - 1).argmin()] for f in closed]
        )
        error.append(found / closed - 1)
    extrapolated = (4 * error[1] - error[0]) / 3  # elements shorter than the section is deep: second order
    euler = k**2 * np.sqrt(moment) / (2 * np.pi)
    assert np.all(closed < 0.98 * euler)  # so that shear and rotary inertia matter here
    np.testing.assert_array_less(np.abs(extrapolated), (k / 20) ** 4 / 250)  # which leaves the fourth
    np.testing.assert_allclose(np.log2(error[0] / error[1]), 2, atol=0.1)


@pytest.mark.parametrize("shear_flexible", [False, True])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), SKEW], ids=["along x", "along z", "skew"])
def test_one_element_is_exact_for_tip_loads(shear_flexible: bool, direction: tuple[float, float, float]) -> None:
    moment, length, shear = 2e-3, 0.7, 5 / 6 * 0.4
    structure = beam(
        length=length, elements=1, support=clamped(), second_moment=(moment, moment), torsion_constant=3e-3,
        direction=direction,
    )  # fmt: skip
    model = build_model(structure, shear_flexible=shear_flexible)
    tip = np.asarray(direction) * length
    along = np.asarray(direction)
    across = np.cross(along, [0.3, 0.5, -0.2])
    across /= np.linalg.norm(across)
    rows = model.read(tip)
    for load, stiffness in (
        (np.r_[along, 0, 0, 0], 1 / length),
        (np.r_[across, 0, 0, 0], 1 / (length**3 / (3 * moment) + shear_flexible * length / shear)),
        (np.r_[0, 0, 0, along], 0.4 * 3e-3 / length),
        (np.r_[0, 0, 0, across], moment / length),
    ):
        moved = rows @ spsolve(model.stiffness, rows.T @ load)
        assert load @ moved == pytest.approx(1 / stiffness, rel=1e-9)


@pytest.mark.parametrize("shear_flexible", [False, True])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), SKEW])
def test_rigid_motion_causes_no_strain_and_has_rigid_body_inertia(
    shear_flexible: bool, direction: tuple[float, float, float]
) -> None:
    structure = beam(length=2.0, elements=5, support=(), second_moment=(0.02, 0.02), direction=direction)
    model = build_model(structure, shear_flexible=shear_flexible, mass="consistent")
    rigid = np.zeros((model.n_dofs, 6))
    for (node, point), axis in itertools.product(enumerate(model.nodes), range(3)):
        rigid[model.dofs[node, axis], axis] = 1
        rigid[model.dofs[node, 3 + axis], 3 + axis] = 1
        rigid[model.dofs[node, :3], 3 + axis] = np.cross(np.eye(3)[axis], point)
    force = model.stiffness @ rigid
    assert np.abs(force).max() < 1e-12 * np.abs(model.stiffness.toarray()).max()
    for axis in range(6):  # a rigid motion is read as such anywhere
        point = 0.613 * np.asarray(direction)
        expected = np.r_[np.eye(3), np.zeros((3, 3))][:, axis] if axis < 3 else np.r_[
            np.cross(np.eye(3)[axis - 3], point), np.eye(3)[axis - 3]
        ]  # fmt: skip
        np.testing.assert_allclose(model.read(point) @ rigid[:, axis], expected, atol=1e-12)
    inertia = rigid.T @ (model.mass @ rigid)
    np.testing.assert_allclose(inertia[:3, :3], 2.0 * np.eye(3), atol=1e-12)
    along = np.asarray(direction)
    slender = 2.0**3 / 3 + 2.0 * 0.02  # about the end: A L^3 / 3 + I L
    expected_inertia = slender * (np.eye(3) - np.outer(along, along)) + 2.0 * 0.04 * np.outer(along, along)
    np.testing.assert_allclose(inertia[3:, 3:], expected_inertia, atol=1e-12)

"""Frames with published answers, patch tests and the buckling of a portal."""

import numpy as np
import pytest
from scipy.optimize import brentq

from daq import FloatArray
from tests.support.updater.frames import ALL
from tests.support.updater.published_frames import (
    CURVED,
    FV2,
    FV4,
    FV5,
    TWISTED,
    curved_cantilever,
    deep_beam,
    double_cross,
    frame,
    off_centre_masses,
    portal,
    twisted_cantilever,
)
from updater import Structure, build_model


def test_double_cross_frequencies_match_nafems_fv2() -> None:
    """Sixteen modes in groups of seven equal ones, on the mesh that the test prescribes."""
    found = double_cross(4).modes(16).frequency
    # (beta L / 4)^4 / 1440 of f, beta L = 3.927 and 7.069: 0.06 and 0.7 %; arms that stretch lower modes 2, 3 by 0.13 %
    error = np.abs(found / FV2 - 1)
    assert error[:8].max() < 0.002
    assert error[8:].max() < 0.007
    np.testing.assert_allclose(found[3:8], found[3], rtol=1e-8)  # five arms against each other, of equal frequency
    np.testing.assert_allclose(found[11:16], found[11], rtol=1e-8)


def test_frequencies_with_off_centre_masses_match_nafems_fv4() -> None:
    """Two close modes, and bending that twists: what the bodies' offsets do. The answers have four digits."""
    np.testing.assert_allclose(off_centre_masses(5).modes(6).frequency, FV4, rtol=6e-4)
    np.testing.assert_allclose(off_centre_masses(20).modes(6).frequency, FV4, rtol=2e-4)


def test_deep_beam_frequencies_match_nafems_fv5() -> None:
    """Shear, rotary inertia and twist of a beam five times as long as it is deep; second order from below."""
    coarse, fine = (deep_beam(n).modes(9).frequency for n in (10, 20))
    np.testing.assert_allclose((4 * fine - coarse) / 3, FV5, rtol=3e-4)  # the shear factor: 0.85 here, 5/6 or so there


@pytest.mark.parametrize("case", ["curved", "twisted"])
def test_cantilever_deflections_match_macneal_and_harder(case: str) -> None:
    """Six chords of the ring, twelve strips of the twist: as many elements as the paper prescribes."""
    found, known = (curved_cantilever(6), CURVED) if case == "curved" else (twisted_cantilever(12), TWISTED)
    for name, expected in known.items():
        # four digits are published; the ring's out of plane are for solids, 1.1 % softer than a beam of 0.2 x 0.1
        assert found[name] == pytest.approx(expected, rel=0.012 if name == "out of it" else 6e-4), name


def test_straight_elements_converge_to_a_ring_with_second_order() -> None:
    """Castigliano: pi R^3 / 4 EI + pi R / 4 (1 / EA + 1 / kappa GA) in the plane; with twist out of it."""
    radius, e, g, area = 4.22, 1e7, 4e6, 0.02
    inside, outside, torsion, kappa = 0.1 * 0.2**3 / 12, 0.2 * 0.1**3 / 12, 0.2287 * 0.2 * 0.1**3, 12.5 / 14.75
    exact = {
        "in the plane": np.pi * radius / 4 * (radius**2 / (e * inside) + 1 / (e * area) + 1 / (0.85 * g * area)),
        "out of it": radius**3 * (np.pi / 4 / (e * outside) + (3 * np.pi / 4 - 2) / (g * torsion))
        + np.pi / 2 * radius / (0.85 * g * area),
    }
    assert kappa == pytest.approx(0.85, abs=0.003)  # Cowper's for a Poisson's ratio of 0.25 and of 0.3
    for name, value in exact.items():
        coarse, fine = (curved_cantilever(n)[name] / value - 1 for n in (12, 24))
        assert coarse / fine == pytest.approx(4, rel=0.15), name
        assert abs(fine) < 1e-3


def _patch() -> Structure:
    """A straight line in space cut at uneven points, its sections turned by 30 degrees and unlike about their axes."""
    along = np.array([0.36, -0.48, 0.8])
    points = np.array([0.0, 0.13, 0.5, 0.62, 1.3, 1.9])[:, None] * along
    side = np.cross(along, [0, 0, 1.0])
    turned = np.cos(np.pi / 6) * side / np.linalg.norm(side) + 0.5 * np.cross(along, side / np.linalg.norm(side))
    section = {"area": 0.7, "second_moment": (0.02, 0.05), "torsion_constant": 0.03, "shear_factor": (0.8, 0.4)}
    material = {"youngs_modulus": 3.0, "shear_modulus": 1.1, "density": 1.0}
    return frame(points, section, elements=2, material=material, support=[], local_y=np.tile(turned, (5, 1)))


_STRAINS = ["stretch", "twist", "bending about y", "bending about z", "shear along y", "shear along z"]


def _exact(strain: str, x: FloatArray, shear_flexible: bool) -> FloatArray:
    """Return displacements and rotations (n, 6) in local axes under a unit of force or couple at the end."""
    e, g, area, iy, iz, j = 3.0, 1.1, 0.7, 0.02, 0.05, 0.03
    length, zero = 1.9, np.zeros_like(x)
    u = {
        "stretch": [x / (e * area), zero, zero, zero, zero, zero],
        "twist": [zero, zero, zero, x / (g * j), zero, zero],
        "bending about y": [zero, zero, -(x**2) / (2 * e * iy), zero, x / (e * iy), zero],
        "bending about z": [zero, x**2 / (2 * e * iz), zero, zero, zero, x / (e * iz)],
    }
    turn = (length * x - x**2 / 2) / e
    cubic = (length * x**2 / 2 - x**3 / 6) / e
    u["shear along y"] = [zero, cubic / iz + shear_flexible * x / (0.8 * g * area), zero, zero, zero, turn / iz]
    u["shear along z"] = [zero, zero, cubic / iy + shear_flexible * x / (0.4 * g * area), zero, -turn / iy, zero]
    return np.array(u[strain]).T


@pytest.mark.parametrize("shear_flexible", [False, True], ids=["Euler-Bernoulli", "Timoshenko"])
@pytest.mark.parametrize("strain", _STRAINS)
def test_patch_of_uneven_elements_is_exact_for_constant_strain(strain: str, shear_flexible: bool) -> None:
    """The exact field is in equilibrium at every inner node, its end force is the unit, and inner points read it."""
    model = build_model(_patch(), shear_flexible=shear_flexible)
    axes = model.elements[0][2].axes(np.array([0.36, -0.48, 0.8]))
    x = model.nodes @ axes[0]
    moved = np.zeros(model.n_dofs)
    local = _exact(strain, x, shear_flexible)
    moved[model.dofs[:, :3]], moved[model.dofs[:, 3:]] = local[:, :3] @ axes, local[:, 3:] @ axes
    force = (model.stiffness @ moved)[model.dofs].reshape(-1, 2, 3) @ axes.T
    inner = (x > 1e-9) & (x < 1.9 - 1e-9)
    assert np.abs(force[inner]).max() < 1e-11
    # force or couple along x, y or z, as the strain is named
    kind, axis = {
        "stretch": (0, 0), "twist": (1, 0), "bending about y": (1, 1), "bending about z": (1, 2),
        "shear along y": (0, 1), "shear along z": (0, 2),
    }[strain]  # fmt: skip
    unit = np.zeros((2, 3))
    unit[kind, axis] = 1.0
    np.testing.assert_allclose(force[np.argmax(x)], unit, atol=1e-11)
    for place in (0.2, 0.55, 1.7):
        read = (model.read(place * axes[0]) @ moved).reshape(2, 3) @ axes.T
        np.testing.assert_allclose(read.ravel(), _exact(strain, np.array([place]), shear_flexible)[0], atol=1e-11)


@pytest.mark.parametrize("foot", [ALL, ("x", "y", "z", "rx", "rz")], ids=["clamped", "pinned"])
def test_portal_sway_buckling_load_matches_timoshenko_and_gere(foot: tuple[str, ...]) -> None:
    """Posts and beam alike: k L / tan k L = -6 on clamped feet, k L tan k L = 6 on pinned ones (1961, s. 2.4)."""
    stiffness, geometric = portal(foot, 8)
    load = 1 / np.linalg.eigvals(np.linalg.solve(stiffness, geometric)).real.max()
    k = brentq(lambda k: k + 6 * np.tan(k), 1.6, 3.1) if foot == ALL else brentq(lambda k: k * np.tan(k) - 6, 0.5, 1.5)
    assert load == pytest.approx(k**2, rel=(k / 8) ** 4 / 700 + 1e-7)  # the cubics: (k h)^4 / 720; the posts stretch

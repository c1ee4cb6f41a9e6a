"""Cantilever by the Rayleigh-Ritz method, independent of the package: the truth of tests on beams with masses.

Deflections are sums of a translation and a rotation at the clamp and of the clamped-free beam's own functions
(Young and Felgar 1949). Bernoulli beam of linearly varying thickness, clamp on two springs, point masses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

LENGTH, WIDTH, THICKNESS = 0.38, 0.04, 4.75e-3  # m
MODULUS, DENSITY = 70e9, 2700.0  # Pa, kg/m3
BEAM = DENSITY * LENGTH * WIDTH * THICKNESS  # kg
_FUNCTIONS = 14
_POINTS = 200  # of the Gauss-Legendre rule


@dataclass(frozen=True, kw_only=True)
class Clamp:
    """Flexible clamp and the body that moves with the beam there."""

    shifts: float = 6e-5  #: flexibility in deflection [L3 / (E I)]
    turns: float = 0.06  #: flexibility in rotation [L / (E I)]
    mass: float = 0.5  #: of the body near the clamp [beam masses]
    taper: float = 0.0  #: relative change of thickness over the length [-]


def frequencies(masses: Sequence[tuple[float, float]], clamp: Clamp, n: int = 5) -> np.ndarray:
    """Return the first bending frequencies (n,) with point masses, pairs of place [m] and mass [kg] [Hz]."""
    x, weight = np.polynomial.legendre.leggauss(_POINTS)
    x, weight = LENGTH * (x + 1) / 2, LENGTH * weight / 2
    value, curvature = _functions(x)
    thickness = THICKNESS * (1 + clamp.taper * (x / LENGTH - 0.5))
    rigidity = MODULUS * WIDTH * thickness**3 / 12
    stiffness = (curvature * weight * rigidity) @ curvature.T
    mass = (value * weight * DENSITY * WIDTH * thickness) @ value.T
    unit = MODULUS * WIDTH * THICKNESS**3 / 12
    stiffness[0, 0] += unit / LENGTH**3 / clamp.shifts
    stiffness[1, 1] += unit / LENGTH / clamp.turns / LENGTH**2  # the second function turns by 1 / L
    for at, kilograms in (*masses, (0.0, clamp.mass * BEAM)):
        here = _functions(np.array([at]))[0][:, 0]
        mass += kilograms * np.outer(here, here)
    square = eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, n - 1))
    return np.asarray(np.sqrt(square) / (2 * np.pi))


def _functions(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return functions (n, n_points) and their curvatures [1/m2] at places x (n_points,) [m]."""
    value, curvature = [np.ones(len(x)), x / LENGTH], [np.zeros(len(x)), np.zeros(len(x))]
    for k in range(_FUNCTIONS):
        about = (k + 0.5) * np.pi
        root = brentq(lambda b: np.cos(b) + 1 / np.cosh(b), about - 0.5, about + 0.5)
        s, share = root * x / LENGTH, (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))
        # cosh - share * sinh without the cancellation of large arguments
        falls = np.exp(-s) + (1 - share) * np.sinh(s)
        value.append(falls - np.cos(s) + share * np.sin(s))
        curvature.append((root / LENGTH) ** 2 * (falls + np.cos(s) - share * np.sin(s)))
    return np.array(value), np.array(curvature)


def structure_file(masses: Sequence[tuple[float, float]], clamp: Clamp) -> str:
    """Return the structure file of a cantilever of constant thickness on a clamp, with point masses."""
    unit = MODULUS * WIDTH * THICKNESS**3 / 12
    bodies = "".join(
        f"[[body]]\nat = [{at}, 0, 0]\nmass = {kilograms}\n" for at, kilograms in (*masses, (0.0, clamp.mass * BEAM))
    )
    return f"""
name = "cantilever"
[mesh]
element_length = 0.0095
[material.metal]
youngs_modulus = {MODULUS}
poisson_ratio = 0.33
density = {DENSITY}
[section.strip]
shape = "rectangle"
width = {WIDTH}
height = {THICKNESS}
[[member]]
name = "beam"
from = [0, 0, 0]
to = [{LENGTH}, 0, 0]
material = "metal"
section = "strip"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "rx", "rz"]
stiffness = {{ z = {unit / LENGTH**3 / clamp.shifts}, ry = {unit / LENGTH / clamp.turns} }}
[[sensor]]
channel = "tip_z"
at = [{LENGTH}, 0, 0]
direction = [0, 0, 1]
[[sensor]]
channel = "middle_z"
at = [{LENGTH / 2}, 0, 0]
direction = [0, 0, 1]
{bodies}"""

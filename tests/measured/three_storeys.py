"""A measured frame of three floors on thin legs, with documented masses: its modes and a simulation at its word."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq import FloatArray
from oma import ComplexArray, ModalEstimate, Resonance, fit_resonance
from updater import Structure, parse_structure
from updater.modal_data import ModalMass, mass_of_modes

BANDS = ((5.5, 7.5), (16.0, 19.0), (24.5, 28.5))  # Hz, a mode each
FLOOR = 5.201  # kg, documented for each
CHANNELS = ("floor1_x", "floor2_x", "floor3_x")
LEG = 0.1533  # m, documented, between floors
_GRAVITY = 9.81

_LEGS = """
name = "three storeys"
[material.aluminium]
youngs_modulus = 70e9
poisson_ratio = 0.33
density = 2700
[section.legs]                            # four of 25 mm x 3 mm, which bend about their thin side
area = 3e-4
second_moment = [2.25e-10, 1.5625e-8]
torsion_constant = 9e-10
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
"""


def simulation() -> Structure:
    """Return the frame as documented: floors that only shift, on legs clamped to them, floors' weight in the legs.

    Heights are those of the legs alone: the floors between them are rigid, and neither turn nor rise.
    """
    text = _LEGS
    for k in range(3):
        top = (k + 1) * LEG
        text += f"""
[[member]]
name = "storey_{k + 1}"
from = [0, 0, {k * LEG}]
to = [0, 0, {top}]
material = "aluminium"
section = "legs"
elements = 8
local_y = [0, 1, 0]
preload = {-(3 - k) * FLOOR * _GRAVITY}
[[support]]
at = [0, 0, {top}]
fixed = ["y", "z", "rx", "ry", "rz"]
[[body]]
at = [0, 0, {top}]
mass = {FLOOR}
[[sensor]]
channel = "{CHANNELS[k]}"
at = [0, 0, {top}]
direction = [1, 0, 0]
"""
    return parse_structure(text)


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """Results of three tests, a force at another floor in each."""

    resonances: tuple[tuple[Resonance, ...], ...]  #: by test, by mode; residues at the three floors
    plateau: FloatArray  #: (n_tests,) accelerance at the force, 100 to 125 Hz, far above the three modes [1/kg]

    def normalised(self) -> FloatArray:
        """Return mass-normalised shapes (n_tests, n_modes, n_floors): residues are products with that at the force."""
        found = np.array(
            [[_real(r.residue) / np.sqrt(abs(r.residue[k])) for r in test] for k, test in enumerate(self.resonances)]
        )
        sign = np.sign((found * found[:1]).sum(axis=2, keepdims=True))
        return np.asarray(found * sign)

    def floor_masses(self) -> ModalMass:
        """Return the mass matrix, by the mean of the tests' shapes; its deviations by how the tests differ.

        Leakage and the sensors' phases make a test's shape wrong by per cents and alike at its floors, far beyond each
        fit's deviation: three tests determine that to half its value.
        """
        shape = self.normalised()
        n = len(shape)
        off = shape - shape.mean(axis=0)
        covariance = np.einsum("tmc,tmd->mcd", off, off) / (n - 1) / n
        return mass_of_modes(shape.mean(axis=0), covariance)

    def estimates(self) -> list[ModalEstimate]:
        """Return each test as if it were a window of a record."""
        return [_estimate(test) for test in self.resonances]


def read_frame(folder: Path) -> Frame:
    """Read the nine frequency responses and fit the three modes of each force."""
    tests = [np.loadtxt(folder / f"acc_frf_force_floor{k}.csv", delimiter=";", dtype=complex) for k in (1, 2, 3)]
    line = tests[0][:, 0].real
    high = (line > 100) & (line < 125)
    return Frame(
        resonances=tuple(tuple(fit_resonance(line, test[:, 1:], band) for band in BANDS) for test in tests),
        plateau=np.array([np.abs(test[high, 1 + k]).mean() for k, test in enumerate(tests)]),
    )


def _real(residue: ComplexArray) -> FloatArray:
    """Return residues with the sign of their real parts: leakage turns all of a mode by one phase."""
    return np.asarray(np.abs(residue) * np.sign(residue.real))


def _estimate(test: tuple[Resonance, ...]) -> ModalEstimate:
    residue = np.array([_real(r.residue) for r in test])
    norm = np.linalg.norm(residue, axis=1, keepdims=True)
    return ModalEstimate(
        channels=CHANNELS,
        frequency=np.array([r.frequency for r in test]),
        frequency_std=np.array([r.frequency_std for r in test]),
        damping=np.array([r.damping for r in test]),
        damping_std=np.array([r.damping_std for r in test]),
        shape=(residue / norm).astype(complex),
        shape_std=np.array([r.residue_std for r in test]) / norm,
        support=np.ones(len(test)),
        law_ratio=np.ones(len(test)),
        start=0,
        end=32_000_000_000,  # 1 / 0.03125 Hz
    )

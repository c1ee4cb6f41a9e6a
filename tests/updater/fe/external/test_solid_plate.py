"""A thick plate on four pads: the model is of OpenSees' shells, the measured one of scikit-fem's solids.

The solid has 20-node hexahedra; pads and a body are on patches of its lower and upper face. The shells have springs at
nodes as pads, and a body is a point of their middle plane.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementHexS2, ElementVector, FacetBasis, MeshHex
from skfem.helpers import ddot, dot, sym_grad, trace

from daq import FloatArray
from oma import ModalEstimate
from tests.support.opensees import needs_opensees, ops
from tests.support.updater.frames import noisy_estimates, unmoved
from updater import DiagnosisResult, diagnose, learn_reference, load_structure, save_matrices, stack_tracks
from updater.fe import opensees_matrices

pytestmark = needs_opensees

LENGTH, WIDTH, THICKNESS = 0.60, 0.40, 0.020  # m: along x, y and z
MODULUS, POISSON, DENSITY = 70e9, 0.33, 2700.0
PAD = 0.05  # m, side of the square of a pad or of a body
FOOT = 2e6  # N/m, of each pad along z
SIDEWAYS = 0.05  # times that along x and y
FEET = {"foot_a": (0.05, 0.05), "foot_b": (0.50, 0.05), "foot_c": (0.10, 0.35), "foot_d": (0.55, 0.30)}  # no symmetry
SENSORS = [(x, y) for x in (0.0, 0.2, 0.4, 0.6) for y in (0.0, 0.2, 0.4)]
CHANNELS = tuple(f"z{k}" for k in range(len(SENSORS)))
LINE = "y = 0.25"  # along which a body is sought
BODY = (0.375, 0.25)  # m
N_MODES = 8
IN_PLANE = 3  # further modes, in which the plate moves in its plane, which sensors along z do not measure


def write_plate(folder: Path) -> Path:
    """Write the structure file and the matrices of shells with edges of half a pad."""
    size = PAD / 2
    along, across = round(LENGTH / size), round(WIDTH / size)
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.section("ElasticMembranePlateSection", 1, MODULUS, POISSON, THICKNESS, DENSITY)
    tag = np.arange(1, (along + 1) * (across + 1) + 1).reshape(along + 1, across + 1)
    for i, j in np.ndindex(tag.shape):
        ops.node(int(tag[i, j]), size * i, size * j, 0.0)
    groups: dict[str, list[int]] = {"left": [], "right": []}
    for number, (i, j) in enumerate(np.ndindex(along, across), start=1):
        corners = (tag[i, j], tag[i + 1, j], tag[i + 1, j + 1], tag[i, j + 1])
        ops.element("ShellMITC4", number, *map(int, corners), 1)
        groups["left" if 2 * i < along else "right"].append(number)
    for share in (1, 2, 4):
        ops.uniaxialMaterial("Elastic", share, FOOT * share / 16)
        ops.uniaxialMaterial("Elastic", 10 * share, SIDEWAYS * FOOT * share / 16)
    ground = 100_000
    for name, (x, y) in FEET.items():
        groups[name] = []
        for i, j in np.ndindex(3, 3):  # a pad is two elements long and wide: a quarter of it is at its middle node
            ground += 1
            column, row = round(x / size) + i - 1, round(y / size) + j - 1
            share = (1, 2, 1)[i] * (1, 2, 1)[j]
            ops.node(ground, size * column, size * row, 0.0)
            ops.fix(ground, 1, 1, 1, 1, 1, 1)
            ends = (ground, int(tag[column, row]))
            ops.element("zeroLength", ground, *ends, "-mat", 10 * share, 10 * share, share, "-dir", 1, 2, 3)
            groups[name].append(ground)
    save_matrices(folder / "plate.npz", opensees_matrices(ops, groups))
    ops.wipe()
    text = ['name = "plate"\n[external]\nmatrices = "plate.npz"\n']
    text += [f"[external.group.{name}]\nuncertainty = {0.3 if name in FEET else 0.03}\n" for name in groups]
    text.append(f'[[member]]\nname = "{LINE}"\nfrom = [0, {BODY[1]}, 0]\nto = [{LENGTH}, {BODY[1]}, 0]\n')
    for channel, (x, y) in zip(CHANNELS, SENSORS, strict=True):
        text.append(f'[[sensor]]\nchannel = "{channel}"\nat = [{x}, {y}, 0]\ndirection = [0, 0, 1]\n')
    (folder / "plate.toml").write_text("\n".join(text), encoding="utf-8")
    return folder / "plate.toml"


@dataclass(frozen=True, kw_only=True)
class Plate:
    """The measured plate, with hidden effects."""

    modulus: float = MODULUS
    feet: Mapping[str, float] = field(default_factory=dict)  #: factors of their stiffness
    body: float = 0.0  #: mass on the upper face [kg]

    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Return frequencies (n_modes,) [Hz] and shapes (n_modes, n_channels) of unit norm."""
        basis, stiffness, mass = _matrices()
        stiffness = self.modulus / MODULUS * stiffness
        for name, at in FEET.items():
            stiffness = stiffness + self.feet.get(name, 1.0) * FOOT / PAD**2 * _patch(at, -THICKNESS / 2, SIDEWAYS)
        mass = mass + self.body / PAD**2 * _patch(BODY, THICKNESS / 2, 1.0)
        value, vector = eigsh(stiffness, N_MODES + IN_PLANE, mass, sigma=0.0, v0=np.ones(basis.N))
        shape = vector[[_row(*at) for at in SENSORS]].T
        moved = np.linalg.norm(shape, axis=1)
        seen = np.flatnonzero(moved > 0.1 * moved.max())
        assert len(seen) == N_MODES
        return np.sqrt(value[seen]) / (2 * np.pi), shape[seen] / moved[seen, None]


@cache
def _matrices() -> tuple[Basis, Any, Any]:
    """Return basis, stiffness without pads, and mass."""
    lines = [np.linspace(0.0, length, round(2 * length / PAD) + 1) for length in (LENGTH, WIDTH)]
    mesh = MeshHex.init_tensor(*lines, np.array([-0.5, 0.0, 0.5]) * THICKNESS)
    shear, lame = MODULUS / (2 * (1 + POISSON)), MODULUS * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))

    def elastic(u: Any, v: Any, _: Any) -> FloatArray:
        a, b = sym_grad(u), sym_grad(v)
        return np.asarray(2 * shear * ddot(a, b) + lame * trace(a) * trace(b))

    basis = Basis(mesh, ElementVector(ElementHexS2()), intorder=3)
    mass = BilinearForm(_inert).assemble(Basis(mesh, basis.elem, intorder=4))
    return basis, BilinearForm(elastic).assemble(basis), DENSITY * mass


def _inert(u: Any, v: Any, _: Any) -> FloatArray:
    return np.asarray(dot(u, v))


@cache
def _patch(at: tuple[float, float], z: float, sideways: float) -> Any:
    """Return the matrix of a unit per area, and `sideways` along x and y, on a square of the face at z."""
    basis = _matrices()[0]

    def inside(p: FloatArray) -> Any:
        return (np.abs(p[0] - at[0]) < PAD / 2) & (np.abs(p[1] - at[1]) < PAD / 2) & np.isclose(p[2], z)

    def acting(u: Any, v: Any, _: Any) -> FloatArray:
        return np.asarray(u[2] * v[2] + sideways * (u[0] * v[0] + u[1] * v[1]))

    facets = basis.mesh.facets_satisfying(inside, boundaries_only=True)
    assert len(facets) == 4
    return BilinearForm(acting).assemble(FacetBasis(basis.mesh, basis.elem, facets=facets, intorder=4))


def _row(x: float, y: float) -> int:
    """Return the DOF along z of the vertex at a point of the middle plane."""
    basis = _matrices()[0]
    vertex = int(np.argmin(np.linalg.norm(basis.mesh.p - np.array([[x], [y], [0.0]]), axis=0)))
    return int(basis.nodal_dofs[2, vertex])


def _windows(modes: tuple[FloatArray, FloatArray], n: int, random: np.random.Generator) -> list[ModalEstimate]:
    """Return windows with 0.03 % of error in frequency and 0.5 % of unit norm in shape."""
    return noisy_estimates(*modes, CHANNELS, n, random, std=np.full(N_MODES, 3e-4), shape_std=5e-3)


#: truth; cause, place and parameter that are expected
EFFECTS: dict[str, tuple[dict[str, Any], list[tuple[str, str, str, float]]]] = {
    "loosened foot": ({"feet": {"foot_b": 0.5}}, [("local_stiffness", "foot_b", "loss", 0.5)]),
    "body": ({"body": 0.1}, [("added_mass", LINE, "mass", 0.1)]),
    "nothing": ({}, []),
}


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the structure file of the shells."""
    return write_plate(tmp_path_factory.mktemp("plate"))


def _diagnosed(file: Path, effect: str, seed: int) -> DiagnosisResult:
    """Return the diagnosis of four windows after eight before; the modulus of the measured plate scatters by 2 %."""
    random = np.random.default_rng(seed)
    modulus = MODULUS * (1 + 0.02 * random.standard_normal())
    before = _windows(Plate(modulus=modulus).modes(), 8, random)
    after = _windows(Plate(modulus=modulus, **EFFECTS[effect][0]).modes(), 4, random)
    reference = learn_reference(load_structure(file), before, unmoved(8, N_MODES))
    return diagnose(reference, reference.mean_of(stack_tracks(after, unmoved(4, N_MODES))))


@pytest.mark.thorough
@pytest.mark.parametrize(("effect", "seed"), [(effect, seed) for seed in (1, 2, 3, 4) for effect in EFFECTS])
def test_effects_in_a_solid_are_named_by_a_model_of_shells(plate: Path, effect: str, seed: int) -> None:
    """Of half a foot, 51.6 to 52.0 % are found (measured), as shells are no solids: the loss is allowed 5 % of it."""
    found = _diagnosed(plate, effect, seed).diagnosis
    named = {(c.cause, (c.where and c.where.member) or ""): dict(c.parameters) for c in found.causes}
    print(f"seed {seed}", found.verdict, named)
    expected = EFFECTS[effect][1]
    assert found.verdict == ("explained" if expected else "nothing_to_explain")
    assert set(named) == {(cause, place) for cause, place, *_ in expected}
    for cause, place, key, value in expected:
        quantity = named[cause, place][key]
        assert quantity.std
        assert abs(quantity.value - value) < max(3 * quantity.std, 0.05 * value)

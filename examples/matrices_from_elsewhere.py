"""A model from another program: stiffness, mass and a DOF table in files, and a mass located along a line of its nodes.

The other program is forty lines of plane-stress finite elements for a steel strip on edge, clamped at its left end:
nodes without rotations, as solids have them. The strip that is measured is another one: a finer mesh, 2 % stiffer.
"""

import tempfile
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from daq import FloatArray
from oma import ModalEstimate
from updater import Matrices, learn_reference, load_structure, locate_mass, save_matrices, stack_tracks

LENGTH, HEIGHT, THICKNESS, DENSITY, POISSON = 1.0, 0.05, 0.005, 7850.0, 0.3  # m, kg/m3
SENSORS = {f"y{k}": 0.1 * k for k in (3, 5, 6, 8, 10)}  # channel -> m from the clamp, across the strip
BODY, PLACE = 0.060, 0.7  # kg, m from the clamp
MODES = 4


def quadrilateral(a: float, b: float, modulus: float) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and mass (8, 8) of a rectangle a x b in plane stress, two displacements a corner."""
    stress = modulus / (1 - POISSON**2) * np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
    stiffness, mass = np.zeros((8, 8)), np.zeros((8, 8))
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for point in corner / np.sqrt(3):
        n = np.prod(1 + corner * point, axis=1) / 4
        slope = corner * (1 + corner * point)[:, ::-1] / 4 * [2 / a, 2 / b]
        strain, shape = np.zeros((3, 8)), np.zeros((2, 8))
        strain[0, 0::2] = strain[2, 1::2] = slope[:, 0]
        strain[1, 1::2] = strain[2, 0::2] = slope[:, 1]
        shape[0, 0::2] = shape[1, 1::2] = n
        stiffness += strain.T @ stress @ strain * THICKNESS * a * b / 4
        mass += shape.T @ shape * DENSITY * THICKNESS * a * b / 4
    return stiffness, mass


def strip(across: int, modulus: float, body: float = 0.0) -> Matrices:
    """Return the strip of squares, some across its height, with a body on its axis."""
    along = round(LENGTH / HEIGHT * across)
    number = np.arange((along + 1) * (across + 1)).reshape(along + 1, across + 1)
    y = np.linspace(-HEIGHT / 2, HEIGHT / 2, across + 1)
    nodes = np.array([(x, v, 0.0) for x in np.linspace(0, LENGTH, along + 1) for v in y])
    corners = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=2).reshape(-1, 4)
    rows = np.asarray(2 * corners[:, :, None] + [0, 1], np.int32).reshape(-1, 8)
    row, column = np.repeat(rows, 8, axis=1).ravel(), np.tile(rows, 8).ravel()
    blocks = quadrilateral(LENGTH / along, HEIGHT / across, modulus)
    k, m = (sparse.csc_array((np.tile(block.ravel(), len(rows)), (row, column))) for block in blocks)
    m = m + sparse.diags_array(body * np.repeat(np.linalg.norm(nodes - [PLACE, 0, 0], axis=1) < 1e-9, 2).astype(float))
    free = np.arange(2 * (across + 1), m.shape[0])  # the clamped edge has no rows
    dofs = np.full((len(nodes) - across - 1, 6), -1, np.int32)
    dofs[:, :2] = np.arange(len(free)).reshape(-1, 2)
    return Matrices(stiffness=k[free][:, free], mass=m[free][:, free], nodes=nodes[across + 1 :], dofs=dofs)


def measured(real: Matrices, n: int, random: np.random.Generator) -> list[ModalEstimate]:
    """Return windows with the real strip's modes, 0.05 % wrong in frequency and 1 % in shape."""
    value, vector = eigsh(real.stiffness, 5, real.mass, sigma=0.0, v0=np.ones(real.mass.shape[0]))
    places = np.array([[x, 0, 0] for x in SENSORS.values()])
    at = [int(np.argmin(np.linalg.norm(real.nodes - place, axis=1))) for place in places]
    shape = vector[real.dofs[at, 1]].T
    length = np.linalg.norm(shape, axis=1, keepdims=True)
    bending = np.flatnonzero(length > 0.1 * length.max())  # sensors across the strip see nothing of its lengthening
    shape, frequency = (shape / length)[bending], np.sqrt(value[bending]) / (2 * np.pi)
    return [
        ModalEstimate(
            channels=tuple(SENSORS),
            frequency=frequency * (1 + 5e-4 * random.standard_normal(MODES)),
            frequency_std=5e-4 * frequency,
            damping=np.full(MODES, 0.005),
            damping_std=np.full(MODES, 0.001),
            shape=(shape + 0.005 * random.standard_normal(shape.shape)).astype(complex),
            shape_std=np.full(shape.shape, 0.005),
            support=np.ones(MODES),
            law_ratio=np.ones(MODES),
            start=0,
            end=60 * 10**9,
        )
        for _ in range(n)
    ]


STRUCTURE = """
name = "strip on edge"

[external]
stiffness = "stiffness.mtx"
mass = "mass.mtx"
dofs = "dofs.csv"        # node, x, y, z, axis of every row

[[member]]               # a straight line of nodes: where masses are sought and sensors may stand
name = "axis"
from = [0, 0, 0]
to = [1, 0, 0]

[[support]]              # the clamp, of which the matrices have no rows
at = [0, 0, 0]
fixed = ["x", "y"]
""" + "".join(
    f'[[sensor]]\nchannel = "{name}"\nat = [{x:.1f}, 0, 0]\ndirection = [0, 1, 0]\n' for name, x in SENSORS.items()
)

random = np.random.default_rng(1)
with tempfile.TemporaryDirectory() as folder:
    save_matrices(Path(folder), strip(4, 210e9))  # what the other program writes
    (Path(folder) / "structure.toml").write_text(STRUCTURE, encoding="utf-8")
    tracks = [np.arange(MODES)] * 8
    reference = learn_reference(
        load_structure(Path(folder) / "structure.toml"), measured(strip(10, 1.02 * 210e9), 8, random), tracks
    )
    event = reference.mean_of(stack_tracks(measured(strip(10, 1.02 * 210e9, BODY), 4, random), tracks[:4]))
    found = locate_mass(reference, event)

(stiffness,) = reference.calibration.parameters
print(f"the matrices' stiffness times {stiffness.value:.3f} ± {stiffness.std:.3f}")
print(f"{1e3 * found.mass:.1f} ± {1e3 * found.mass_std:.1f} g at {found.distance:.3f} ± {found.distance_std:.3f} m")
print(f"it was {1e3 * BODY:.0f} g at {PLACE} m")

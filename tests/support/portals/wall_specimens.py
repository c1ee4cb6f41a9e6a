"""Frames of two square tubes, a branch welded to a wall of the chord, and the files of their owners.

The truth is of solids: the chord's wall bends where the branch ends. The file has beams that meet at a point.
"""

import numpy as np
from skfem import MeshHex

from daq import FloatArray
from tests.support.portals.block_specimens import (
    MODULUS,
    Specimen,
    draw_steel,
    file_text,
    grid_lines,
    solid_specimen,
)

_CAP = 0.004  # m: thickness of the plates that close the ends


def draw_tubes(seed: int) -> Specimen:
    """Draw a chord clamped at its foot and a branch: dimensions, walls, modulus, density and foot."""
    random = np.random.default_rng((seed, 6))
    wide, narrow = random.uniform(0.05, 0.07), random.uniform(0.5, 0.8)
    wall, other_wall = random.uniform(0.002, 0.004), random.uniform(0.002, 0.003)
    height, at, length = random.uniform(0.8, 1.1), random.uniform(0.55, 0.8), random.uniform(0.4, 0.6)
    half, branch = wide / 2, narrow * wide / 2
    joint = at * height
    fine = wide / 4
    across = grid_lines(
        (-half, -half + wall, 1),
        (-half + wall, -branch, fine),
        (-branch, -branch + other_wall, 1),
        (-branch + other_wall, branch - other_wall, fine),
        (branch - other_wall, branch, 1),
        (branch, half - wall, fine),
        (half - wall, half, 1),
    )
    mesh = MeshHex.init_tensor(
        _joined(_rim(half, wall, fine), _graded(half, half + length - _CAP), [half + length]),
        across,
        _joined(_graded(joint - half, 0.0), joint + across, _graded(joint + half, height - _CAP), [height]),
    )
    x, y, z = mesh.p[:, mesh.t].mean(1)
    inside = (abs(x) < half - wall) & (abs(y) < half - wall) & (z < height - _CAP)
    chord = (abs(x) < half) & ~inside
    off = z - joint
    hollow = (abs(y) < branch - other_wall) & (abs(off) < branch - other_wall) & (x < half + length - _CAP)
    arm = (x > half) & (abs(y) < branch) & (abs(off) < branch) & ~hollow
    mesh = mesh.restrict(np.flatnonzero(chord | arm))
    modulus, density = draw_steel(random)
    sections = {"chord": (wide, wall), "branch": (2 * branch, other_wall)}
    text = file_text(
        {
            name: f'shape = "box"\nwidth = {size:.6f}\nheight = {size:.6f}\nthickness = {thick:.6f}'
            for name, (size, thick) in sections.items()
        },
        {"column": ("chord", (0, 0, 0), (0, 0, height)), "beam": ("branch", (0, 0, joint), (half + length, 0, joint))},
        [
            ((0, 0, height), 7850 * _CAP * (wide - 2 * wall) ** 2, 0.0),
            ((half + length, 0, joint), 7850 * _CAP * 4 * (branch - other_wall) ** 2, 0.0),
        ],
    )
    moment = 2 / 3 * wall * wide**3
    return solid_specimen(
        mesh,
        modulus,
        density,
        text=text,
        foot=MODULUS * moment / height / random.uniform(0.01, 0.03, 3),
        facts={
            "wide": wide,
            "narrow": narrow,
            "wall": wall,
            "branch_wall": other_wall,
            "length": length,
            "joint": joint,
        },
    )


def _rim(half: float, wall: float, fine: float) -> FloatArray:
    """Return lines across a tube without a branch."""
    return grid_lines((-half, -half + wall, 1), (-half + wall, half - wall, fine), (half - wall, half, 1))


def _joined(*lines: FloatArray | list[float]) -> FloatArray:
    return np.unique(np.round(np.concatenate(lines), 7))


def _graded(start: float, end: float) -> FloatArray:
    """Return lines from a joint on, whose distance grows to 60 mm."""
    sizes, total = [0.015], abs(end - start)
    while sum(sizes) < total:
        sizes.append(min(1.7 * sizes[-1], 0.06))
    found = np.concatenate([[0.0], np.cumsum(sizes)]) * total / sum(sizes)
    return np.asarray(np.round(start + np.sign(end - start) * found, 7))

"""The steel frame of the Bauhaus-Universität Weimar: set-ups measured one after the other, identified and merged.

Prints the tables of the documentation; FOLDER holds measurement_01.npz, channel_dofs_01.txt, ..., grid.txt, lines.txt.

Usage: python benchmarks/oma/weimar.py FOLDER [PICTURE.png], or make bench-weimar ARGUMENTS=FOLDER
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from daq import FloatArray, IndexArray, read_data
from daq.files import differentiated
from oma import ModalEstimate, identify, merge, mpc

PUBLISHED = (1.2283, 1.4358, 2.1000, 4.0175, 4.7704, 6.6824, 7.6157, 9.6653, 12.1663, 12.5979, 13.8545)  # Hz
HIGHEST = 15.0  # Hz: above it nothing is published
REFERENCES = ("ref_x", "ref_y", "ref_z")
_MOVED, _STILL, _LONGEST = "#1565c0", "#b0bec5", 9.0  # the last: of an arrow [cm]


@dataclass(frozen=True, eq=False)
class Setup:
    """One set-up: a node, and the beams of the three lasers that meet there."""

    node: int
    beams: FloatArray  #: (3, 3) unit vectors, a row a laser
    estimate: ModalEstimate


def main(folder: Path, picture: Path | None) -> None:
    """Identify every set-up, merge, and print the comparison."""
    numbers = sorted(int(file.stem[-2:]) for file in folder.glob("measurement_*.npz"))
    began = time.process_time()
    setups = [identified(folder, number) for number in numbers]
    merged = merge([setup.estimate for setup in setups], REFERENCES)
    seconds = time.process_time() - began
    nodes = np.loadtxt(folder / "grid.txt", skiprows=1)[:, 1:]  # cm
    lines = np.loadtxt(folder / "lines.txt", skiprows=1, dtype=np.intp) - 1
    print_setups(setups)
    print_merged(merged, rigidity(merged, setups, nodes))
    print(f"\n{seconds:.1f} CPU s for {len(setups)} set-ups of 240 s and the merging")
    if picture:
        draw(picture, nodes, lines, merged, setups)


def identified(folder: Path, number: int) -> Setup:
    """Read one set-up, turn its lasers' velocities into accelerations and identify it."""
    rows = (folder / f"channel_dofs_{number:02d}.txt").read_text().splitlines()[1:4]
    node = int(rows[0].split()[1])
    azimuth, elevation = np.radians([[float(angle) for angle in row.split()[2:4]] for row in rows]).T
    flat = np.cos(elevation)
    beams = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    lasers = [f"{beam}_{node}" for beam in ("left", "right", "top")]
    recording = read_data(folder / f"measurement_{number:02d}.npz")
    names = (*lasers, *REFERENCES)
    channels = tuple(replace(c, name=name) for c, name in zip(recording.channels, names, strict=True))
    return Setup(node, beams, identify(differentiated(replace(recording, channels=channels), lasers)))


def print_setups(setups: list[Setup]) -> None:
    """Print the distance of each set-up from the published values."""
    print("| set-up | node | modes below 15 Hz | published modes found | largest difference | in standard deviations |")
    print("| --- | --- | --- | --- | --- | --- |")
    for number, setup in enumerate(setups, 1):
        below = setup.estimate.frequency < HIGHEST
        frequency, std = setup.estimate.frequency[below], setup.estimate.frequency_std[below]
        nearest = np.abs(frequency[:, None] - np.array(PUBLISHED)).argmin(axis=0)
        off = frequency[nearest] / PUBLISHED - 1
        z = (frequency[nearest] - PUBLISHED) / std[nearest]
        print(
            f"| {number} | {setup.node} | {len(frequency)} | {np.count_nonzero(np.abs(off) < 3e-3)} "
            f"| {100 * np.abs(off).max():.2f} % | {np.abs(z).max():.1f} |"
        )


def print_merged(merged: ModalEstimate, rigid: FloatArray) -> None:
    """Print the merged modes, and how far floors are from moving as rigid plates."""
    print(
        "\n| mode | published [Hz] | merged [Hz] | difference | damping [%] | MPC "
        "| residual of the rigid floor motion |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for k in np.flatnonzero(merged.frequency < HIGHEST):
        published = min(PUBLISHED, key=lambda f: abs(f - merged.frequency[k]))
        print(
            f"| {k + 1} | {published:.4f} | {merged.frequency[k]:.4f} ± {merged.frequency_std[k]:.4f} "
            f"| {100 * (merged.frequency[k] / published - 1):+.3f} % "
            f"| {100 * merged.damping[k]:.2f} ± {100 * merged.damping_std[k]:.2f} "
            f"| {float(mpc(merged.shape[k])):.3f} | {100 * rigid[k]:.1f} % |"
        )


def displacements(merged: ModalEstimate, setups: list[Setup]) -> FloatArray:
    """Return the motion in x, y and z (n_modes, n_setups, 3) of the nodes that the lasers met."""
    real = merged.shape.real[:, len(REFERENCES) :].reshape(merged.n_modes, len(setups), 3)
    return np.stack([np.linalg.solve(s.beams, real[:, i].T).T for i, s in enumerate(setups)], axis=1)


def floors(setups: list[Setup]) -> Iterator[list[int]]:
    """Yield the set-ups on each floor that was measured at two corners or more."""
    for floor in sorted({_floor(s) for s in setups}):
        here = [i for i, s in enumerate(setups) if _floor(s) == floor]
        if len(here) > 1:
            yield here


def _floor(setup: Setup) -> int:
    return (setup.node - 1) // 4  # nodes are numbered around each floor, from below


def plate(corners: FloatArray) -> FloatArray:
    """Return the horizontal motion (2 n_corners, 3) of corners of a rigid plate for shifts in x and y and a turn."""
    return np.vstack([[[1, 0, -y], [0, 1, x]] for x, y in corners[:, :2]])


def rigidity(merged: ModalEstimate, setups: list[Setup], nodes: FloatArray) -> FloatArray:
    """Return for each mode the share (rms) of its corners' motion that is no rigid motion of a floor."""
    moved = displacements(merged, setups)[..., :2]
    left, total = np.zeros(merged.n_modes), np.zeros(merged.n_modes)
    for here in floors(setups):
        base = plate(nodes[[setups[i].node - 1 for i in here]])
        motion = moved[:, here].reshape(merged.n_modes, -1).T
        rest = motion - base @ np.linalg.lstsq(base, motion, rcond=None)[0]
        left, total = left + np.sum(rest**2, axis=0), total + np.sum(motion**2, axis=0)
    return np.sqrt(left / total)


def draw(path: Path, nodes: FloatArray, lines: IndexArray, merged: ModalEstimate, setups: list[Setup]) -> None:
    """Draw each merged mode: the lower part of the frame, how its nodes move, and the rigid plates that fit them."""
    moved, modes = displacements(merged, setups), np.flatnonzero(merged.frequency < HIGHEST)
    highest = 1.15 * max(nodes[s.node - 1, 2] for s in setups)
    figure = Figure(figsize=(13, 5.6), layout="constrained")
    for place, k in enumerate(modes):
        axes = figure.add_subplot(2, (len(modes) + 1) // 2, place + 1, projection="3d")
        seen = nodes[lines][(nodes[lines][:, :, 2] <= highest).all(axis=1)]
        axes.add_collection3d(Line3DCollection(seen, colors=_STILL, linewidths=0.8))
        size = _LONGEST / np.linalg.norm(moved[k], axis=-1).max()
        for here in floors(setups):
            own = [setups[i].node - 1 for i in here]
            turn = np.linalg.lstsq(plate(nodes[own]), moved[k, here, :2].ravel(), rcond=None)[0]
            corners = nodes[4 * _floor(setups[here[0]]) :][:4].copy()
            corners[:, :2] += size * (plate(corners) @ turn).reshape(-1, 2)
            axes.add_collection3d(Poly3DCollection([corners], facecolor=_MOVED, alpha=0.25))
        for i, setup in enumerate(setups):
            arrow = size * moved[k, i]
            axes.quiver(*nodes[setup.node - 1], *arrow, color=_MOVED, linewidth=1.8, arrow_length_ratio=0.3)
        axes.set(xlim=(-22, 22), ylim=(-22, 22), zlim=(0, highest))
        axes.set_box_aspect((44, 44, highest), zoom=1.05)
        axes.set_axis_off()
        axes.set_title(f"{k + 1}: {merged.frequency[k]:.3f} Hz", fontsize=11)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)

"""Cost of size: assembly, modes, eq. 7, increments and localization, from the T-frame to 1e5 degrees of freedom.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python benchmarks/updater/scale.py [--largest N]

The large structures are lattices of the T-frame's tube, 1.0 x 1.1 x 0.9 m per cell, clamped at the bottom: every node
has six elements, which fills a factor more than any building's frame does. CPU seconds of one thread. PyPardiso is used
where it is installed (`pip install 'modalwatch[cholesky]'`), with SuperLU for comparison; SuperLU alone otherwise.
"""

import argparse
import itertools
import resource
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from daq import FloatArray
from oma import ModalEstimate
from tests.support.updater.frames import as_estimate, t_frame, t_truth, unmoved
from updater import (
    Body,
    MassUpdater,
    Matrices,
    ModalMean,
    Model,
    Reference,
    Structure,
    build_model,
    learn_reference,
    locate_mass,
    parse_structure,
    save_matrices,
    stack_tracks,
    t_structure_toml,
)
from updater.fe import Modes
from updater.fe.eigen import lowest_modes
from updater.one_step.update import normalised_increments, update_mass

CELL = np.array([1.0, 1.1, 0.9])  # m: no two directions alike, so that no two modes are
N_MODES = 20
MEASURED = 12
SENSORS = 32
MASS = 0.0002  # of the structure's: ten times the mass of the tube it sits on
T = TypeVar("T")


def timed(work: Callable[[], T], repeat: int = 1) -> tuple[float, T]:
    """Return CPU seconds, the least of some runs, and the result."""
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        result = work()
        best = min(best, time.process_time() - start)
    return best, result


def lattice(cells: tuple[int, int, int]) -> Structure:
    """Return a lattice of straight members, each one element a cell long."""
    corners = [np.arange(n + 1) * step for n, step in zip(cells, CELL, strict=True)]
    members: list[dict[str, Any]] = []
    plain = parse_structure(t_structure_toml())
    material, section = next(iter(plain.material)), next(iter(plain.section))
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        for at in itertools.product(*(corners[a] for a in others)):
            start, end = np.zeros(3), np.zeros(3)
            start[others] = end[others] = at
            end[axis] = corners[axis][-1]
            name = "xyz"[axis] + "_".join(f"{v:.1f}" for v in at)
            if axis == 2 or start[2] > 0:  # nothing lies on the ground
                members.append({"name": name, "from": start.tolist(), "to": end.tolist(), "elements": cells[axis]})
    kind = {"material": material, "section": section}
    feet = [{"at": m["from"], "fixed": ["x", "y", "z", "rx", "ry", "rz"]} for m in members if m["name"][0] == "z"]
    return Structure.model_validate(
        {"name": "lattice", "material": plain.material, "section": plain.section, "support": feet}
        | {"member": [m | kind for m in members]}
    )


def cells_for(n_dofs: int) -> tuple[int, int, int]:
    """Return the lattice of nearly equal cells that has about so many DOFs."""
    side = (n_dofs / 6) ** (1 / 3)
    return round(side) - 1, round(side) - 1, round(n_dofs / 6 / round(side) ** 2)


def modes_row(n_dofs: int, solvers: list[bool]) -> None:
    """Print the cost of assembly and modes."""
    structure = lattice(cells_for(n_dofs))
    assembly, model = timed(lambda: build_model(structure, shear_flexible=True, mass="consistent"))
    costs, found = [], []
    for pardiso in solvers:
        solve = partial(lowest_modes, model.stiffness, model.mass, N_MODES, "lattice", pardiso=pardiso)
        cost, modes = timed(solve)
        costs.append(f"{cost:.1f}")
        found.append(modes)
    worst = max(residual(model, modes) for modes in found)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"| {model.n_dofs:,} | {assembly:.2f} | {' | '.join(costs)} | {worst:.0e} | {memory:.1f} |", flush=True)


def residual(model: Model, modes: Modes) -> float:
    """Return the largest |K b - omega^2 M b| over |K| |b|."""
    b = modes.shape
    left = model.stiffness @ b
    off = np.linalg.norm(left - modes.omega**2 * (model.mass @ b), axis=0)
    return float((off / np.linalg.norm(left, axis=0)).max())


def one_step_row(n: int, *, dense: bool) -> None:
    """Print the cost of eq. 7 and of the increments by their formula and as low-rank operators."""
    random = np.random.default_rng(1)
    mass = random.uniform(0.05, 0.2, n)
    modes = np.linalg.qr(random.standard_normal((n, 30)))[0] / np.sqrt(mass)[:, None]
    t = np.eye(30)[:, :8] + 0.02 * random.standard_normal((30, 8))
    replaced = np.eye(30)[:, :8]

    def low_rank() -> FloatArray:
        increment = update_mass(mass[:, None] * modes, t, replaced).diagonal()
        return normalised_increments(increment, 1 / mass, (modes[:, :8] ** 2).sum(1))

    def by_formula() -> FloatArray:
        a = modes @ t
        updated = np.linalg.inv(np.diag(1 / mass) - modes[:, :8] @ modes[:, :8].T + a @ a.T)
        return normalised_increments(np.diag(updated) - mass, 1 / mass, (modes[:, :8] ** 2).sum(1))

    quick, found = timed(low_rank, 5)
    if not dense:
        print(f"| {n:,} | | {1e3 * quick:.2f} | | |", flush=True)
        return
    slow, expected = timed(by_formula)
    off = np.nanmax(np.abs(found - expected)) / np.nanmax(np.abs(expected))
    print(f"| {n:,} | {slow:.1f} | {1e3 * quick:.2f} | {slow / quick:,.0f} | {off:.0e} |", flush=True)


def external(structure: Structure, folder: Path) -> Structure:
    """Return a structure as matrices that another program would have written, with sensors at random nodes."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    free = (model.dofs >= 0).any(1)
    matrices = Matrices(stiffness=model.stiffness, mass=model.mass, nodes=model.nodes[free], dofs=model.dofs[free])
    save_matrices(folder / "lattice.npz", matrices)
    random = np.random.default_rng(2)
    at = matrices.nodes[random.choice(len(matrices.nodes), SENSORS, replace=False)]
    sensors = [{"channel": f"c{i}", "at": p.tolist(), "direction": np.eye(3)[i % 3].tolist()} for i, p in enumerate(at)]
    lines = [m.model_dump(by_alias=True, include={"name", "start", "end"}) for m in structure.member]
    feet = [s.model_dump() for s in structure.support]
    found = Structure.model_validate(
        {"name": "lattice", "external": {"matrices": "lattice.npz"}, "member": lines, "support": feet}
        | {"sensor": sensors}
    )
    return found.beside(folder)


def watched(structure: Structure, folder: Path) -> tuple[Reference, ModalMean, float]:
    """Return a reference of measured modes, the measured modes with an added mass, and its position, by the same model.

    Only the cost is measured here: the truth is no other model, and its noise is 0.05 % of frequencies, 1 % of shapes.
    """
    structure = external(structure, folder)
    bare, where = windows_of(structure, 6, 1), place_of(structure)
    total = build_model(structure, mass="consistent").total_mass()
    body = Body(at=(float(where[0]), float(where[1]), float(where[2])), mass=MASS * total)
    reference = learn_reference(structure, bare, unmoved(6, MEASURED))
    loaded = stack_tracks(windows_of(structure.with_bodies([body]), 3, 2), unmoved(3, MEASURED))
    return reference, reference.mean_of(loaded), body.mass


def place_of(structure: Structure) -> FloatArray:
    """Return where the mass is added: between two nodes of a line at the top."""
    top = max((m for m in structure.member if m.name[0] == "x"), key=lambda m: (m.start[2], m.start[1]))
    return top.point(0.37 * top.length)


def windows_of(structure: Structure, n: int, seed: int) -> list[ModalEstimate]:
    """Return windows with the lowest modes of a structure, with noise."""
    model, random = build_model(structure, mass="consistent"), np.random.default_rng(seed)
    modes = model.modes(MEASURED)
    shape = (model.sensor_rows @ modes.shape).T
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    return [
        as_estimate(
            modes.frequency * (1 + 5e-4 * random.standard_normal(MEASURED)),
            shape + 0.01 / np.sqrt(SENSORS) * random.standard_normal(shape.shape),
            channels=structure.channels,
            frequency_std=5e-4 * modes.frequency,
            shape_std=0.01 / np.sqrt(SENSORS),
        )
        for _ in range(n)
    ]


def change_row(n_dofs: int) -> None:
    """Print the cost of the one-step update and of the localization once the modes are known."""
    with tempfile.TemporaryDirectory() as folder:
        reference, event, mass = watched(lattice(cells_for(n_dofs)), Path(folder))
        learning, updater = timed(lambda: MassUpdater(reference))
        first, _ = timed(lambda: updater.update(event))
        update, _ = timed(lambda: updater.update(event), 3)
        scan, found = timed(lambda: locate_mass(reference, event), 3)
    model = reference.model
    nodes, structure = len(model.nodes), reference.structure
    where = structure.member_named(found.member).point(found.distance)
    off = float(np.linalg.norm(where - place_of(structure)))
    weighed = f"{found.mass:.1f} ± {found.mass_std:.1f} of {mass:.1f}"
    costs = f"{learning:.1f} | {first:.2f} | {update:.2f} | {scan:.2f}"
    print(f"| {model.n_dofs:,} | {nodes:,} | {costs} | {weighed} | {off:.2f} |", flush=True)


def frame_row() -> None:
    """Print the cost of the T-frame's localization, every centimetre and every millimetre near the maximum."""
    truth = t_truth(3)
    bare, loaded = truth.model(), truth.model(Body(at=(0.25, 0, 1.48), mass=0.304))
    reference = learn_reference(t_frame(), truth.windows(bare.modes(8), bare.sensor_rows, 8, 3), unmoved(8))
    event = reference.mean_of(stack_tracks(truth.windows(loaded.modes(8), loaded.sensor_rows, 4, 5), unmoved(4)))
    learning, updater = timed(lambda: MassUpdater(reference))
    first, _ = timed(lambda: updater.update(event))
    update, _ = timed(lambda: updater.update(event), 3)
    scan, found = timed(lambda: locate_mass(reference, event), 3)
    model = reference.model
    costs = f"{learning:.1f} | {first:.2f} | {update:.2f} | {scan:.2f}"
    weighed = f"{found.mass:.3f} ± {found.mass_std:.3f} of 0.304"
    print(f"| {model.n_dofs} (T-frame) | {len(model.nodes)} | {costs} | {weighed} | {abs(found.distance - 0.65):.3f} |")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=100_000, help="degrees of freedom")
    options = parser.parse_args()
    installed = find_spec("pypardiso") is not None
    solvers = [False, True] if installed else [False]
    names = "SuperLU [s] | PyPardiso [s]" if installed else "SuperLU [s]"
    print(f"| DOFs | assembly [s] | {names} | residual | GB |")
    for n in (3_000, 10_000, 30_000, 100_000):
        if n <= options.largest:
            modes_row(n, solvers)
    print(
        "| DOFs | nodes | particles [s] | first update [s] | next update [s] | localization [s] "
        "| mass [kg] | position error [m] |"
    )
    frame_row()
    for n in (10_000, 100_000):
        if n <= options.largest:
            change_row(n)
    print("| N | dense [s] | low rank [ms] | ratio | relative difference |")
    for n in (1_000, 4_000, 100_000, 1_000_000):
        one_step_row(n, dense=n <= 4_000)


if __name__ == "__main__":
    main()

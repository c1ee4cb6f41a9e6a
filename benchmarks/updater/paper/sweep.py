"""The paper's own question: how far the one-step update's totals, peaks and eq. 13 carry, for 0.1 to 10 % of mass.

A body at the paper's two locations, the same body distributed over the structure, and 304 g distributed over ever
longer stretches; ten frames that differ from the reference in kind, eight windows before, four after. Prints the
tables of the documentation and draws docs/pictures/paper_sweep.png.

Usage: python benchmarks/updater/paper/sweep.py [FOLDER for the picture], or make bench-paper
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from tests.support.updater.frames import t_frame, unmoved
from tests.support.updater.one_step import N_BASELINE, N_EVENT, Rig
from updater import Body, MassUpdater, Model, Reference, build_model, locate_mass, stack_tracks
from updater.one_step import MassUpdate
from updater.one_step.update import normalised_increments, update_mass

TOTAL = 7.505  # kg
PERCENT = (0.1, 0.2, 0.5, 1.0, 2.0, 4.05, 7.0, 10.0)
PLACES = {"location 1": (0.25, 0.0, 1.48), "location 2": (0.0, 0.0, 0.92)}
SEEDS = range(3, 13)
NEXT_TO_NONE = 1e-4
STRETCHES = {  # member, from, to [m]: 304 g at location 1, distributed ever farther about it
    "a point": ("crossbeam", 0.65, 0.65),
    "0.1 m of the crossbeam": ("crossbeam", 0.60, 0.70),
    "0.3 m of it": ("crossbeam", 0.50, 0.80),
    "half of it": ("crossbeam", 0.40, 0.80),
    "all of it": ("crossbeam", 0.0, 0.80),
    "all of the column": ("column", 0.0, 1.48),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Told:
    """Results of the update for one event."""

    totals: FloatArray  #: (3,) over the true mass [-]
    away: float  #: of the largest relative increment from the mass [m]
    flagged: bool
    equal_stiffness: float  #: eq. 13's worst error over the modes [-]
    likelihood: FloatArray  #: (2,) of the mass found over the true one less 1 [-], and of its place [m]
    refused: bool  #: whether one body does not explain it (p under 0.001)


def distributed(kilograms: float, member: str, start: float, stop: float) -> list[Body]:
    """Return bodies every centimetre of a stretch, so that each centimetre weighs the same."""
    line = t_frame().member_named(member)
    n = max(1, round((stop - start) / 0.01))
    middles = start + (np.arange(n) + 0.5) * (stop - start) / n
    return [Body(at=tuple(p), mass=kilograms / n) for p in line.point(middles).tolist()]


def everywhere(kilograms: float) -> list[Body]:
    """Return the same over all of the structure."""
    members = t_frame().member
    whole = sum(m.length for m in members)
    return [b for m in members for b in distributed(kilograms * m.length / whole, m.name, 0.0, m.length)]


def relative(rig: Rig, update: MassUpdate) -> FloatArray:
    """Return normalised increments over their nodes' own masses, directions together (n_nodes,)."""
    particles = build_model(rig.reference.structure)
    own = np.append(particles.mass.diagonal(), 0.0)[particles.dofs[:, :3]].max(1)
    return np.asarray(np.nansum(update.normalised, axis=1) / np.where(own > 0, own, np.inf))


def equal_stiffness(rig: Rig, loaded: list[Body]) -> float:
    """Return the worst error of k_u = k in the true frame itself, shapes scaled by the mass as it was (eq. 12)."""
    bare = rig.truth.model()
    model = build_model(rig.truth.structure.with_bodies(loaded), shear_flexible=True, mass="consistent")
    shape = model.modes(8).shape
    stiffness = (shape * (bare.stiffness @ shape)).sum(0) / (shape * (bare.mass @ shape)).sum(0)
    return float(np.abs(stiffness / rig.bare.omega**2 - 1).max())


def tell(rig: Rig, reference: Reference, bodies: list[Body], noise: float, seed: int) -> Told:
    """Return the results for bodies added to a rig's frame."""
    mass = sum(body.mass for body in bodies)
    centre = np.array([body.mass * np.array(body.at) for body in bodies]).sum(0) / mass
    model = build_model(rig.truth.structure.with_bodies(bodies), shear_flexible=True, mass="consistent")
    windows = rig.windows(model.modes(8), N_EVENT, seed, noise)
    event = reference.mean_of(stack_tracks(windows, unmoved(N_EVENT)))
    update, answer = MassUpdater(reference).update(event), locate_mass(reference, event)
    nodes = rig.reference.model.nodes
    place = t_frame().member_named(answer.member).point(answer.distance)
    return Told(
        totals=update.totals / mass,
        away=float(np.linalg.norm(nodes[np.argmax(relative(rig, update))] - centre)),
        flagged=bool(update.flagged),
        equal_stiffness=equal_stiffness(rig, bodies),
        likelihood=np.array([answer.mass / mass - 1, np.linalg.norm(place - centre)]),
        refused=answer.p_value < 1e-3,
    )


Case = tuple[list[Told], list[Told]]


def case(rigs: list[Rig], bodies: list[Body]) -> Case:
    """Return the results in all frames, those with almost no noise first."""
    quiet, noisy = [], []
    for i, rig in enumerate(rigs):
        silent = rig.relearnt(rig.windows(rig.bare, N_BASELINE, 1, NEXT_TO_NONE))
        quiet.append(tell(rig, silent, bodies, NEXT_TO_NONE, 900 + i))
        noisy.append(tell(rig, rig.reference, bodies, 1.0, 900 + i))
    return quiet, noisy


def line(name: str, reported: Case) -> str:
    """Return the table's line of one case."""
    quiet, noisy = reported
    exact = np.median([t.totals for t in quiet], axis=0)
    error = np.median([np.abs(t.totals - 1) for t in noisy], axis=0)
    cells = [" / ".join(f"{100 * v:+.0f}" for v in exact - 1), " / ".join(f"{100 * v:.0f}" for v in error)]
    cells += [f"{np.median([t.away for t in reported[i]]):.2f}" for i in (0, 1)]
    cells += [f"{100 * np.mean([t.flagged for t in noisy]):.0f} %"]
    cells += [f"{100 * np.median([t.equal_stiffness for t in quiet]):.2g} %"]
    found = np.median(np.abs([t.likelihood for t in noisy]), axis=0)
    cells += [f"{100 * found[0]:.0f} %, {found[1]:.3f} m", f"{100 * np.mean([t.refused for t in noisy]):.0f} %"]
    return f"| {name} | " + " | ".join(cells) + " |"


HEAD = (
    "| {} | totals x / y / z, less the mass, % | the same with noise, absolute | position error of the peak, m "
    "| with noise | flagged | largest error of eq. 13 | likelihood: error of mass, of position | one body rejected |\n"
    "| ---: " + "| ---: " * 8 + "|"
)


def by_modes(place: str, kilograms: float) -> list[tuple[int, FloatArray, float]]:
    """Return totals over the mass and how far off the peak is, by how many of the model's own exact modes are put in.

    Nothing is measured or expanded here: only eqs 7 and 14 remain.
    """
    model = build_model(t_frame())
    weighed = np.flatnonzero(model.mass.diagonal() > 0)
    modes, n = model.modes(len(weighed)), len(weighed)
    b, mass = modes.shape[weighed], model.mass.diagonal()[weighed]
    node, direction = (index[np.argsort(model.dofs[:, :3][model.dofs[:, :3] >= 0])] for index in _free(model))
    at = model.read(np.array(PLACES[place]))[:3] @ modes.shape
    _, t = eigh(np.diag(modes.omega**2), np.eye(n) + kilograms * at.T @ at)
    t = t[:, linear_sum_assignment(-np.abs(t))[1]]  # of two modes that cross, each stays with its own
    found = []
    for m in (1, 2, 4, 8, 16, 32, 64, n):
        change = update_mass(mass[:, None] * b, t[:, :m], np.eye(n)[:, :m]).diagonal()
        normalised = np.nan_to_num(normalised_increments(change, 1 / mass, (b[:, :m] ** 2).sum(1)))
        totals = np.bincount(direction, normalised, minlength=3) / kilograms
        peak = model.nodes[np.argmax(np.bincount(node, normalised / mass, minlength=len(model.nodes)))]
        found.append((m, totals, float(np.linalg.norm(peak - PLACES[place]))))
    return found


def _free(model: Model) -> tuple[IndexArray, IndexArray]:
    """Return node and direction of the free translations."""
    node, direction = np.nonzero(model.dofs[:, :3] >= 0)
    return node, direction


def draw(swept: dict[str, list[Case]], stretched: list[Case]) -> Figure:
    """Return totals over the mass by its size and by how far it is distributed, and eq. 13's error."""
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    totals, lengths, stiffness = figure.subplots(1, 3)
    colours = {"location 1": "#cc3340", "location 2": "#2f6fcc", "distributed": "#239a68"}
    for name, cases in swept.items():
        middle = np.array([np.median([t.totals for t in quiet], axis=0) for quiet, _ in cases])
        for axis, style in enumerate(("-", "--", ":")):
            totals.plot(PERCENT, middle[:, axis], style, color=colours[name], label=f"{name}, {'xyz'[axis]}")
        worst = [100 * np.median([t.equal_stiffness for t in quiet]) for quiet, _ in cases]
        stiffness.plot(PERCENT, np.maximum(worst, 1e-7), "o-", color=colours[name], label=name)
    for axis, style in enumerate(("o-", "s--", "^:")):
        middle = np.array([np.median([t.totals for t in quiet], axis=0)[axis] for quiet, _ in stretched])
        lengths.plot(np.arange(len(middle)), middle, style, color="#cc3340", label="xyz"[axis])
    for axes in (totals, lengths):
        axes.axhline(1, color="#66707c", linewidth=0.8)
        axes.set_ylabel("total by eq. 14 over the mass")
    totals.legend(fontsize=7, frameon=False, ncol=3, loc=(0.02, 0.4), handlelength=1.5, columnspacing=1.0)
    lengths.legend(fontsize=8, frameon=False, loc="lower left")
    totals.set(xscale="log", xlabel="added mass, % of the structure's mass", title="By mass")
    lengths.set_title("304 g, distributed")
    lengths.set_xticks(np.arange(len(stretched)), [*STRETCHES, "all of the frame"], rotation=30, ha="right", fontsize=8)
    stiffness.set(xscale="log", yscale="log", ylim=(1e-6, 30), title="Eq. 13: equal modal stiffness")
    stiffness.set(xlabel="added mass, % of the structure's mass", ylabel="largest error of a mode, %")
    stiffness.legend(fontsize=8, frameon=False)
    return figure


def main() -> int:
    """Print the tables; draw if a folder is given."""
    rigs = [Rig(seed) for seed in SEEDS]
    swept: dict[str, list[Case]] = {}
    for name in (*PLACES, "distributed"):
        print(f"\n{name}\n\n" + HEAD.format("mass, % of 7.5 kg"))
        swept[name] = []
        for percent in PERCENT:
            kilograms = percent / 100 * TOTAL
            bodies = [Body(at=PLACES[name], mass=kilograms)] if name in PLACES else everywhere(kilograms)
            swept[name].append(case(rigs, bodies))
            print(line(f"{percent:g}", swept[name][-1]), flush=True)
    print("\n304 g distributed about location 1\n\n" + HEAD.format("over"))
    stretched = []
    for stated, (member, start, stop) in STRETCHES.items():
        stretched.append(case(rigs, distributed(0.304, member, start, stop)))
        print(line(stated, stretched[-1]), flush=True)
    stretched.append(case(rigs, everywhere(0.304)))
    print(line("all of the frame", stretched[-1]))
    print(
        "\n| number of exact modes | 304 g at location 1: totals / mass | position error of the peak, m "
        "| 152 g at location 2: totals / mass | position error of the peak, m |"
    )
    print("| ---: | ---: | ---: | ---: | ---: |")
    for first, second in zip(by_modes("location 1", 0.304), by_modes("location 2", 0.152), strict=True):
        cells = [f"{' / '.join(f'{v:.2f}' for v in totals)} | {away:.2f}" for _, totals, away in (first, second)]
        print(f"| {first[0]} | " + " | ".join(cells) + " |")
    if len(sys.argv) > 1:
        draw(swept, stretched).savefig(Path(sys.argv[1]) / "paper_sweep.png", dpi=110)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""A measured frame of three floors with documented masses: masses from modes, and the errors of a simulation.

Prints the tables of the documentation; FOLDER holds acc_frf_force_floor1.csv ... 3.csv.

Usage: python benchmarks/updater/measured/three_storeys.py FOLDER [PICTURE.png], or make bench-three-storeys
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import t as student

from daq import FloatArray
from monitor.text.diagnosis import next_text
from tests.measured.three_storeys import FLOOR, LEG, Frame, read_frame, simulation
from updater import DiagnosisResult, Structure, build_model, diagnose, matched, nominal_reference, stack_tracks
from updater.modal_data import ModalMass

MEASURED, BEFORE, AFTER = "#263238", "#ef6c00", "#1565c0"


def main(folder: Path, picture: Path | None) -> None:
    """Print the results of the responses, the masses, and the errors of the simulation."""
    frame, structure = read_frame(folder), simulation()
    print_modes(frame, structure)
    masses = frame.floor_masses()
    print_masses(frame, masses)
    print_stiffness(frame, structure)
    explained = explain(frame, structure)
    print_diagnosis(explained)
    if picture:
        draw(picture, frame, masses, structure, explained.extended)


def explain(frame: Frame, structure: Structure) -> DiagnosisResult:
    """Search the catalogue of causes for the errors of the simulation."""
    tracked = stack_tracks(frame.estimates(), [np.arange(3)] * 3)
    reference = nominal_reference(structure, tracked, n_modes=12)
    return diagnose(reference, matched(reference.baseline, reference.mean_of(tracked)))


def print_modes(frame: Frame, structure: Structure) -> None:
    """Print each mode by each test, and the simulation's."""
    simulated = build_model(structure, shear_flexible=True, mass="consistent").modes(3).frequency
    print("| mode | force at floor 1 [Hz] | 2 | 3 | damping [%] | simulated [Hz] | off [%] |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for k in range(3):
        found = [test[k] for test in frame.resonances]
        mean = float(np.mean([r.frequency for r in found]))
        print(
            f"| {k + 1} | "
            + " | ".join(f"{r.frequency:.4f} ± {r.frequency_std:.4f}" for r in found)
            + f" | {100 * np.mean([r.damping for r in found]):.2f} | {simulated[k]:.2f} "
            + f"| {100 * (simulated[k] / mean - 1):+.1f} |"
        )


def print_masses(frame: Frame, masses: ModalMass) -> None:
    """Print the mass matrix with the documented one, by all tests and by each."""
    print("\n| kg | floor 1 | floor 2 | floor 3 |\n| --- | --- | --- | --- |")
    for k in range(3):
        row = [f"{v:.2f} ± {s:.2f}" for v, s in zip(masses.value[k], masses.std[k], strict=True)]
        print(f"| floor {k + 1} | " + " | ".join(row) + " |")
    for k, (value, half) in enumerate(zip(np.diag(masses.value), _reach(frame, masses), strict=True)):
        inside = "inside" if abs(value - FLOOR) <= half else "outside"
        print(f"floor {k + 1}: 95 % within {value - half:.2f} to {value + half:.2f} kg, documented {FLOOR} is {inside}")
    print(f"by the accelerance at the force from 100 to 125 Hz: {np.round(1 / frame.plateau, 2).tolist()} kg")
    for k, shape in enumerate(frame.normalised()):
        inverse = np.linalg.inv(shape)
        print(f"force at floor {k + 1} alone: {np.round(np.diag(inverse @ inverse.T), 2).tolist()} kg")


def _reach(frame: Frame, masses: ModalMass) -> FloatArray:
    """Return half the 95 % interval of each floor's mass (3,) by Student's distribution for the number of tests."""
    return np.asarray(student.ppf(0.975, len(frame.resonances) - 1) * np.diag(masses.std))


def print_stiffness(frame: Frame, structure: Structure) -> None:
    """Print the storeys' stiffness required by the modes with the documented masses, and the legs'."""
    measured = frame.normalised().mean(axis=0)
    left, _, right = np.linalg.svd(measured)
    shape = left @ right / np.sqrt(FLOOR)  # the nearest modes that the documented masses make orthonormal
    frequency = np.mean([[r.frequency for r in test] for test in frame.resonances], axis=0)
    inverse = np.linalg.inv(shape)
    stiffness = inverse @ np.diag((2 * np.pi * frequency) ** 2) @ inverse.T
    legs = 12 * structure.material["aluminium"].youngs_modulus * structure.section["legs"].second_moment[0] / LEG**3
    storeys = [stiffness[0].sum(), -stiffness[0, 1], -stiffness[1, 2]]
    print("\nstoreys, documented masses:", [f"{k / 1e3:.1f}" for k in storeys], f"kN/m; legs {legs / 1e3:.1f} kN/m")


def print_diagnosis(explained: DiagnosisResult) -> None:
    """Print the answer of the catalogue."""
    found = explained.diagnosis
    print(f"\n{found.verdict}")
    for cause in found.causes:
        values = ", ".join(f"{n} {q.value:.3g} ± {q.std:.2g} {q.unit}" for n, q in cause.parameters.items())
        at = f" at {np.round(cause.where.position, 3).tolist()}" if cause.where and cause.where.position else ""
        print(
            f"- {cause.cause}{at}: {values}; not distinguished from {', '.join(cause.cannot_be_told_from) or 'nothing'}"
        )
    for mode in found.modes:
        f = mode.frequency
        if f.measured is not None and f.before is not None and f.after is not None:
            print(
                f"  {f.measured:.3f} Hz: {100 * (f.before / f.measured - 1):+.1f} % before, "
                f"{100 * (f.after / f.measured - 1):+.1f} % after"
            )
    print(f"  next: {next_text(explained.next_measurement)}")


def draw(path: Path, frame: Frame, masses: ModalMass, structure: Structure, extended: Structure | None) -> None:
    """Draw the shapes over height, measured and simulated, and the masses."""
    figure = Figure(figsize=(12, 3.8), layout="constrained")
    panels = figure.subplots(1, 4, squeeze=False)[0]
    models = [("as documented", BEFORE, structure)] + ([("extended", AFTER, extended)] if extended else [])
    measured, height = frame.normalised(), np.arange(4)
    for k, axes in enumerate(panels[:3]):
        axes.axvline(0, color="#cfd8dc", linewidth=0.8)
        for words, colour, what in models:
            frequency, shape = _simulated(what, k, measured[:, k].mean(axis=0))
            axes.plot(np.append(0, shape), height, color=colour, label=f"{words}: {frequency:.2f} Hz")
        mean = float(np.mean([test[k].frequency for test in frame.resonances]))
        for test, shape in enumerate(measured[:, k]):
            label = f"measured: {mean:.2f} Hz" if test == 0 else None
            axes.plot(np.append(0, shape), height, "o", color=MEASURED, markersize=4, label=label)
        axes.set(title=f"mode {k + 1}", xlabel=r"shape [kg$^{-1/2}$]", yticks=height)
        axes.set_ylim(-0.15, 4.4)
        axes.set_yticklabels(["foot", "floor 1", "floor 2", "floor 3"] if k == 0 else [""] * 4)
        axes.legend(frameon=False, fontsize=8, loc="upper center")
    axes, value, spread = panels[3], np.diag(masses.value), np.diag(masses.std)
    axes.plot([FLOOR, FLOOR], [0.6, 3.4], color=BEFORE, label=f"documented: {FLOOR} kg")
    axes.errorbar(
        value, height[1:], xerr=_reach(frame, masses), fmt="o", color=MEASURED, capsize=3, label="measured, 95 %"
    )
    axes.errorbar(value, height[1:], xerr=spread, fmt="none", ecolor=MEASURED, elinewidth=3)
    axes.set(title="floor masses", xlabel="kg", yticks=height, ylim=(-0.15, 4.4), xlim=(4.5, 5.6))
    axes.set_yticklabels([""] * 4)
    axes.legend(frameon=False, fontsize=8, loc="upper center")
    for axes in panels:
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    figure.savefig(path, dpi=100)


def _simulated(structure: Structure, mode: int, like: FloatArray) -> tuple[float, FloatArray]:
    """Return frequency and mass-normalised shape at the floors, of the sign of a measured one."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(3)
    shape = model.sensor_rows @ modes.shape[:, mode]
    return float(modes.frequency[mode]), np.asarray(shape * np.sign(shape @ like))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)

"""A measured cantilever with six masses, one of them taken off: what a beam model gets wrong, and which mass it was.

Prints the tables of docs/beam_six_masses.md; FOLDER holds frf.npz and mass_positions_cm.csv.

Usage: python benchmarks/six_masses.py FOLDER [PICTURE.png], or make real DATA=FOLDER-ABOVE
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure
from six_masses_helpers import (
    EXTENSIONS,
    LABELS,
    MODEL_ERROR,
    PLAIN,
    UNKNOWN,
    Cantilever,
    Fitted,
    Hypothesis,
    Layouts,
    Misfit,
    fitted,
    read_layouts,
    share_explained,
)

from daq import FloatArray
from updater import build_model, dump_structure

FOLDS, SEED = 7, 0
STRICTER = 2e-3  # model error: whether the answer hangs on it
WORTH = 3.0  # of log evidence: what an extension must bring, twenty to one
UNITS = {
    "accelerometer_gyration": (1e3, "mm"),
    "near_clamp_at": (1e3, "mm"),
    "offset": (1e3, "mm"),
    "gyration": (1e3, "mm"),
}
MEASURED, PLAINLY, FULLY = "#263238", "#ef6c00", "#1565c0"


@dataclass(frozen=True, eq=False, kw_only=True)
class Heldout:
    """What a model said of layouts that it was not fitted to."""

    mean: FloatArray  #: (n, 5) measured less predicted ln f, mean of both states
    shift: FloatArray  #: (n, 5) predicted
    chi_square: FloatArray  #: (n,) of each layout, by noise and model error

    def per_cent(self) -> FloatArray:
        """Return rms errors (5,) of frequencies."""
        return np.asarray(100 * np.sqrt((self.mean**2).mean(axis=0)))


def main(folder: Path, picture: Path | None) -> None:
    """Ask the data for the mass, the simulation for its error, and other layouts whether that was right."""
    measured, beam = read_layouts(folder), Cantilever()
    print_measured(measured)
    off = print_which(measured)
    plain, best = search(beam, measured, off, MODEL_ERROR)
    print_parameters(best)
    search(beam, measured, off, STRICTER)
    print_labels(beam, measured, plain, best)
    before, after = (held_out(beam, h.hypothesis, measured) for h in (plain, best))
    print_gain(measured, before, after)
    print_written(beam, measured, best)
    for words, fit in (("plain", plain), ("extended", best)):
        print_command(words, beam, measured, fit)
    if picture:
        draw(picture, measured, off, before, after)


def print_measured(measured: Layouts) -> None:
    """Print frequencies, shifts and what they scatter by."""
    noise = measured.noise()
    print("| mode | all on [Hz] | one off [Hz] | shift [%] | its scatter [%] | not by places [%] |")
    print("| --- | --- | --- | --- | --- | --- |")
    for k in range(measured.shift.shape[1]):
        frequency = np.exp([measured.before[:, k].mean(), measured.after[:, k].mean()])
        shift = 100 * measured.shift[:, k]
        print(
            f"| {k + 1} | {frequency[0]:.2f} | {frequency[1]:.2f} | {shift.mean():+.2f} "
            f"| {shift.std(ddof=1):.2f} | {100 * noise[1][k]:.2f} |"
        )


def print_which(measured: Layouts) -> int:
    """Print how much of the shifts' scatter each mass's place explains, without any model; return the best."""
    share = share_explained(measured)
    print("\n| mass | mode 1 | 2 | 3 | 4 | 5 |\n| --- | --- | --- | --- | --- | --- |")
    for label, row in zip(LABELS, share, strict=True):
        print(f"| {label} | " + " | ".join(f"{value:.2f}" for value in row) + " |")
    return int(np.argmax(share.sum(axis=1)))


def search(beam: Cantilever, measured: Layouts, off: int, model_error: float) -> tuple[Fitted, Fitted]:
    """Extend the plain beam by what brings the most evidence, until nothing brings enough; return first and last."""
    plain = fitted(beam, Hypothesis(free=PLAIN, off=off), measured, model_error=model_error)
    best, n_data = plain, 2 * measured.shift.size
    print(f"\nmodel error {100 * model_error:.1f} % of each frequency")
    print(f"plain: log evidence {best.log_evidence:.0f}, chi-square {best.chi_square:.0f} of {n_data} data")
    while True:
        tried = []
        for words, names in EXTENSIONS.items():
            more = tuple(name for name in names if name not in best.hypothesis.free)
            if more:
                free = Hypothesis(free=(*best.hypothesis.free, *more), off=best.hypothesis.off)
                tried.append((words, fitted(beam, free, measured, near=best.values, model_error=model_error)))
        tried.sort(key=lambda pair: -pair[1].log_evidence)
        print("  " + "; ".join(f"{w} {f.log_evidence - best.log_evidence:+.0f}" for w, f in tried))
        words, found = tried[0]
        if found.log_evidence - best.log_evidence < WORTH:
            break
        print(f"+ {words}: {found.log_evidence:.0f}, chi-square {found.chi_square:.0f}")
        best = found
    return plain, best


def print_parameters(best: Fitted) -> None:
    """Print what the extended beam's parameters are."""
    print("\n| parameter | found | prior |\n| --- | --- | --- |")
    for name, value in best.values.items():
        scale, unit = UNITS.get(name, (1.0, ""))
        known = UNKNOWN[name]
        print(
            f"| {name} | {scale * value:.3g} ± {scale * best.std[name]:.2g} {unit} "
            f"| {scale * known.mean:.3g} ± {scale * known.std:.2g} {unit} |"
        )


def print_labels(beam: Cantilever, measured: Layouts, plain: Fitted, best: Fitted) -> None:
    """Print how probable each mass is, all layouts together, by the plain beam and by the extended one."""
    each = {
        fit: [fitted(beam, Hypothesis(free=fit.hypothesis.free, off=k), measured, starts=3) for k in range(6)]
        for fit in (plain, best)
    }
    print("\n| taken off | plain: chi-square | log probability | extended: chi-square | log probability |")
    print("| --- | --- | --- | --- | --- |")
    for k, label in enumerate(LABELS):
        columns = []
        for fits in each.values():
            total = float(np.logaddexp.reduce([f.log_evidence for f in fits]))
            columns += [f"{fits[k].chi_square:.0f}", f"{fits[k].log_evidence - total:.0f}"]
        print(f"| {label} | " + " | ".join(columns) + " |")


def held_out(beam: Cantilever, hypothesis: Hypothesis, measured: Layouts) -> Heldout:
    """Fit to six sevenths of the layouts and predict the rest, seven times."""
    order = np.random.default_rng(SEED).permutation(len(measured.place))
    mean, shift = np.zeros_like(measured.mean), np.zeros_like(measured.shift)
    chi_square = np.zeros(len(order))
    for fold in np.array_split(order, FOLDS):
        seen = measured.only(np.setdiff1d(order, fold))
        noise = seen.noise()
        fit = fitted(beam, hypothesis, seen, noise, starts=3)
        unseen = Misfit(beam, hypothesis, measured.only(fold), noise)
        left, left_shift = unseen.differences(np.array(list(fit.values.values())))
        mean[fold], shift[fold] = left, measured.shift[fold] - left_shift
        of_mean = left**2 / (noise[0] ** 2 + MODEL_ERROR**2)
        chi_square[fold] = (of_mean + (left_shift / noise[1]) ** 2).sum(axis=1)
    return Heldout(mean=mean, shift=shift, chi_square=chi_square)


def print_gain(measured: Layouts, before: Heldout, after: Heldout) -> None:
    """Print errors in layouts not used, before and after."""
    noise = measured.noise()
    print("\n| held out | plain | extended | noise |\n| --- | --- | --- | --- |")
    for k in range(measured.shift.shape[1]):
        print(
            f"| frequency {k + 1}, rms [%] | {before.per_cent()[k]:.2f} | {after.per_cent()[k]:.2f} "
            f"| {100 * noise[0][k]:.2f} |"
        )
    for k in range(measured.shift.shape[1]):
        rms = [100 * np.sqrt(((measured.shift - h.shift)[:, k] ** 2).mean()) for h in (before, after)]
        print(f"| its shift, rms [%] | {rms[0]:.2f} | {rms[1]:.2f} | {100 * noise[1][k]:.2f} |")
    pattern = [np.corrcoef(h.shift.mean(axis=0), measured.shift.mean(axis=0))[0, 1] for h in (before, after)]
    single = [np.corrcoef(h.shift.ravel(), measured.shift.ravel())[0, 1] for h in (before, after)]
    print(f"| correlation of the mean shifts | {pattern[0]:.3f} | {pattern[1]:.4f} | |")
    print(f"| of all {measured.shift.size} shifts | {single[0]:.2f} | {single[1]:.2f} | |")
    gain = (before.chi_square - after.chi_square) / 2
    error = gain.std(ddof=1) / np.sqrt(len(gain))
    print(f"| log-likelihood a layout, gain | | {gain.mean():.1f} ± {error:.1f}, least {gain.min():.1f} | |")


def print_written(beam: Cantilever, measured: Layouts, best: Fitted) -> None:
    """Print what the extended structure file says of the first layout: modes used, and modes that were not."""
    structure = beam.written_out(best.values, measured.place[0], np.ones(6))
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(16)
    seen = np.abs(model.sensor_rows @ modes.shape)[0] > 1e-3
    print(
        "\nlayout 1, all on, bending modes of the structure written out:", np.round(modes.frequency[seen], 1).tolist()
    )
    print("measured:", np.round(np.exp(measured.before[0]), 1).tolist())


def print_command(words: str, beam: Cantilever, measured: Layouts, fit: Fitted) -> None:
    """Print what `modalwatch diagnose` says of two tables of frequencies, the means of all layouts in each state."""
    noise = measured.noise()[1] / np.sqrt(2 * len(measured.place))  # of each state, of which the shift has twice
    with TemporaryDirectory() as folder:
        structure = beam.written_out(fit.values, measured.place.mean(axis=0), np.ones(6))
        Path(folder, "beam.toml").write_text(dump_structure(structure), encoding="utf-8")
        for name, state in (("before", measured.before), ("after", measured.after)):
            frequency = np.exp(state.mean(axis=0))
            rows = np.column_stack([frequency, noise * frequency])
            table = Path(folder, f"{name}.csv")
            np.savetxt(table, rows, delimiter=",", header="frequency,frequency_std", comments="")
        modalwatch = str(Path(sys.executable).with_name("modalwatch"))
        found = subprocess.run(
            [modalwatch, "diagnose", "beam.toml", "after.csv", "--reference", "before.csv"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
    print(f"\n{words} beam, five mean frequencies before and after:\n{found.stdout}{found.stderr}")


def draw(path: Path, measured: Layouts, off: int, before: Heldout, after: Heldout) -> None:
    """Draw shifts over the place of the mass that was taken off: measured, and foretold for layouts not used."""
    figure = Figure(figsize=(13, 3.6), layout="constrained")
    panels = figure.subplots(1, measured.shift.shape[1], sharey=True, squeeze=False)[0]
    place = 100 * measured.place[:, off]
    for k, axes in enumerate(panels):
        axes.axhline(0, color="#cfd8dc", linewidth=0.8)
        axes.plot(place, 100 * before.shift[:, k], "^", color=PLAINLY, markersize=4, alpha=0.8, label="plain beam")
        axes.plot(place, 100 * after.shift[:, k], "s", color=FULLY, markersize=4, alpha=0.8, label="clamp extended")
        axes.plot(place, 100 * measured.shift[:, k], "o", color=MEASURED, markersize=4, label="measured")
        axes.set_title(f"mode {k + 1}: {np.exp(measured.before[:, k].mean()):.1f} Hz", fontsize=11)
        axes.set_xlabel(f"place of {LABELS[off]} [cm]")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    panels[0].set_ylabel("shift when it is taken off [%]")
    panels[0].legend(frameon=False, fontsize=9, loc="upper left")
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)

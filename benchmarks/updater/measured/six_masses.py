"""A measured cantilever with six masses, one or two removed: errors of a beam model, and the removed masses.

Prints the tables of the documentation; FOLDER holds frf.npz and mass_positions_cm.csv.

Usage: python benchmarks/updater/measured/six_masses.py FOLDER [PICTURE.png], or make bench-six-masses
"""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from daq import FloatArray
from monitor.analysis.known_bodies import BodiesResult, select_known_bodies
from tests.measured.six_masses import (
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
    write_bodies_file,
)
from updater import build_model, dump_structure
from updater.localization import BodySelection

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
    """Predictions of a model for layouts that it was not fitted to."""

    mean: FloatArray  #: (n, 5) measured less predicted ln f, mean of both states
    shift: FloatArray  #: (n, 5) predicted
    chi_square: FloatArray  #: (n,) of each layout, by noise and model error

    def per_cent(self) -> FloatArray:
        """Return rms errors (5,) of frequencies."""
        return np.asarray(100 * np.sqrt((self.mean**2).mean(axis=0)))


def main(folder: Path, picture: Path | None) -> None:
    """Estimate masses, errors of the simulation, and check both on other layouts."""
    measured, both, beam = read_layouts(folder), read_layouts(folder, state="5.92"), Cantilever()
    print_measured(measured)
    off = print_which(measured)
    plain, best = search(beam, measured, off, MODEL_ERROR)
    print_parameters(best)
    search(beam, measured, off, STRICTER)
    print_labels(beam, measured, plain, best)
    before, after = (held_out(beam, h.hypothesis, measured) for h in (plain, best))
    print_gain(measured, before, after)
    print_written(beam, measured, best)
    print_measured(both)
    print_which(Layouts(place=both.place, before=measured.after, after=both.after))  # the second mass
    print_sets(beam, {"2.96": measured, "5.92": both}, best)
    for words, fit in (("plain", plain), ("extended", best)):
        print_command(f"{words} beam, one off", beam, measured, fit)
    print_command("extended beam, two off", beam, both, best)
    if picture:
        draw(picture, measured, off, before, after)


def print_measured(measured: Layouts) -> None:
    """Print frequencies, shifts and their scatter."""
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
    """Extend the plain beam by the cause with the most evidence, until none has enough; return first and last."""
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
    """Print the parameters of the extended beam."""
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
    print("\n| removed | plain: chi-square | log probability | extended: chi-square | log probability |")
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
    """Print the results of the extended structure file for the first layout: modes used, and modes that were not."""
    structure = beam.written_out(best.values, measured.place[0], np.ones(6))
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(16)
    seen = np.abs(model.sensor_rows @ modes.shape)[0] > 1e-3
    print(
        "\nlayout 1, all on, bending modes of the structure written out:", np.round(modes.frequency[seen], 1).tolist()
    )
    print("measured:", np.round(np.exp(measured.before[0]), 1).tolist())


def print_sets(beam: Cantilever, states: dict[str, Layouts], best: Fitted) -> None:
    """Print which of the six masses `modalwatch bodies` names, by all layouts together, by parts and by each."""
    for state, measured in states.items():
        every = np.arange(len(measured.place))
        middle = len(every) // 2
        parts = {"1, 3, 5 ...": every[::2], "2, 4, 6 ...": every[1::2], "first half": every[:middle]}
        parts["second half"] = every[middle:]
        result = selected(beam, best, measured)
        found = result.selection
        print(f"\nstate {state}\n\n| layouts | most probable | any other | next |\n| --- | --- | --- | --- |")
        print(odds_row("all", found))
        for words, rows in parts.items():
            print(odds_row(words, selected(beam, best, measured.only(rows)).selection))
        print_others(beam, states["2.96"], measured, best)
        print("verdict:", result.verdict, "candidates:", found.candidate_probability)
        print("mass of each [beams]:", [f"{m / beam.beam:.4f} ± {s / beam.beam:.4f}" for m, s in changed(found)])
        print("scatter [%]:", np.round(100 * found.scatter, 2).tolist(), f"model error {100 * found.model_error:.1f} %")
        print("left in the mean of all layouts [%]:", np.round(100 * found.residual.mean(axis=0), 2).tolist())
        print_each(found)


def print_each(found: BodySelection) -> None:
    """Print the answer by each layout alone."""
    row = found.sets.index(found.best)
    alone, most = found.per_record[:, row], found.per_record.argmax(axis=1)
    print(f"each layout alone: {words_of(found.best)} with a probability of", np.round(alone, 3).tolist())
    print(f"most probable in {int((most == row).sum())} of {len(alone)}; elsewhere:")
    for layout in np.flatnonzero(most != row).tolist():
        other = int(most[layout])
        print(f"  layout {layout + 1}: {words_of(found.sets[other])} {found.per_record[layout, other]:.2f}")


def print_others(beam: Cantilever, before: Layouts, measured: Layouts, best: Fitted) -> None:
    """Print the answer by even layouts with a clamp that was found on odd ones in the first state."""
    odd, even = np.arange(0, len(measured.place), 2), np.arange(1, len(measured.place), 2)
    clamp = fitted(beam, best.hypothesis, before.only(odd), starts=2)
    print(odds_row("even, clamp by odd ones", selected(beam, clamp, measured.only(even)).selection))


def selected(beam: Cantilever, fit: Fitted, measured: Layouts) -> BodiesResult:
    """Return the result of `modalwatch bodies`: all sets of up to three of the six, each mass known to a tenth."""
    with TemporaryDirectory() as folder:
        return select_known_bodies(write_bodies_file(Path(folder), beam, fit.values, measured))


def odds_row(words: str, found: BodySelection) -> str:
    """Return a line of a table."""
    order = np.argsort(-found.probability)
    other = float(found.probability[order[1:]].sum())
    return f"| {words} | {words_of(found.best)} | {other:.0e} | {words_of(found.sets[int(order[1])])} |"


def words_of(chosen: tuple[int, ...]) -> str:
    """Return the labels of a set of masses."""
    return " and ".join(LABELS[k] for k in chosen) or "none"


def changed(found: BodySelection) -> list[tuple[float, float]]:
    """Return mass and standard deviation of each of the most probable set [kg]."""
    return [(float(found.mass[k]), float(found.mass_std[k])) for k in found.best]


def print_command(words: str, beam: Cantilever, measured: Layouts, fit: Fitted) -> None:
    """Print the answer of `modalwatch diagnose` to two tables of frequencies, the means of all layouts."""
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
    print(f"\n{words}, five mean frequencies before and after:\n{found.stdout}{found.stderr}")


def draw(path: Path, measured: Layouts, off: int, before: Heldout, after: Heldout) -> None:
    """Draw shifts over the place of the mass that was taken off: measured, and foretold for layouts not used."""
    figure = Figure(figsize=(13, 3.6), layout="constrained")
    panels = figure.subplots(1, measured.shift.shape[1], sharey=True, squeeze=False)[0]
    place = 100 * measured.place[:, off]
    for k, axes in enumerate(panels):
        axes.axhline(0, color="#cfd8dc", linewidth=0.8)
        axes.plot(place, 100 * before.shift[:, k], "^", color=PLAINLY, markersize=4, alpha=0.8, label="plain beam")
        axes.plot(place, 100 * after.shift[:, k], "s", color=FULLY, markersize=4, alpha=0.8, label="extended beam")
        axes.plot(place, 100 * measured.shift[:, k], "o", color=MEASURED, markersize=4, label="measured")
        axes.set_title(f"mode {k + 1}: {np.exp(measured.before[:, k].mean()):.1f} Hz", fontsize=11)
        axes.set_xlabel(f"position of {LABELS[off]} [cm]")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    panels[0].set_ylabel("shift by its removal [%]")
    panels[0].legend(frameon=False, fontsize=9, loc="upper left")
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)

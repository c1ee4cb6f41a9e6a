"""Frequency-domain methods compared with pyOMA2's: CPU time, memory, modes found and errors.

Every run is a child process with one BLAS thread, ours and theirs in turn on the same records (`oma_speed.record`; koma
has none of these methods). Ours choose their modes themselves and state standard deviations; pyOMA2's FDD family is
given the true frequencies, and of its pLSCF (order 30) a mode counts as found if a third of the orders have a pole
within 1 %. Then the errors of ours over many windows, with the smallest possible ones: the tables of the documentation.

Usage: python benchmarks/oma/frequency_domain.py [SIZES, such as ab] [WINDOWS], or make bench-oma-frequency
"""

import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.peers import OURS, measured, peak, peer_python
from benchmarks.oma.speed import DAMPING, N_MODES, SIZES, Size, record

Modes = list[tuple[float, float]]  # frequency [Hz] and damping
Work = tuple[Callable[[], Any], Callable[[Any], Any]]
N_FFT, ORDER = 1024, 30
REPEATS = {"a": 3, "b": 3, "c": 1, "d": 1}
OUR_METHODS = ("fdd", "efdd", "fsdd", "plscf")
RUNS = ("ours_singular", "pyoma_fdd", "ours_efdd", "pyoma_efdd", "ours_fsdd", "pyoma_fsdd", "ours_plscf", "pyoma_plscf")
HOPELESS = {("d", "pyoma_fdd"), ("d", "pyoma_efdd"), ("d", "pyoma_fsdd"), ("d", "pyoma_plscf")}  # 22 GB
PEER_WINDOWS = 12
BLOCKS = 6  # of the stream that singular values are asked of


# what the children run; only theirs import the peers


def ours_singular(path: str, rate: float, truth: list[float]) -> Work:
    """Singular values of all lines out of a stream: the record is never in memory as a whole."""
    del truth
    from oma.spectral import SpectrumAccumulator

    n_samples, n_channels = np.load(path, mmap_mode="r").shape
    with Path(path).open("rb") as file:
        np.lib.format.read_magic(file)
        np.lib.format.read_array_header_1_0(file)
        start = file.tell()
    size = -(-n_samples // BLOCKS)

    def work() -> np.ndarray:
        spectra = SpectrumAccumulator(n_channels, rate, N_FFT)
        with Path(path).open("rb") as file:
            file.seek(start)
            for _ in range(BLOCKS):  # no name for the block, which would keep it while the next is read
                spectra.add(np.fromfile(file, count=size * n_channels).reshape(-1, n_channels))
        sums = spectra.sums
        lines = range(0, len(sums.frequency), 64)
        return np.concatenate([np.linalg.eigvalsh(sums.mean(slice(k, k + 64))) for k in lines])

    return work, lambda _: {"modes": [], "peak": peak()}


def ours_fdd(path: str, rate: float, truth: list[float]) -> Work:
    """FDD of this project."""
    return _ours(path, rate, "fdd")


def ours_efdd(path: str, rate: float, truth: list[float]) -> Work:
    """EFDD of this project."""
    return _ours(path, rate, "efdd")


def ours_fsdd(path: str, rate: float, truth: list[float]) -> Work:
    """FSDD of this project."""
    return _ours(path, rate, "fsdd")


def ours_plscf(path: str, rate: float, truth: list[float]) -> Work:
    """Poly-reference least squares of this project."""
    return _ours(path, rate, "plscf")


def _ours(path: str, rate: float, name: str) -> Work:
    from daq import Channel, Recording
    from oma import METHODS, ModalEstimate, identify

    data = np.load(path)
    channels = tuple(Channel(name=f"c{i}", device="d", axis=i) for i in range(data.shape[1]))
    recording = Recording(channels=channels, data=data, rate=rate, start=0)

    def modes(found: ModalEstimate) -> dict[str, Any]:
        pairs = zip(found.frequency.tolist(), found.damping.tolist(), strict=True)
        return {"modes": list(pairs), "peak": peak()}

    band = (0.02 * rate, 0.4 * rate)
    return lambda: identify(recording, METHODS[name](), band), modes


def pyoma_fdd(path: str, rate: float, truth: list[float]) -> Work:
    """FDD of pyOMA2."""
    return _pyoma(path, rate, truth, "FDD")


def pyoma_efdd(path: str, rate: float, truth: list[float]) -> Work:
    """EFDD of pyOMA2."""
    return _pyoma(path, rate, truth, "EFDD")


def pyoma_fsdd(path: str, rate: float, truth: list[float]) -> Work:
    """FSDD of pyOMA2."""
    return _pyoma(path, rate, truth, "FSDD")


def pyoma_plscf(path: str, rate: float, truth: list[float]) -> Work:
    """Poly-reference least squares of pyOMA2."""
    return _pyoma(path, rate, truth, "pLSCF", ordmax=ORDER)


def _pyoma(path: str, rate: float, truth: list[float], name: str, **options: Any) -> Work:
    from pyoma2 import algorithms
    from pyoma2.setup import SingleSetup

    data = np.load(path)

    def work() -> Any:
        setup = SingleSetup(data, fs=rate)
        setup.add_algorithms(getattr(algorithms, name)(name="it", nxseg=N_FFT, **options))
        setup.run_by_name("it")
        near = 2 * rate / N_FFT  # its default, 0.1 Hz, is less than a line of the faster records
        if name == "FDD":
            setup.mpe("it", sel_freq=truth, DF=near)
        elif name != "pLSCF":
            setup.mpe("it", sel_freq=truth, DF1=near, DF2=rate / 50, npmax=10)
        return setup.algorithms["it"].result

    def modes(found: Any) -> dict[str, Any]:
        if name == "pLSCF":
            return {"modes": _of_orders(found.Fn_poles.T, found.Xi_poles.T, truth), "peak": peak()}
        damping = getattr(found, "Xi", np.full(len(found.Fn), np.nan))
        return {
            "modes": list(zip(np.ravel(found.Fn).tolist(), np.ravel(damping).tolist(), strict=True)),
            "peak": peak(),
        }

    return work, modes


def _of_orders(frequency: np.ndarray, damping: np.ndarray, truth: list[float]) -> Modes:
    """Return, of each mode that a third of the orders show, the medians over the orders."""
    result = []
    for mode in truth:
        off = np.where(np.isfinite(frequency), np.abs(frequency - mode), np.inf)
        best = np.argmin(off, axis=1)
        rows = np.flatnonzero(off.min(axis=1) < 0.01 * mode)
        if len(rows) > len(frequency) / 3:
            medians = [float(np.median(table[rows, best[rows]])) for table in (frequency, damping)]
            result.append((medians[0], medians[1]))
    return result


# the parent


def found_and_off(modes: Modes, truth: np.ndarray, seconds: float, line: float) -> tuple[int, int, np.ndarray]:
    """Return modes found, false ones, and the squared errors of frequency and damping over the law's, (2, n_found).

    A mode is found if it is within 1 %, or a line of the spectrum.
    """
    off, used = [], set()
    for mode in truth:
        nearest = min(range(len(modes)), key=lambda i: abs(modes[i][0] - mode), default=-1)
        if nearest >= 0 and abs(modes[nearest][0] - mode) < max(0.01 * mode, line):
            used.add(nearest)
            law = np.sqrt(DAMPING * mode / (2 * np.pi * seconds)), np.sqrt(DAMPING / (2 * np.pi * mode * seconds))
            off.append([(modes[nearest][0] - mode) / law[0], (modes[nearest][1] - DAMPING) / law[1]])
    return len(off), len(modes) - len(used), np.array(off).reshape(-1, 2).T ** 2


def run(name: str, folder: Path) -> None:
    """Print the lines of one size."""
    size: Size = SIZES[name]
    data, truth = record(size, 0)
    np.save(folder / "data.npy", data)
    del data
    arguments: dict[str, Any] = {"path": str(folder / "data.npy"), "rate": size.rate, "truth": truth.tolist()}
    for who in RUNS:
        if (name, who) in HOPELESS:
            continue
        python = OURS if who.startswith("ours") else peer_python()
        one = measured(python, Path(__file__), who, REPEATS[name], **arguments)
        modes, whole = one["result"]["modes"], one["result"]["peak"]
        n, false, off = found_and_off(modes, truth, size.seconds, size.rate / N_FFT)
        rmse = " | ".join(f"{value:.2f}" for value in np.sqrt(off.mean(axis=1))) if n else "- | -"
        label = f"{n} of {N_MODES}, {false} false" if modes else "-"
        line = f"| {name} | {who} | {one['cpu']:.3f} | {one['megabytes']:.0f} | {whole:.0f} | {label} | {rmse} |"
        print(line, flush=True)


def accuracy(n_windows: int, folder: Path) -> None:
    """Print errors over the bound and over the law, and the coverage of the stated deviations."""
    from oma import METHODS, IdentificationError, identify
    from oma.selection import uncertainty_law
    from tests.support.oma.cramer_rao import whittle_bound
    from tests.support.oma.scenes import SCENES, pairs

    for scene in ("clean", "close"):
        it = SCENES[scene]
        truth = it.structure
        first = it.record(0)
        noise = it.noise**2 / (1 + it.noise**2) * float(np.mean(first.data**2))
        bound = whittle_bound(truth, it.duration, first.rate, noise)
        modes = zip(truth.frequency, truth.damping, strict=True)
        law = np.array([uncertainty_law(f, zeta, it.duration) for f, zeta in modes]).T
        for name in ("ssi-data", *OUR_METHODS):
            errors = np.full((n_windows, 4, len(truth.frequency)), np.nan)
            false = 0
            for seed in range(n_windows):
                try:
                    found = identify(it.record(seed), METHODS[name]())
                except IdentificationError:
                    continue
                matched = pairs(found.frequency, found.shape, truth)
                false += found.n_modes - len(matched)
                for i, j in matched:
                    f, zeta = found.frequency[i] - truth.frequency[j], found.damping[i] - truth.damping[j]
                    errors[seed, :, j] = f, zeta, f / found.frequency_std[i], zeta / found.damping_std[i]
            rms = np.sqrt(np.nanmean(errors[:, :2] ** 2, axis=0))
            there = np.isfinite(errors[:, 0])
            covered = [np.mean(np.abs(errors[:, q][there]) < 2) for q in (2, 3)]
            cells = [f"{np.count_nonzero(there) / n_windows:.2f} / {false}", over(rms, bound, law), *covered]
            row(it.label, name, *cells)
        if scene == "clean":
            peers(min(PEER_WINDOWS, n_windows), folder, bound, law)


def over(rms: np.ndarray, bound: Any, law: np.ndarray) -> str:
    """Return cells: frequency and damping over the bound, then over the law; root mean square of the modes."""
    limits = bound.frequency, bound.damping, law[0], law[1]
    return " | ".join(f"{np.sqrt(np.mean((rms[k % 2] / limit) ** 2)):.2f}" for k, limit in enumerate(limits))


def row(*cells: Any) -> None:
    """Print a row."""
    label = (f"{cell:.2f}" if isinstance(cell, float) else str(cell) for cell in cells)
    print(f"| {' | '.join(label)} |", flush=True)


def peers(n_windows: int, folder: Path, bound: Any, law: np.ndarray) -> None:
    """Print the errors of pyOMA2's EFDD and FSDD, which are given the true frequencies."""
    from tests.support.oma.scenes import SCENES

    it = SCENES["clean"]
    truth = it.structure
    for who in ("pyoma_efdd", "pyoma_fsdd"):
        errors = np.full((n_windows, 2, len(truth.frequency)), np.nan)
        for seed in range(n_windows):
            recording = it.record(seed)
            np.save(folder / "window.npy", recording.data)
            arguments: dict[str, Any] = {"rate": recording.rate, "truth": truth.frequency.tolist()}
            one = measured(peer_python(), Path(__file__), who, 1, path=str(folder / "window.npy"), **arguments)
            errors[seed] = np.array(one["result"]["modes"]).T - (truth.frequency, truth.damping)
        rms = np.sqrt(np.nanmean(errors**2, axis=0))
        row(it.label, f"{who}, {n_windows} windows", "-", over(rms, bound, law), "-", "-")


def main() -> None:
    """Print the tables."""
    warnings.simplefilter("error")
    sizes = sys.argv[1] if len(sys.argv) > 1 else "abcd"
    with tempfile.TemporaryDirectory() as folder:
        print("| size | run | CPU [s] | memory [MB] | process [MB] | found | frequency / law | damping / law |")
        print("|:--|:--|--:|--:|--:|:--|--:|--:|")
        for name in sizes:
            if name in SIZES:
                run(name, Path(folder))
        print("\n| windows | method | modes / false | f / bound | z / bound | f / law | z / law | f in 2 sigma | z |")
        print("|:--|:--|:--|--:|--:|--:|--:|--:|--:|")
        accuracy(int(sys.argv[2]) if len(sys.argv) > 2 else 50, Path(folder))


if __name__ == "__main__":
    main()

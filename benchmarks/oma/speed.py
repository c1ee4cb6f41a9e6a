"""Stochastic subspace identification compared with pyOMA2's and koma's: CPU time, memory and error on the same records.

Every run is a child process with one BLAS thread, ours and theirs in turn; 50 block rows, orders 2 to 60 in steps of 2,
poles of all orders with hard criteria and stability, as each package does it. Prints the tables of the documentation.

Usage: python benchmarks/oma/speed.py [SIZES, such as ab], or make bench-oma-speed (an hour; ab: minutes)
"""

import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.common.peers import OURS, measured, peer_python

BLOCK_ROWS, MAX_ORDER, N_MODES = 50, 60, 8
DAMPING = 0.01
Poles = list[list[tuple[float, float]]]  # frequency [Hz] and damping of each pole of each order
Work = tuple[Callable[[], Any], Callable[[Any], Poles]]


class Size(NamedTuple):
    """A record to identify."""

    channels: int
    seconds: float
    rate: float
    seeds: int
    repeats: int  # of each run, the quickest of which counts


SIZES = {
    "a": Size(8, 60.0, 1000.0, 12, 3),
    "b": Size(8, 600.0, 200.0, 12, 2),
    "c": Size(32, 1800.0, 100.0, 2, 1),
    "d": Size(64, 3600.0, 100.0, 1, 1),
}
PEERS = ("pyoma_cov", "pyoma_cov_r", "pyoma_dat", "koma_cov")
HOPELESS = {("d", "pyoma_dat"), ("c", "pyoma_dat")}  # 17 GB and more than memory


# what the children run; only theirs import the peers


def ours_cov(path: str, rate: float) -> Work:
    """SSI-COV of this project."""
    from oma import CovarianceSSI

    return _ours(path, rate, CovarianceSSI(block_rows=BLOCK_ROWS, max_order=MAX_ORDER))


def ours_data(path: str, rate: float) -> Work:
    """SSI-DATA of this project."""
    from oma import DataSSI

    return _ours(path, rate, DataSSI(block_rows=BLOCK_ROWS, max_order=MAX_ORDER))


def _ours(path: str, rate: float, method: Any) -> Work:
    from oma import Stabilization
    from oma.methods.realization import realisations
    from oma.selection import stabilization
    from tests.support.oma.correlations import correlation_sums

    data = np.load(path)
    every = range(data.shape[1])

    def work() -> Stabilization:
        sums = correlation_sums(data, 2 * BLOCK_ROWS + 1, 1)
        space = method.subspace(sums.mean, every, rate, 1, MAX_ORDER)
        return stabilization(realisations(space, method.orders(MAX_ORDER)), (0.0, rate / 2), method.selection)

    def poles(found: Stabilization) -> Poles:
        every = list(zip(found.frequency.tolist(), found.damping.tolist(), strict=True))
        return [[every[i] for i in np.flatnonzero(found.order == order)] for order in method.orders(MAX_ORDER)]

    return work, poles


def ours_correlations(path: str, rate: float) -> Work:
    """Correlations alone."""
    from tests.support.oma.correlations import correlation_sums

    del rate
    data = np.load(path)
    return lambda: correlation_sums(data, 2 * BLOCK_ROWS + 1, 1), lambda _: []


def pyoma_cov(path: str, rate: float) -> Work:
    """SSI-COV of pyOMA2."""
    return _pyoma(path, rate, "cov")


def pyoma_cov_r(path: str, rate: float) -> Work:
    """SSI-COV of pyOMA2 from correlation functions."""
    return _pyoma(path, rate, "cov_R")


def pyoma_dat(path: str, rate: float) -> Work:
    """SSI-DATA of pyOMA2."""
    return _pyoma(path, rate, "dat")


def _pyoma(path: str, rate: float, method: str) -> Work:
    from pyoma2.algorithms import SSI
    from pyoma2.setup import SingleSetup

    data = np.load(path)

    def work() -> Any:
        setup = SingleSetup(data, fs=rate)
        ssi = SSI(name="ssi", method=method, br=BLOCK_ROWS, ordmin=2, ordmax=MAX_ORDER, step=2)
        setup.add_algorithms(ssi)
        setup.run_by_name("ssi")
        return ssi.result

    def poles(found: Any) -> Poles:
        return [
            [(f, z) for f, z in zip(*order, strict=True) if np.isfinite(f)]
            for order in zip(found.Fn_poles.T.tolist(), found.Xi_poles.T.tolist(), strict=True)
        ]

    return work, poles


def koma_cov(path: str, rate: float) -> Work:
    """SSI-COV of koma."""
    from koma.oma import covssi, find_stable_poles

    data = np.load(path)
    orders = list(range(2, MAX_ORDER + 1, 2))

    def work() -> Any:
        poles, phi, order = covssi(data, rate, BLOCK_ROWS, orders, showinfo=False)
        find_stable_poles(poles, phi, order, 1)
        return zip(poles, order, strict=True)

    def poles(found: Any) -> Poles:
        every = list(found)
        return [[(abs(x) / 2 / np.pi, -x.real / abs(x)) for x, o in every if o == order] for order in orders]

    return work, poles


# the parent


def record(size: Size, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return eight modes of a beam with 10 % noise, (n_samples, n_channels), and their frequencies [Hz]."""
    from tests.support.oma.structures import Structure, simulate

    place = (np.arange(size.channels) + 0.5) / size.channels
    shapes = np.sin(np.pi * np.outer(np.arange(1, N_MODES + 1), place) + 0.3)
    structure = Structure(
        frequency=size.rate * np.linspace(0.04, 0.36, N_MODES) ** 1.1,
        damping=np.full(N_MODES, DAMPING),
        shapes=shapes / np.linalg.norm(shapes, axis=1, keepdims=True),
        channels=tuple(f"c_{i}" for i in range(size.channels)),
    )
    return simulate(structure, size.seconds, size.rate, seed, noise=0.1).data, structure.frequency


def error(poles: Poles, truth: np.ndarray, seconds: float) -> float:
    """Return the RMS error of frequency over the uncertainty law's, of the median of the poles nearest to each mode."""
    upper = [np.array(order)[:, 0] for order in poles[-15:] if order]
    away = [np.median([order[np.argmin(np.abs(order - mode))] - mode for order in upper]) for mode in truth]
    law = np.sqrt(DAMPING * truth / (2 * np.pi * seconds))
    return float(np.sqrt(np.mean((np.array(away) / law) ** 2)))


def run(name: str, folder: Path) -> None:
    """Print the lines of one size."""
    size = SIZES[name]
    found: dict[str, list[dict[str, Any]]] = {}
    for seed in range(size.seeds):
        data, truth = record(size, seed)
        np.save(folder / "data.npy", data)
        for who in ("ours_cov", "ours_data", "ours_correlations", *PEERS):
            if (name, who) in HOPELESS or (who == "pyoma_dat" and seed > 1):  # minutes, for a figure of two digits
                continue
            python = OURS if who.startswith("ours") else peer_python()
            one = measured(python, Path(__file__), who, size.repeats, path=str(folder / "data.npy"), rate=size.rate)
            found.setdefault(who, []).append(
                one | {"error": error(one["result"], truth, size.seconds) if one["result"] else np.nan}
            )
    ours = {who: np.median([one["cpu"] for one in found[who]]) for who in ("ours_cov", "ours_data")}
    for who, runs in found.items():
        cpu, memory = (np.median([one[key] for one in runs]) for key in ("cpu", "megabytes"))
        rmse = np.sqrt(np.mean([one["error"] ** 2 for one in runs]))
        ratio = " | ".join(f"{cpu / ours[mine]:.1f}" for mine in ours)
        print(f"| {name} | {who} | {cpu:.3f} | {memory:.0f} | {ratio} | {rmse:.2f} |", flush=True)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("error")
    print("| size | method | CPU [s] | memory [MB] | / our SSI-COV | / our SSI-DATA | RMSE / law |")
    print("|:--|:--|--:|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1] if len(sys.argv) > 1 else SIZES:
            run(name, Path(folder))


if __name__ == "__main__":
    main()

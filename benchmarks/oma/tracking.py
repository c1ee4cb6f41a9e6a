"""Identities through simulated months: the table of the documentation.

A label is right if the mode has the identity that most of its identifications have, and no other mode has that one more
often. A false mode must not get the identity of a mode.

Usage: python benchmarks/oma/tracking.py [SEEDS], or make bench-tracking; with `recorded` in the place of SEEDS a
month whose windows, one an hour, are simulated as recordings and identified: some minutes more.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

from oma import IdentificationError, LongTermTracker, ModalEstimate, Tracker, Tracks, identify, pair_modes
from tests.support.monitor.seasons import STRANGE, Month, month, month_of_recordings

Label = tuple[int, int]  #: mode, identity
SCENARIOS = {
    "5 % drift, one crossing, 10 % of windows missing, one mode in 5 %": Month(),
    "the same with 3 sensors": Month(n_channels=3),
    "the same with 3 % within each day": Month(daily=0.03),
    "the same with a sudden change of 3 %": Month(jump=0.03),
    "the same with half of the windows missing": Month(missing=0.5),
    "the same with 30 % of modes unseen and a false one in half of the windows": Month(unseen=0.3, spurious=0.5),
}


def followed(what: Month, seed: int) -> list[Label]:
    """Label a month by following."""
    tracks: Tracks | None = None
    labels: list[Label] = []
    for estimate, modes in month(what, seed):
        found = LongTermTracker().follow(tracks, estimate)
        tracks = found.tracks
        labels += zip(modes.tolist(), found.identity.tolist(), strict=True)
    return labels


def compared(what: Month, seed: int) -> list[Label]:
    """Label a month by comparing with the fullest window of its first day."""
    first: list[ModalEstimate] = []
    labels: list[Label] = []
    for estimate, modes in month(what, seed):
        if len(first) < 144:
            first.append(estimate)
            reference = max(first, key=lambda e: e.n_modes)
        identity = np.full(estimate.n_modes, -1, np.intp)
        place = Tracker(reference=reference).assign(estimate)
        identity[place[place >= 0]] = np.flatnonzero(place >= 0)
        labels += zip(modes.tolist(), identity.tolist(), strict=True)
    return labels


def right(labels: list[Label]) -> tuple[int, int, int]:
    """Return right labels, all labels of modes, and how many false modes got the identity of a real one."""
    count = Counter(label for label in labels if label[0] != STRANGE)
    best = {mode: max((n, i) for (m, i), n in count.items() if m == mode)[1] for mode in {m for m, _ in count}}
    owner = {i: max((n, m) for (m, j), n in count.items() if j == i)[1] for i in best.values()}
    good = sum(n for (m, i), n in count.items() if best[m] == i and owner[i] == m)
    return good, count.total(), sum(i in owner for m, i in labels if m == STRANGE)


def recorded(seed: int) -> None:
    """Identify and track a month of recordings; print the number of right labels."""
    tracks: Tracks | None = None
    labels: list[Label] = []
    sure: list[Label] = []
    windows = 0
    for recording, truth in month_of_recordings(seed):
        try:
            estimate = identify(recording)
        except IdentificationError:
            continue
        found = LongTermTracker().follow(tracks, estimate)
        tracks, windows = found.tracks, windows + 1
        place = pair_modes(estimate.frequency, estimate.shape.real, truth.frequency, truth.shapes)
        modes = np.where(place >= 0, truth.modes[place], STRANGE)
        new = list(zip(modes.tolist(), found.identity.tolist(), strict=True))
        labels += new
        sure += [label for label, doubt in zip(new, found.doubtful.tolist(), strict=True) if not doubt]
    for name, some in (("all", labels), ("without labels stated as doubtful", sure)):
        good, total, taken = right(some)
        print(f"{name}: {good} of {total} labels right ({100 * good / total:.2f} %), {taken} false modes taken for one")
    print(f"{windows} windows; seed {seed}")


def main(seeds: int) -> None:
    """Print the table."""
    ways: dict[str, Callable[[Month, int], list[Label]]] = {
        "`LongTermTracker`": followed,
        "`Tracker`, first day": compared,
    }
    print("| month of 10 min windows | " + " | ".join(f"{way} | false ones taken" for way in ways) + " |")
    print("| --- |" + " --- | --- |" * len(ways))
    began, windows = time.process_time(), 0
    for name, what in SCENARIOS.items():
        cells = []
        for way in ways.values():
            results = np.array([right(way(what, seed)) for seed in range(seeds)])
            good, total, taken = results.sum(axis=0)
            cells.append(f"{100 * good / total:.3f} % ({100 * (results[:, 0] / results[:, 1]).min():.2f}) | {taken}")
            windows += seeds * round(what.days * 144 * (1 - what.missing))
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print(f"\n{seeds} seeds a row (worst in brackets); {1e3 * (time.process_time() - began) / windows:.2f} ms a window")


if __name__ == "__main__":
    if sys.argv[1:] == ["recorded"]:
        recorded(1)
    else:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)

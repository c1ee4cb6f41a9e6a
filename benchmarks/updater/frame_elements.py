"""The frame element compared with published results: the table in the documentation (`make bench-frames`)."""

import itertools

import numpy as np
from scipy.optimize import brentq

from daq import FloatArray
from tests.support.updater.frames import ALL
from tests.support.updater.published_frames import (
    CURVED,
    FV2,
    FV4,
    FV5,
    TWISTED,
    curved_cantilever,
    deep_beam,
    double_cross,
    off_centre_masses,
    portal,
    twisted_cantilever,
)


def _vibrations() -> None:
    print("| free vibration | mode | published | ours | off by | four times as fine |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    cases = (
        ("NAFEMS FV2, pinned double cross, 4 elements an arm", FV2, double_cross, 4),
        ("NAFEMS FV4, off-centre masses, 5 elements", FV4, off_centre_masses, 5),
        ("NAFEMS FV5, deep beam, 10 elements", FV5, deep_beam, 10),
    )
    for name, published, build, n in cases:
        coarse, fine = (build(m).modes(len(published)).frequency for m in (n, 4 * n))
        for first, last in _groups(published):
            modes = f"{first + 1}" if last == first + 1 else f"{first + 1} to {last}"
            worst, finer = (_worst(f[first:last], published[first]) for f in (coarse, fine))
            row = f"{name} | {modes} | {published[first]:.3f} Hz | {coarse[first:last].mean():.3f} Hz"
            print(f"| {row} | {worst:+.2f} % | {finer:+.2f} % |")


def _worst(found: FloatArray, published: float) -> float:
    off = 100 * (found / published - 1)
    return float(off[np.argmax(np.abs(off))])


def _groups(published: FloatArray) -> list[tuple[int, int]]:
    """Return first and one past the last of each run of equal frequencies."""
    edges = np.flatnonzero(np.diff(published)) + 1
    return list(itertools.pairwise([0, *edges.tolist(), len(published)]))


def _loads() -> None:
    print("\n| static | published | ours | off by |")
    print("| --- | ---: | ---: | ---: |")
    ring, strip = curved_cantilever(6), twisted_cantilever(12)
    rows = [(f"MacNeal & Harder, curved cantilever, 6 elements, {name}", CURVED[name], ring[name]) for name in CURVED]
    rows += [(f"twisted cantilever, 12 elements, load {name}", TWISTED[name], strip[name]) for name in TWISTED]
    roots = {
        "clamped": brentq(lambda k: k + 6 * np.tan(k), 1.6, 3.1),
        "pinned": brentq(lambda k: k * np.tan(k) - 6, 1, 1.5),
    }
    for foot, fixed in (("clamped", ALL), ("pinned", ("x", "y", "z", "rx", "rz"))):
        stiffness, geometric = portal(fixed, 8)
        load = 1 / np.linalg.eigvals(np.linalg.solve(stiffness, geometric)).real.max()
        rows.append((f"portal on {foot} feet, buckling load over E I / L^2, 8 elements a post", roots[foot] ** 2, load))
    for name, published, found in rows:
        print(f"| {name} | {published:.4g} | {found:.4g} | {100 * (found / published - 1):+.2f} % |")


if __name__ == "__main__":
    _vibrations()
    _loads()

"""Cracks that open and close, or stay open: how far they are found to close (`make bench-breathing`)."""

import argparse
from collections import defaultdict

import numpy as np

from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from oma import OmaError
from tests.support.portals.cracked_portal import WHOLE, Crack, Force, records
from tests.support.portals.tube_portal import Portal
from updater.quantities import Breathing

_PORTALS = (Portal(0.018, 0.015, 0.0015, 1.0, 1.175), Portal(0.015, 0.018, 0.0015, 0.9, 1.175))
_KINDS = ("closes", "closes by half", "loaded", "stays open")
_FORCES: tuple[Force, ...] = ("white", "low", "blows")
_NEAR = 0.05  # m


def _drawn(seed: int) -> tuple[str, Portal, Crack, Force]:
    random = np.random.default_rng((seed, 35))
    kind, opened = _KINDS[seed % len(_KINDS)], float(np.exp(random.uniform(np.log(0.012), np.log(0.05))))
    closed = {"closes by half": opened / 2, "stays open": opened}.get(kind, WHOLE)
    threshold = random.uniform(-0.5, 0.5) if kind == "loaded" else 0.0
    portal = _PORTALS[random.integers(len(_PORTALS))]
    return kind, portal, Crack(int(random.integers(5, 28)) / 32, opened, closed, threshold), random.choice(_FORCES)


def _answer(portal: Portal, crack: Crack, force: Force, seed: int) -> tuple[str, Breathing | None]:
    """Return the named causes, and how far the crack is found to close; None if it is not named alone and in place."""
    before, _ = records(portal, crack.healthy, 2 * seed, force)
    after, _ = records(portal, crack, 2 * seed + 1, force)
    answer = explain(portal.file(), observe(before), observe(after)).diagnosis
    named = " and ".join(cause.cause for cause in answer.causes) or answer.verdict
    if len(answer.causes) != 1 or not answer.causes[0].where:
        return named, None
    position = answer.causes[0].where.position or (np.inf,) * 3
    near = bool(np.linalg.norm(np.subtract(position, portal.at("left", crack.place))) < _NEAR)
    return named, answer.causes[0].breathing if near else None


def main() -> None:
    """Print one line per draw, and the table of docs/validation/diagnosis/breathing.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found: dict[str, list[tuple[Breathing, float, float]]] = defaultdict(list)
    drawn: dict[str, int] = defaultdict(int)
    for seed in range(options.seed, options.seed + options.draws):
        kind, portal, crack, force = _drawn(seed)
        drawn[kind] += 1
        try:
            named, closing = _answer(portal, crack, force, seed)
        except OmaError as error:
            named, closing = str(error), None
        _, open_time = records(portal, crack, 2 * seed + 1, force)
        truth = crack.share(open_time)
        print(f"{seed} {kind} {force} {crack} share {truth:.2f} open {open_time:.2f}: {named} {closing}", flush=True)
        records.cache_clear()
        if closing:
            found[kind].append((closing, truth, open_time))
    print("\n| crack | draws | named alone, in place | opens and closes | share within 1, 2 deviations | time open |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for kind in _KINDS:
        own = found[kind]
        off = np.array([abs(b.share.value - truth) / b.share.std for b, truth, _ in own])
        time = np.array([abs(b.open_time.value - t) / b.open_time.std for b, _, t in own if b.open_time])
        shown = [", ".join(f"{np.sum(each < k)}" for k in (1, 2)) + f" of {len(each)}" for each in (off, time)]
        n_closing = sum(b.significant for b, _, _ in own)
        print(f"| {kind} | {drawn[kind]} | {len(own)} | {n_closing} | {' | '.join(shown)} |")


if __name__ == "__main__":
    main()

"""The way of a sealed case through the code that is judged; nothing of the truth goes with it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, follow
from oma import ModalEstimate, WindowQuality
from oma.windows import Windows
from tests.examiner.cases import N_AFTER, N_BEFORE, Case
from tests.examiner.designs import DESIGNS
from tests.examiner.models.solid import STRUCTURE as SOLID_STRUCTURE
from tests.examiner.models.specimen import State
from tests.examiner.signals import estimated
from updater import Structure, learn_reference, matched, parse_structure, t_structure_toml
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare

_RMS = 0.01  # m/s2, at a loudness of one
FRAME = parse_structure(t_structure_toml())


@lru_cache
def structure_of(cell: str) -> Structure:
    """Return the structure as the user describes it."""
    which = cell.rpartition(": ")[0].rpartition(" ")[2]
    if which in DESIGNS:
        return parse_structure(DESIGNS[which].toml())
    return parse_structure(SOLID_STRUCTURE) if which == "solid" else FRAME


def answer(case: Case, *, noise: str = "law", only: Sequence[str] = ()) -> dict[str, Any]:
    """Return the diagnosis of modes with noise, as JSON would hold it; the gain is measured on windows of their own.

    Of all causes, or of some only.
    """
    random = np.random.default_rng((case.seed, 6))
    if case.built or case.cell.startswith("file: "):
        measured, heldout = (after(case, random, noise) for _ in range(2))
        structure = stiffer(structure_of(case.cell), case.far) if case.built else _filed(case)
        return explain(structure, None, measured, heldout, only=only).diagnosis.model_dump(mode="json")
    before = observation(case.done.before, estimated(case.done.before, N_BEFORE, random, noise=noise))
    now, heldout = (after(case, random, noise) for _ in range(2))
    found = explain(structure_of(case.cell), before, now, heldout, only=only)
    return found.diagnosis.model_dump(mode="json")


def stiffer(structure: Structure, factor: float) -> Structure:
    """Return a structure of materials that are so many times as stiff."""
    names = ("youngs_modulus", "shear_modulus")
    material = {
        name: one.model_copy(update={modulus: factor * getattr(one, modulus) for modulus in names})
        for name, one in structure.material.items()
    }
    return structure.model_copy(update={"material": material})


def _filed(case: Case) -> Structure:
    """Return the shipped structure, its members in as many elements as the file of the case gives them."""
    if case.coarse is None:
        return FRAME
    count = {"column": case.coarse.column, "crossbeam": case.coarse.crossbeam}
    members = tuple(m.model_copy(update={"elements": count[m.name]}) for m in FRAME.member)
    return FRAME.model_copy(update={"member": members})


def after(case: Case, random: np.random.Generator, noise: str = "law", known: Structure | None = None) -> Observation:
    """Return the windows of a case's state after the change."""
    states = [case.done.during(window) for window in range(N_AFTER)]
    windows = [estimated(state, 1, random, first=w, noise=noise)[0] for w, state in enumerate(states)]
    return observation(case.done.after, windows, [state.loudness for state in states], known)


def observation(
    state: State, estimates: Sequence[ModalEstimate], loudness: Sequence[float] = (), known: Structure | None = None
) -> Observation:
    """Track windows as if they had been identified from a log of the state's devices.

    Delays and dead channels that the structure's file `known` states are taken out, as commands do.
    """
    if known:
        estimates = [_speaking(estimate, known.active_channels) for estimate in estimates]
    perfect = WindowQuality(complete=1.0, rms_variation=0.0, cycles=1000.0)
    return follow(
        Windows(
            estimates=tuple(estimates),
            harmonics=np.empty(0),
            channels=dict.fromkeys(state.channels, "ok"),
            quality=(perfect,) * len(estimates),
            problems=(),
            start=estimates[0].start,
            end=estimates[-1].end,
            rate=1000.0,
        ),
        {s.channel: s.device for s in state.sensors},
        [
            (e.start, state.temperature, _RMS * level)
            for e, level in zip(estimates, loudness or [state.loudness] * len(estimates), strict=True)
        ],
        late=known.delays if known else {},
    )


def _speaking(estimate: ModalEstimate, channels: tuple[str, ...]) -> ModalEstimate:
    column = [estimate.channels.index(c) for c in estimate.channels if c in channels]
    shape = estimate.shape[:, column]
    length = np.linalg.norm(shape, axis=1, keepdims=True)
    return replace(
        estimate,
        channels=tuple(estimate.channels[i] for i in column),
        shape=shape / length,
        shape_std=estimate.shape_std[:, column] / length,
    )


def weighing_of(before: State, after: State, seed: int) -> EvidenceComparison:
    """Return the causes of a change of the T-frame, to be weighed by the modes of windows before and after it."""
    random = np.random.default_rng((seed, 6))
    windows = observation(before, estimated(before, N_BEFORE, random, noise="law"))
    reference = learn_reference(FRAME, windows.estimates, windows.tracks, windows.lateness.delays)
    now = observation(after, estimated(after, N_AFTER, random, noise="law")).modes
    return EvidenceComparison(reference, compare(reference, matched(reference.baseline, reference.mean_of(now))))

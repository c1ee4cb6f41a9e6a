"""The way of a sealed case through the code that is judged; nothing of the truth goes with it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from sealed_cases import N_AFTER, N_BEFORE, Case
from sealed_signals import estimated
from sealed_solid import STRUCTURE as SOLID_STRUCTURE
from sealed_specimen import State

from monitor.diagnosing import Observation, explain_change, follow
from monitor.fusion import Windows
from oma import ModalEstimate, WindowQuality
from updater import parse_structure, t_structure_toml

FRAME, BAR = parse_structure(t_structure_toml()), parse_structure(SOLID_STRUCTURE)


def answer(case: Case, *, noise: str = "law") -> dict[str, Any]:
    """Return the diagnosis of modes with noise, as JSON would hold it; the gain is measured on windows of their own."""
    random = np.random.default_rng((case.seed, 6))
    before = observation(case.done.before, estimated(case.done.before, N_BEFORE, random, noise=noise))
    after, heldout = (
        observation(case.done.after, [one for w in range(N_AFTER) for one in _window(case, w, random, noise)])
        for _ in range(2)
    )
    found = explain_change(BAR if case.cell.startswith("solid") else FRAME, before, after, heldout)
    return found.diagnosis.model_dump(mode="json")


def _window(case: Case, window: int, random: np.random.Generator, noise: str) -> list[ModalEstimate]:
    return estimated(case.done.during(window), 1, random, noise=noise)


def observation(state: State, estimates: Sequence[ModalEstimate]) -> Observation:
    """Track windows as if they had been identified from a log of the state's devices."""
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
        [(e.start, state.temperature, state.loudness) for e in estimates],
    )

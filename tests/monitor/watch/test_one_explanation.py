"""The live alarm and `diagnose` explain the same windows in the same way."""

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.watch.explanation import explain_windows
from tests.examiner.cases import N_BEFORE, draw
from tests.examiner.path import after, observation, structure_of
from tests.examiner.signals import estimated
from tests.support.thorough import few_of


@pytest.mark.thorough
@pytest.mark.parametrize(("cell", "seed"), few_of([("sliding", 73), ("added_mass", 71), ("attached_oscillator", 72)]))
def test_live_and_offline_explanations_of_the_same_windows_agree(cell: str, seed: int) -> None:
    """A body, a mode that the baseline has not, and windows that are not of one state."""
    print(f"{cell}, seed {seed}")
    case = draw(cell, seed)
    random = np.random.default_rng((case.seed, 6))
    before = observation(case.done.before, estimated(case.done.before, N_BEFORE, random, noise="law"))
    now = after(case, random, "law")
    offline = explain(structure_of(case.cell), before, now)
    live, _ = explain_windows(offline.sought, before.conditions, now.conditions, now.lateness)
    assert live.diagnosis == offline.explained.diagnosis
    assert live.extended == offline.explained.extended
    assert (live.diagnosis.verdict == "unexplained") == (cell == "sliding")

"""Feet on a floor with a mode of its own: draws of another model."""

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from tests.examiner.cases import N_BEFORE, draw
from tests.examiner.path import FRAME, after, answer, observation
from tests.examiner.score import score
from tests.examiner.signals import estimated
from tests.support.thorough import few_of

SIMILAR = ("ground_mode", "attached_oscillator", "support_stiffness")


@pytest.mark.parametrize("seed", few_of([200, 202, 207]))  # rocking, horizontal and vertical motion
def test_ground_mode_is_distinguished_from_an_oscillator_and_a_softer_foot(seed: int) -> None:
    print(f"seed {seed}")
    case, random = draw("ground_mode", seed), np.random.default_rng((seed, 6))
    before = observation(case.done.before, estimated(case.done.before, N_BEFORE, random, noise="law"))
    found = explain(FRAME, before, after(case, random), only=SIMILAR).diagnosis
    print(found.causes)
    assert (found.verdict, [cause.cause for cause in found.causes]) == ("explained", ["ground_mode"])
    (true,) = case.done.hidden
    for name, value in true.parameters.items():
        quantity = found.causes[0].parameters[name]
        assert abs(quantity.value - value) < 4 * quantity.std  # exceeded once in 16,000 times


@pytest.mark.parametrize(
    ("cell", "seed"),
    few_of([(f"{where}ground_mode", 200 + k) for k in range(12) for where in ("", "portal: ")], 0),
)
def test_ground_mode_is_named(cell: str, seed: int) -> None:
    print(f"seed {seed}")
    case = draw(cell, seed)
    found = answer(case)
    print(found["causes"])
    assert score(found, case.done.hidden, case.kind, near=case.near).fine

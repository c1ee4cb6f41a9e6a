"""Sealed cases from modes: every cause of the catalogue, nothing, what is too small, what stands in no catalogue."""

import pytest
from sealed_cases import draw
from sealed_path import answer
from sealed_score import score

CASES = [
    ("added_mass", 301),
    ("support_stiffness", 302),
    ("joint_stiffness", 303),
    ("global_stiffness", 304),
    ("sampling_clock", 305),
    ("sensor_gain", 306),
    ("sensor_polarity", 307),
    ("sensor_swap", 308),
    ("nothing", 309),
    ("small", 310),
    ("added_mass + sensor_gain", 311),
    ("reseated", 312),
]


@pytest.mark.parametrize(("cell", "seed"), CASES)
def test_what_was_done_is_what_is_said(cell: str, seed: int) -> None:
    """Fixed seeds; benchmarks/confusion.py draws hundreds, and says how often this fails."""
    case = draw(cell, seed)
    print(cell, seed, case.done.hidden)
    judged = score(answer(case), case.done.hidden, case.kind)
    assert judged.fine, judged

"""A foot that comes loose on a frame of two storeys, with modes that the sensors hardly measure close to others."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from tests.examiner.cases import N_AFTER, N_BEFORE
from tests.examiner.designs import STOREYS
from tests.examiner.models.bar import vector
from tests.examiner.path import observation
from tests.examiner.signals import estimated
from updater import parse_structure

_CLAMPED = vector((np.inf,) * 3)
_LEAST, _MOST = 0.5, 5.0  # stiffness of the loose foot, times E I / L of its column
CLAMPED = replace(
    STOREYS,
    grounds=tuple(replace(ground, about=_CLAMPED) for ground in STOREYS.grounds),
    meetings=tuple(replace(meeting, about=_CLAMPED) for meeting in STOREYS.meetings),
)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [8, 10])
def test_a_foot_that_comes_loose_is_named_alone(seed: int) -> None:
    """With the errors of sensors in modes that were not measured; without them, a moved sensor is named too."""
    random = np.random.default_rng((seed, 77))
    state, number = CLAMPED.draw(seed), int(random.integers(len(CLAMPED.grounds)))
    column, ground = STOREYS.bars[number], state.frame.grounds[number]
    unit = column.modulus / column.length * np.array(column.second_moment)
    rx, ry = unit * np.exp(random.uniform(np.log(_LEAST), np.log(_MOST), 2))
    loose = replace(ground, about=vector((rx, ry, np.inf)))
    grounds = tuple(loose if one is ground else one for one in state.frame.grounds)
    after, noise = state.of_frame(replace(state.frame, grounds=grounds)), np.random.default_rng((seed, 6))
    before = observation(state, estimated(state, N_BEFORE, noise, noise="law"))
    now, heldout = (observation(after, estimated(after, N_AFTER, noise, noise="law")) for _ in range(2))
    found = explain(parse_structure(CLAMPED.toml()), before, now, heldout).diagnosis
    print(f"seed {seed}: {[(c.cause, c.where, c.parameters, c.probability) for c in found.causes]}")
    (foot,) = found.causes
    assert found.verdict == "explained"
    assert foot.cause == "support_stiffness"
    assert foot.where is not None
    assert foot.where.position == pytest.approx(column.start)
    for name, true in (("stiffness_rx", rx), ("stiffness_ry", ry)):
        stated = foot.parameters[name]
        print(f"{name}: {(stated.value - true) / stated.std:+.1f} standard deviations")
        assert stated.value == pytest.approx(true, rel=0.35)
    assert found.gain is not None
    assert found.gain.frequency_error_percent.after is not None
    assert found.gain.frequency_error_percent.after < 0.2

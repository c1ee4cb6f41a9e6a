"""A bearing that locks on a bridge with three sensors across it, and a mode along it next to one across it."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from tests.examiner.cases import N_AFTER, N_BEFORE
from tests.examiner.designs import FOOTBRIDGE
from tests.examiner.path import observation
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import parse_structure

_LOCKED = 100.0  # times as stiff about the axis that it turned about


@pytest.mark.thorough
@pytest.mark.parametrize("seed", few_of([1, 3]))
def test_locked_bearing_is_diagnosed(seed: int) -> None:
    """As itself, or as its alias; a model's mode along the bridge is paired with none across it."""
    print(f"seed {seed}")
    state = FOOTBRIDGE.draw(seed)
    *others, last = state.frame.grounds
    x, y, z = last.about
    locked = replace(state.frame, grounds=(*others, replace(last, about=(x, _LOCKED * y, z))))
    random = np.random.default_rng((seed, 6))
    before = observation(state, estimated(state, N_BEFORE, random, noise="law"))
    now, heldout = (
        observation(
            state, [estimated(state.of_frame(locked), 1, random, first=w, noise="law")[0] for w in range(N_AFTER)]
        )
        for _ in range(2)
    )
    found = explain(parse_structure(FOOTBRIDGE.toml()), before, now, heldout).diagnosis
    assert found.verdict in ("explained", "ambiguous")
    (cause,) = found.causes
    assert "support_stiffness" in (cause.cause, *cause.cannot_be_told_from)
    assert cause.where is not None
    assert cause.where.position is not None
    assert abs(cause.where.position[0] - 66.0) < 5.0
    assert found.gain is not None
    error = found.gain.frequency_error_percent
    assert error.before is not None
    assert error.after is not None
    assert error.after < error.before / 8

"""Two bodies taken off a cantilever of which only five frequencies are known: no single cause is named surely.

The truth is a Ritz model with a tapered beam on a soft clamp, which the structure file does not have: the calibrated
file stays per mille off, so that its changes are uncertain too.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.modal_table.table import read_tables
from monitor.analysis.observation import Observation
from tests.support.updater.ritz_cantilever import BEAM, Clamp, frequencies, structure_file
from updater import Structure, parse_structure
from updater.inference import compare

STD = 2e-4  # of a frequency
BODIES = [(0.05 * k, 0.028 * BEAM) for k in range(1, 7)]
TRUTH = Clamp(taper=0.06)


def measured(structure: Structure, bodies: Sequence[tuple[float, float]], seed: int, path: Path) -> Observation:
    noise = np.exp(STD * np.random.default_rng((291, seed)).standard_normal(5))
    found = noise * frequencies(bodies, TRUTH)
    rows = np.column_stack([found, STD * found])
    np.savetxt(path, rows, delimiter=",", header="frequency,frequency_std", comments="")
    return read_tables(structure, [path])


@pytest.mark.thorough
def test_removal_of_two_bodies_is_among_the_named_causes(tmp_path: Path) -> None:
    """A stiffening of two stretches, with the same effect from the other end, was named with 99.9 %."""
    structure = parse_structure(structure_file(BODIES, Clamp(mass=0.45)))
    before = measured(structure, BODIES, 1, tmp_path / "before.csv")
    left = [body for k, body in enumerate(BODIES) if k not in (0, 2)]
    after = measured(structure, left, 2, tmp_path / "after.csv")
    found = explain(structure, before, after, only=("added_mass", "local_stiffness", "distributed_mass"))
    answer = found.explained.diagnosis
    print(
        found.sought.model_error_factor,
        answer.verdict,
        [(c.cause, c.probability, c.cannot_be_told_from) for c in answer.causes],
    )
    assert found.sought.model_error_factor > 1.5
    assert answer.verdict == "ambiguous"
    named = {name for cause in answer.causes for name in (cause.cause, *cause.cannot_be_told_from)}
    assert "added_mass" in named
    assert answer.gain is not None
    assert answer.gain.change_error_percent is not None
    assert answer.gain.change_error_percent.after is not None
    assert answer.gain.change_error_percent.after < 0.1  # of 2.3 %: noise leaves 0.03 %


def test_unmeasured_damping_is_not_counted_as_data(tmp_path: Path) -> None:
    """Five frequencies are five data, so that the p value of a fit is that of five."""
    structure = parse_structure(structure_file(BODIES, Clamp(mass=0.45)))
    before, after = (measured(structure, BODIES, seed, tmp_path / f"{seed}.csv") for seed in (3, 4))
    found = explain(structure, before, after, only=("added_mass",))
    assert compare(found.sought, found.event).freedom == pytest.approx(5)

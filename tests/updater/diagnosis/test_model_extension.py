"""The extended model agrees with the measurement: diagnosed with fresh windows, nothing is left to explain."""

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import TRACK
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    DiagnosisResult,
    Structure,
    TrackedModes,
    diagnose,
    dump_structure,
    matched,
    nominal_reference,
    parse_structure,
    stack_tracks,
)


def asked(structure: Structure, windows: TrackedModes) -> DiagnosisResult:
    reference = nominal_reference(structure, windows)
    return diagnose(reference, matched(reference.baseline, reference.mean_of(windows)))


@pytest.mark.parametrize("seed", few_of([2, 4], 0))
def test_extended_model_needs_no_further_cause(seed: int) -> None:
    """A frame whose foot, joint, modulus and density are not the file's, and six fresh windows of it."""
    random = np.random.default_rng((seed, 9))
    gain = 1 + 0.005 * random.standard_normal(12)
    model = true_model(np.random.default_rng((seed, 10)))

    def windows() -> TrackedModes:
        return stack_tracks([measure(model, random, gain) for _ in range(6)], [TRACK] * 6)

    found = asked(t_frame(), windows())
    assert found.diagnosis.verdict in {"explained", "ambiguous"}
    assert found.diagnosis.gain is not None
    error = found.diagnosis.gain.frequency_error_percent
    assert error.after is not None
    assert error.before is not None
    assert error.after < error.before / 2  # the rest is the 0.2 % that no beam model knows better
    assert found.extended is not None
    extended = parse_structure(dump_structure(found.extended))
    assert asked(extended, windows()).diagnosis.verdict == "nothing_to_explain"

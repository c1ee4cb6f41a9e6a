"""The extended model agrees with the measurement: diagnosed with fresh windows, nothing is left to explain."""

import numpy as np
import pytest

from monitor.text.causes import cause_text
from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import TRACK, Change, learnt
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
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


@pytest.mark.parametrize(("seed", "offset"), [(901, 0.0), (904, 0.03)])
def test_body_is_written_as_it_is_reported_with_a_significant_offset_only(seed: int, offset: float) -> None:
    """A body whose centre is on the crossbeam's axis, or 30 mm from it along y; both are known to about 2 mm."""
    reference, _, event = learnt(seed)
    body = Body(at=(0.2, 0, 1.48), mass=0.3, offset=(0, offset, 0))
    found = diagnose(reference, event(Change(bodies=(body,))), only=("added_mass",))
    (cause,) = found.diagnosis.causes
    assert found.extended is not None
    written, reported = found.extended.body[-1], cause.parameters
    assert abs(reported["offset_y"].value - offset) < 3 * reported["offset_y"].std
    assert reported["offset_y"].std < 0.005
    assert cause.where is not None
    assert cause.where.position is not None
    assert cause.where.position_std is not None
    assert written.mass == pytest.approx(reported["mass"].value, abs=0.05 * reported["mass"].std)
    assert written.at[0] == pytest.approx(cause.where.position[0], abs=0.05 * cause.where.position_std)
    assert written.offset == pytest.approx((0, reported["offset_y"].value if offset else 0, 0), abs=1e-4)
    assert ("off the axis by" in cause_text(cause)) == bool(offset)

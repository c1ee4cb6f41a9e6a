"""Evidence of the signals by place: exact at tested places, linear between them, falling to none beyond."""

import numpy as np

from daq import FloatArray
from updater.modal_data import Circumstances, OpeningEvidence

EVIDENCE = OpeningEvidence(
    position=np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]), log_ratio=np.array([4.0, 10.0]), reach=0.1
)


def at_heights(*height: float) -> FloatArray:
    """Return positions (n, 3) [m] on a vertical line."""
    return np.column_stack([np.zeros(len(height)), np.zeros(len(height)), height])


def test_evidence_between_and_beyond_tested_places() -> None:
    found = EVIDENCE.at(at_heights(0.1, 0.125, 0.2, 0.225, 0.31))
    np.testing.assert_allclose(found, [4.0, 5.5, 10.0, 7.5, 0.0], atol=1e-12)


def test_evidence_of_one_place_falls_to_none_at_the_reach() -> None:
    one = OpeningEvidence(position=at_heights(0.2), log_ratio=np.array([10.0]), reach=0.1)
    np.testing.assert_allclose(one.at(at_heights(0.2, 0.25, 0.299, 0.3, 0.4)), [10.0, 5.0, 0.1, 0.0, 0.0], atol=1e-12)


def test_evidence_in_a_gap_of_one_and_a_half_reaches_is_linear() -> None:
    wide = OpeningEvidence(position=at_heights(0.1, 0.25), log_ratio=np.array([4.0, 10.0]), reach=0.1)
    found = wide.at(at_heights(0.05, 0.1, 0.1375, 0.175, 0.25, 0.3))
    np.testing.assert_allclose(found, [2.0, 4.0, 5.5, 7.0, 10.0, 5.0], atol=1e-12)


def test_evidence_does_not_reach_across_a_gap_without_tests() -> None:
    far = OpeningEvidence(position=at_heights(0.1, 0.4), log_ratio=np.array([4.0, 10.0]), reach=0.1)
    np.testing.assert_allclose(far.at(at_heights(0.15, 0.25, 0.35)), [2.0, 0.0, 5.0], atol=1e-12)


def test_evidence_has_no_jump_at_a_corner_of_two_members() -> None:
    """Across the corner no place is between two others."""
    across = np.array([[0.0, 0.0, 0.15], [0.05, 0.0, 0.2]])
    corner = OpeningEvidence(position=across, log_ratio=np.array([4.0, 10.0]), reach=0.06)
    height = np.linspace(0.15, 0.2, 501)
    along = np.concatenate([at_heights(*height), np.column_stack([height - 0.15, 0 * height, 0 * height + 0.2])])
    found = corner.at(along)
    assert found[0] == 4.0
    assert found[-1] == 10.0
    assert np.abs(np.diff(found)).max() < 0.03


def test_causes_that_were_not_tested_have_none() -> None:
    known = Circumstances(opening={"local_stiffness": EVIDENCE})
    assert known.opening_at("local_stiffness", np.array([[0.0, 0.0, 0.2]])) == 10.0
    assert known.opening_at("support_stiffness", np.array([[0.0, 0.0, 0.2]])) == 0.0

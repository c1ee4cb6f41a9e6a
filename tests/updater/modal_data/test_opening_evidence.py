"""Evidence of the signals by place: exact at tested places, linear between them, none beyond."""

import numpy as np

from updater.modal_data import Circumstances, OpeningEvidence

EVIDENCE = OpeningEvidence(
    position=np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]), log_ratio=np.array([4.0, 10.0]), reach=0.1
)


def test_evidence_between_and_beyond_tested_places() -> None:
    height = np.array([0.1, 0.125, 0.2, 0.31])
    found = EVIDENCE.at(np.column_stack([np.zeros(4), np.zeros(4), height]))
    np.testing.assert_allclose(found, [4.0, 5.5, 10.0, 0.0], atol=1e-12)


def test_causes_that_were_not_tested_have_none() -> None:
    known = Circumstances(opening={"local_stiffness": EVIDENCE})
    assert known.opening_at("local_stiffness", np.array([[0.0, 0.0, 0.2]])) == 10.0
    assert known.opening_at("support_stiffness", np.array([[0.0, 0.0, 0.2]])) == 0.0

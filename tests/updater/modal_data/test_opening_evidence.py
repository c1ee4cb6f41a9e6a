"""Evidence of the signals by place and axis: linear between tested places, constant beyond, none elsewhere."""

import numpy as np

from updater.modal_data import Circumstances, OpeningEvidence, Sites

EVIDENCE = OpeningEvidence(
    path=np.array([1, 1]),
    distance=np.array([0.2, 0.1]),
    log_ratio=np.array([[10.0, -1.0, 0.0], [4.0, 1.0, 0.0]]),
)


def about(share: tuple[float, float, float], distance: float = 0.1, path: int = 1) -> Sites:
    return Sites(path=np.array([path]), distance=np.array([distance]), share=np.array([share]))


def test_evidence_between_and_beyond_tested_places() -> None:
    distance = np.array([0.0, 0.1, 0.125, 0.2, 0.31])
    sites = Sites(path=np.ones(5, np.intp), distance=distance, share=np.tile([1.0, 0.0, 0.0], (5, 1)))
    opens = np.array([4.0, 4.0, 5.5, 10.0, 10.0])
    np.testing.assert_allclose(EVIDENCE.at(sites), np.log((1 + np.exp(opens)) / 2), rtol=1e-12)


def test_axis_counts_by_its_share_of_the_flexibility() -> None:
    """Half of all losses open and close, about one axis each; a gain of stiffness and another member have none."""
    opens = (np.exp(10.0) + 0.5 * np.exp(-1.0) + 0.5) / 2
    np.testing.assert_allclose(EVIDENCE.at(about((1.0, 0.5, 0.5), 0.2)), np.log((1 + opens) / 2), rtol=1e-12)
    assert EVIDENCE.at(about((0.0, 1.0, 0.0), 0.2))[0] < 0
    assert EVIDENCE.at(about((0.0, 0.0, 0.0), 0.2))[0] == 0
    assert EVIDENCE.at(about((1.0, 0.0, 0.0), 0.2, path=0))[0] == 0


def test_causes_that_were_not_tested_have_none() -> None:
    known = Circumstances(opening={"local_stiffness": EVIDENCE})
    assert known.opening_at("local_stiffness", about((1.0, 0.0, 0.0), 0.2)) > 9
    assert known.opening_at("support_stiffness", about((1.0, 0.0, 0.0), 0.2)) == 0

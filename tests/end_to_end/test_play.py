"""Play in a foot, and a foot that gapes under both signs, distinguished by the signals of one window."""

import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from monitor.text.causes import breathing_text
from tests.support.portals.cracked_portal import Crack, records
from tests.support.portals.tube_portal import Portal
from updater.quantities import Law

PORTAL = Portal(0.018, 0.015, 0.0015, 1.0, 1.175)
PLAY, GAPES = Crack(0.0, 0.12, threshold=1.0, opens="within"), Crack(0.0, 0.12, threshold=1.0, opens="beyond")


@pytest.mark.thorough
@pytest.mark.parametrize(("foot", "law", "seed"), [(PLAY, "within", 1), (GAPES, "beyond", 2)])
def test_foot_that_opens_on_both_sides(foot: Crack, law: Law, seed: int) -> None:
    """Law, share and time within three stated deviations, and the flexibility while open."""
    before, _ = records(PORTAL, foot.healthy, 2 * seed, "white")
    after, open_time = records(PORTAL, foot, 2 * seed + 1, "white")
    (cause,) = explain(PORTAL.file(), observe(before), observe(after)).diagnosis.causes
    found = cause.breathing
    print(f"seed {seed}, open {open_time:.3f}", cause, breathing_text(cause))
    assert "support_stiffness" in {cause.cause, *cause.cannot_be_told_from}
    assert found
    assert found.law == law
    assert abs(found.share.value - foot.share(open_time)) < 3 * found.share.std
    assert found.open_time
    assert abs(found.open_time.value - open_time) < 3 * found.open_time.std
    assert found.opening
    assert (found.opening.member, found.opening.axis, found.opening.opens) == ("left post", "y", law)
    # the healthy hinge of the truth has 1 mm, which calibration adds to the foot
    assert abs(found.opening.flexibility.value - 0.119) < 3 * found.opening.flexibility.std

"""A crack too small for the modes, which the signals show, and a loose foot, on which they do not decide."""

from dataclasses import replace

import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import observe
from monitor.text.causes import breathing_text
from tests.support.portals.cracked_portal import Crack, Force, records
from tests.support.portals.tube_portal import Portal
from tests.support.thorough import few_of

PORTAL = Portal(0.015, 0.018, 0.0015, 0.9, 1.175)
FORCES: tuple[Force, ...] = ("white", "blows")
SMALL = [(Crack(27 / 32, 0.0124, threshold=0.09), 28, "blows"), (Crack(22 / 32, 0.0132, threshold=0.48), 44, "white")]
SMALL_PORTAL = Portal(0.018, 0.015, 0.0015, 1.0, 1.175)


@pytest.mark.parametrize(
    ("crack", "seed", "kind", "only"),
    few_of([(*SMALL[0], ("local_stiffness", "support_stiffness")), *((*one, ()) for one in SMALL)]),
)
def test_crack_too_small_for_the_modes_is_named_by_the_signals(
    crack: Crack, seed: int, kind: Force, only: tuple[str, ...]
) -> None:
    """By the modes nothing has changed; the signals show a place that opens and closes, with those of the reference."""
    before, now = (
        observe(records(SMALL_PORTAL, one, own, kind)[0]) for one, own in ((crack.healthy, seed), (crack, seed + 1))
    )
    if not only:
        modes = explain(SMALL_PORTAL.file(), replace(before, sample=None), now).diagnosis
        assert modes.verdict == "nothing_to_explain"
    answer = explain(SMALL_PORTAL.file(), before, now, only=only).diagnosis
    print(answer)
    assert answer.verdict == "explained"
    (cause,) = answer.causes
    assert cause.cause == "local_stiffness"
    assert cause.where
    assert cause.where.position
    assert cause.where.position_std
    assert abs(cause.where.position[2] - crack.place * SMALL_PORTAL.height) < 3 * cause.where.position_std
    assert cause.signals
    assert cause.signals.decides
    assert "decided by the signals" in breathing_text(cause)


@pytest.mark.parametrize(("seed", "kind"), few_of([(s, kind) for s in range(5) for kind in FORCES], 0))
def test_foot_that_stays_loose_is_not_decided_by_the_signals(seed: int, kind: Force) -> None:
    """A linear loss of a foot, a hinge of constant flexibility in series with its spring."""
    loose = Crack(0.0, 0.15, 0.15)
    before, now = (
        observe(records(PORTAL, one, own, kind)[0]) for one, own in ((loose.healthy, seed), (loose, seed + 1000))
    )
    answer = explain(PORTAL.file(), before, now).diagnosis
    print(answer)
    assert "support_stiffness" in {
        name for cause in answer.causes for name in (cause.cause, *cause.cannot_be_told_from)
    }
    assert not any(cause.signals for cause in answer.causes)

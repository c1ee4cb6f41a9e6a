"""A crack too small for the modes, which the signals show, and a loose foot, on which they do not decide."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation
from monitor.text.causes import breathing_text
from tests.support.portals.cracked_portal import Crack, Force, identified, sampled
from tests.support.portals.tube_portal import Portal
from tests.support.thorough import few_of

PORTAL = Portal(0.015, 0.018, 0.0015, 0.9, 1.175)
FORCES: tuple[Force, ...] = ("white", "blows")
SMALL = [(Crack(27 / 32, 0.0124, threshold=0.09), 28, "blows"), (Crack(22 / 32, 0.0132, threshold=0.48), 44, "white")]
SMALL_PORTAL = Portal(0.018, 0.015, 0.0015, 1.0, 1.175)
Observed = Callable[[Portal, Crack, int, Force], tuple[Observation, float]]
FEW = ("local_stiffness",)  # causes that are compared in the ordinary case


@pytest.mark.parametrize(
    ("observed", "crack", "seed", "kind", "only"),
    few_of(
        [(sampled, replace(SMALL[0][0], opened=0.012), 28, "blows", FEW), *((identified, *one, ()) for one in SMALL)]
    ),
)
def test_crack_too_small_for_the_modes_is_named_by_the_signals(
    observed: Observed,
    crack: Crack,
    seed: int,
    kind: Force,
    only: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the modes nothing has changed; the signals show a place that opens and closes, with those of the reference."""
    if only:  # how far it closes is under test in test_breathing_crack.py, and takes as long as all else
        monkeypatch.setattr("monitor.analysis.explanation.with_breathing", lambda found, *_: found)
    before, now = (observed(SMALL_PORTAL, one, own, kind)[0] for one, own in ((crack.healthy, seed), (crack, seed + 1)))
    modes = explain(SMALL_PORTAL.file(), replace(before, sample=None), now, only=only).diagnosis
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
    before, now = (identified(PORTAL, one, own, kind)[0] for one, own in ((loose.healthy, seed), (loose, seed + 1000)))
    answer = explain(PORTAL.file(), before, now).diagnosis
    print(answer)
    assert "support_stiffness" in {
        name for cause in answer.causes for name in (cause.cause, *cause.cannot_be_told_from)
    }
    assert not any(cause.signals for cause in answer.causes)

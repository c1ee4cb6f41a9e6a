"""Feet like one that has lost stiffness: estimates of independent portals cover the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from monitor.analysis.explanation import explain
from monitor.text.causes import other_texts
from tests.examiner.cases import N_BEFORE, Case, draw
from tests.examiner.path import after, observation, structure_of
from tests.examiner.signals import estimated
from updater.diagnosis import Cause, OtherStiffness
from updater.quantities import vector

CELL = "portal: support_stiffness"  # one of two feet has lost 40 to 90 % of its stiffness about each axis
SURE = 0.999  # of a right estimate, that it passes


def found(seed: int, left: float = 1.0) -> Cause:
    """Return the foot that is named, where a share is left of the other one's stiffness about each axis."""
    print(f"seed {seed}, {left} left")
    case = draw(CELL, seed)
    done, frame = case.done, case.done.after.frame
    grounds = tuple(
        replace(new, about=vector(np.multiply(new.about, left))) if new == old else new
        for old, new in zip(done.before.frame.grounds, frame.grounds, strict=True)
    )
    case = replace(case, done=replace(done, after=done.after.of_frame(replace(frame, grounds=grounds))))
    return _named(case)


def _named(case: Case) -> Cause:
    random = np.random.default_rng((case.seed, 6))
    before = observation(case.done.before, estimated(case.done.before, N_BEFORE, random, noise="law"))
    return explain(structure_of(CELL), before, after(case, random), only=["support_stiffness"]).diagnosis.causes[0]


def deviations(others: tuple[OtherStiffness, ...], left: float = 1.0) -> list[float]:
    """Return the errors of estimates relative to their standard deviations."""
    return [(one.change_percent - 100 * (left - 1)) / one.std_percent for one in others]


def test_foot_that_did_not_change_is_estimated_within_its_deviations() -> None:
    cause = found(2000)
    (text,) = other_texts(cause)
    print(text)
    assert {one.parameter for one in cause.others} >= {"stiffness_rx", "stiffness_ry"}
    assert sum(np.square(deviations(cause.others))) < chi2.ppf(SURE, len(cause.others))
    assert text.startswith("foot of the ")
    assert ": no significant change (about x " in text


@pytest.mark.thorough
@pytest.mark.timeout(1200)
def test_deviations_cover_feet_that_did_not_change() -> None:
    errors = np.array([error for seed in range(2000, 2020) for error in deviations(found(seed).others)])
    print(f"{len(errors)} springs, rms {np.sqrt((errors**2).mean()):.2f} deviations")
    assert len(errors) >= 2 * 20
    assert (errors**2).sum() < chi2.ppf(SURE, len(errors))


def test_text_states_other_feet_by_place_and_axis() -> None:
    about_x = OtherStiffness(
        name="foot of the left post",
        position=(0, 0, 0),
        member=None,
        parameter="stiffness_rx",
        change_percent=1.3,
        std_percent=4.2,
        deviations=-0.3,
    )
    changed = {"parameter": "stiffness_z", "change_percent": -31.0, "std_percent": 5.0, "deviations": 9.0}
    along_z = about_x.model_copy(update=changed)
    of_two = [about_x.model_copy(update={"name": "joint of post and beam", "member": m}) for m in ("post", "beam")]
    cause = Cause(cause="support_stiffness", where=None, parameters={}, probability=1.0)
    assert other_texts(cause) == []
    one, both, two = (
        cause.model_copy(update={"others": others}) for others in ((about_x,), (about_x, along_z), tuple(of_two))
    )
    assert other_texts(one) == ["foot of the left post: no significant change (about x +1 ± 4 %)"]
    assert [text.partition(":")[0] for text in other_texts(two)] == [
        "joint of post and beam (post)",
        "joint of post and beam (beam)",
    ]
    assert other_texts(both) == ["foot of the left post: stiffness about x +1 ± 4 %, along z -31 ± 5 %"]

"""Places of a posterior over positions: near a joint those on the members that meet there are one."""

import numpy as np
import pytest

from tests.support.updater.reference_frame import t_frame
from updater.inference import PositionPosterior

STEP = 0.005  # m


def posterior_of(*shares: tuple[str, float, float]) -> PositionPosterior:
    """Return the posterior of shares (member, distance from its start [m], probability), each on one position."""
    members = t_frame().member
    member = np.concatenate([np.full(round(m.length / STEP) + 1, i) for i, m in enumerate(members)])
    position = np.concatenate([np.arange(round(m.length / STEP) + 1) * STEP for m in members])
    probability = np.zeros(len(member))
    for name, distance, share in shares:
        number = [m.name for m in members].index(name)
        probability[np.flatnonzero(member == number)[round(distance / STEP)]] = share
    return PositionPosterior(
        members=members, member=member, position=position, probability=probability, length=np.full(len(member), STEP)
    )


def test_places_on_two_members_next_to_their_joint_are_one() -> None:
    """The crossbeam is on the column's top: 5 mm along the crossbeam and 5 mm down the column are one corner."""
    frame = t_frame()
    column, crossbeam = frame.member_named("column"), frame.member_named("crossbeam")
    at = float((np.array(column.end) - crossbeam.start) @ (np.subtract(crossbeam.end, crossbeam.start))) / (
        crossbeam.length
    )
    found = posterior_of(("column", column.length - STEP, 0.6), ("crossbeam", at + STEP, 0.3), ("column", 0.5, 0.1))
    corner, away = found.separate_places
    assert [found.members[place.member].name for place in corner] == ["column", "crossbeam"]
    assert sum(place.probability for place in corner) == pytest.approx(0.9)
    assert [place.probability for place in away] == pytest.approx([0.1])


def test_most_probable_place_is_first_though_its_parts_are_smaller() -> None:
    frame = t_frame()
    top, middle = frame.member_named("column").length, frame.member_named("crossbeam").length / 2
    found = posterior_of(("column", 0.5, 0.4), ("column", top - STEP, 0.3), ("crossbeam", middle, 0.3))
    assert [len(places) for places in found.separate_places] == [2, 1]


def test_probability_is_that_of_the_joint_or_of_the_whole_member() -> None:
    """A second place on the column counts for the column, if the first one is on it alone; not for its joint."""
    frame = t_frame()
    top, middle = frame.member_named("column").length, frame.member_named("crossbeam").length / 2
    joint = posterior_of(("column", top - STEP, 0.4), ("crossbeam", middle, 0.2), ("column", 0.5, 0.4))
    assert joint.member_probability == pytest.approx(0.6)
    member = posterior_of(("column", 0.5, 0.5), ("column", 1.0, 0.3), ("crossbeam", middle, 0.2))
    assert member.member_probability == pytest.approx(0.8)

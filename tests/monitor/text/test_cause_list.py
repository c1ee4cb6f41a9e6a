"""Causes as they are listed: one entry for one part of the structure."""

import pytest

from monitor.text.cause_list import listed_causes
from monitor.text.causes import alternative_texts, brief_text, cause_text
from updater import Cause
from updater.quantities import ParameterChange, Quantity, Where

FOOT = Where(position=(2.8, 0.0, 0.0), position_std=0.0, name="foot of the right post")


def foot(axis: str = "ry", probability: float = 0.6, value: float = 1.2e5) -> Cause:
    change = ParameterChange(
        name=f"support 1.{axis}",
        quantity=f"rotational stiffness about {axis[1]}",
        of="support 1",
        position=FOOT.position,
        unit="N m/rad",
        before=1e6,
        before_std=8e4,
        after=value,
        std=2.4e3,
    )
    quantity = Quantity(value=value, std=2.4e3, unit="N m/rad")
    return Cause(
        cause="support_stiffness",
        probability=probability,
        where=FOOT,
        parameters={f"stiffness_{axis}": quantity},
        changes=(change,),
    )


def crack(height: float = 0.05, probability: float = 0.6) -> Cause:
    near = Where(
        member="right post",
        position=(2.8, 0.0, height),
        position_std=0.01,
        name="foot of the right post" if height < 0.1 else "right post",
    )
    return Cause(
        cause="local_stiffness",
        probability=probability,
        where=near,
        parameters={"loss": Quantity(value=0.3, std=0.1, unit="-")},
    )


def damping(probability: float) -> Cause:
    return Cause(
        cause="damping_change",
        probability=probability,
        where=None,
        parameters={"factor": Quantity(value=1.57, std=0.17, unit="-")},
    )


def test_foot_and_crack_next_to_it_are_one_entry() -> None:
    for probability, total in ((0.6, 0.6), (0.4, 1.0)):  # in one alternative, and in two
        (one,) = listed_causes([crack(probability=probability), foot()])
        assert one.cause == "support_stiffness"
        assert one.cannot_be_told_from == ("local_stiffness",)
        assert one.probability == pytest.approx(total)
        assert alternative_texts(one) == [cause_text(crack())]
    assert len(listed_causes([crack(1.0), foot()])) == 2


def test_two_axes_of_a_foot_are_one_entry() -> None:
    (one,) = listed_causes([foot("ry"), foot("rx", value=2e5)])
    assert cause_text(one) == (
        "support stiffness at the foot of the right post, (2.800, 0.000, 0.000) m: "
        "rotational stiffness about x 1000 ± 80 -> 200.0 ± 2.4 kN m/rad (-80.0 ± 1.3 %), "
        "rotational stiffness about y 1000 ± 80 -> 120.0 ± 2.4 kN m/rad (-88.0 ± 0.9 %)"
    )


def uncertain_foot() -> Cause:
    """A foot whose stiffness was hardly known before, and that has become clearly softer."""
    first = (
        foot("rx")
        .changes[0]
        .model_copy(update={"before": 6e6, "before_std": 4e6, "after": 2.8e6, "std": 0.96e6, "member": "right post"})
    )
    turn = first.model_copy(update={"member_stiffness": 1.5e5})
    twist = turn.model_copy(
        update={
            "quantity": "rotational stiffness about z",
            "before": 5e5,
            "before_std": 1e5,
            "after": 3e5,
            "std": 4e4,
            "member_stiffness": 2.4e4,
            "twists": True,
        }
    )
    return foot("rx").model_copy(update={"changes": (turn, twist)})


def test_overlapping_stiffness_is_given_by_the_flexibility_added() -> None:
    """1/2.8 - 1/6 = 0.190 and 1/0.3 - 1/0.5 = 1.33 rad/(MN m); deviations: the squares of 1/k^2 sigma subtract."""
    std = [
        1e3 * ((s / k**2) ** 2 - (s0 / k0**2) ** 2) ** 0.5
        for k, s, k0, s0 in ((2.8, 0.96, 6, 4), (0.3, 0.04, 0.5, 0.1))
    ]
    assert std == pytest.approx([51.5, 193.7], rel=2e-3)
    assert cause_text(uncertain_foot()).partition(": ")[2] == (
        "rotational flexibility about x +0.19 ± 0.05 mrad per kN m (2.9 ± 0.8 % of L/4EI of the right post), "
        "rotational flexibility about z +1.33 ± 0.19 mrad per kN m (3.2 ± 0.5 % of L/GJ of the right post)"
    )


def test_stiffness_in_one_sentence_has_one_unit() -> None:
    two = listed_causes([foot("ry", value=1.2e5), foot("rx", value=0.7e6)])
    assert "rotational stiffness about x 1000 ± 80 -> 700.0 ± 2.4 kN m/rad" in cause_text(two[0])


def test_alternative_is_named_with_its_place_in_a_headline() -> None:
    (one,) = listed_causes([crack(), foot()])
    assert brief_text(one) == (
        "support stiffness at the foot of the right post, (2.800, 0.000, 0.000) m or local stiffness on the right post "
        "at (2.800, 0.000, 0.050) m ± 10 mm, at the foot of the right post"
    )


def test_cause_that_two_alternatives_share_has_the_sum_of_their_probabilities() -> None:
    listed = listed_causes([foot(probability=0.57), damping(0.57), foot(probability=0.43, value=1.21e5)])
    assert [c.cause for c in listed] == ["support_stiffness", "damping_change"]
    assert [c.probability for c in listed] == pytest.approx([1.0, 0.57])


def test_deviation_of_a_relative_change() -> None:
    """Flexibilities 1/k add: k / k0 = f0 / (f0 + d) with independent errors of f0 and d."""
    (change,) = foot().changes
    assert change.relative
    relative, std = change.relative
    before, after, of_before, of_after = 1e-6, 1 / 1.2e5, 8e4 / 1e12, 2.4e3 / 1.2e5**2
    more = after - before
    of_more = (of_after**2 - of_before**2) ** 0.5
    assert relative == pytest.approx(-0.88)
    assert std == pytest.approx(((more * of_before) ** 2 + (before * of_more) ** 2) ** 0.5 / after**2)

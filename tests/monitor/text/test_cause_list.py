"""Causes as they are listed: one entry for one part of the structure."""

import pytest

from monitor.text.cause_list import listed_causes
from monitor.text.causes import cause_text
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
    assert len(listed_causes([crack(1.0), foot()])) == 2


def test_two_axes_of_a_foot_are_one_entry() -> None:
    (one,) = listed_causes([foot("ry"), foot("rx", value=2e5)])
    assert cause_text(one) == (
        "support stiffness at the foot of the right post, (2.800, 0.000, 0.000) m: "
        "rotational stiffness about x 1000 ± 80 -> 200.0 ± 2.4 kN m/rad (-80.0 ± 1.3 %), "
        "rotational stiffness about y 1000 ± 80 -> 120.0 ± 2.4 kN m/rad (-88.0 ± 0.9 %)"
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

"""Findings in words."""

import numpy as np
import pytest

from daq.notebook import number_text
from monitor.results.comparison import BalanceResult
from monitor.text.causes import (
    cause_text,
    change_texts,
    fit_text,
    further_changes,
    further_changes_text,
    gain_text,
    gain_texts,
    left_over_text,
    lost_modes_text,
    parameter_text,
    uncertain_text,
    where_text,
)
from monitor.text.diagnosis import rejection_text, smallest_changes_text, written_bodies_texts
from monitor.text.verdicts import is_one_mass, verdict_text
from monitor.views.viewer.cards import window_card
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.comparison import shown
from updater import Body, Cause, Diagnosis, Gain
from updater.diagnosis import Pair, Rejected, SmallestChange
from updater.quantities import ParameterChange, Quantity, Where


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (10.7642, 0.0113, "10.764 ± 0.011"),
        (10.7642, 0.0313, "10.76 ± 0.03"),
        (173.4, 6.2, "173 ± 6"),
        (173.4, 12.4, "173 ± 12"),
        (254164.0, 10162.0, "254000 ± 10000"),
        (254164.0, 9162.0, "254000 ± 9000"),
        (0.5, 0.0, "0.5"),
        (0.5, float("nan"), "0.5"),
    ],
)
def test_a_value_is_rounded_by_its_standard_deviation(value: float, std: float, text: str) -> None:
    assert number_text(value, std) == text


@pytest.mark.parametrize(
    ("before", "after", "std", "unit", "texts"),
    [
        (None, 6.02e4, 2.9e3, "N m/rad", ("rigid", "60.2 ± 2.9 kN m/rad")),
        (2.1e11, 2.031e11, 4e8, "Pa", ("210", "203.1 ± 0.4 GPa (-3.29 ± 0.19 %)")),
        (1.181e7, 2.15e9, 2.2e11, "N m/rad", ("11.81", "over 12.7 MN m/rad (95 %)")),
    ],
)
def test_text_of_a_parameter_before_and_after(
    before: float | None, after: float, std: float, unit: str, texts: tuple[str, str]
) -> None:
    """Of the bearing that locks only a lower bound is known."""
    change = ParameterChange(
        name="a", quantity="b", of="c", position=None, unit=unit, before=before, after=after, std=std
    )
    assert change_texts(change) == texts


def test_negative_loss_is_an_increase() -> None:
    loss = Quantity(value=-0.5, std=0.05, unit="-")
    cause = Cause(
        cause="local_stiffness",
        probability=0.9,
        where=Where(member="beam"),
        parameters={"loss": loss, "loss_about_local_y": loss, "loss_in_twist": Quantity(value=0.2, std=0.1, unit="-")},
    )
    text = "local stiffness on the beam: increase about local y 50 ± 5 %, loss in twist 20 ± 10 %"
    assert cause_text(cause) == text


@pytest.mark.parametrize(("log_evidence", "ratio"), [(-2.0, "7.4"), (-20.0, "1e9"), (-100.0, "more than 1e12")])
def test_cause_that_fits_is_less_probable_by_a_factor(log_evidence: float, ratio: str) -> None:
    other = Rejected(cause="temperature", log_evidence=log_evidence, reason="less_probable", p_value=0.3)
    assert rejection_text(other) == f"fits the data, but is {ratio} times less probable"


def test_very_small_p_value_is_shown_as_an_upper_bound() -> None:
    site = made.Site()
    answer = site.answer(site.mass * site.sensitivity[:, site.node(site.place)], 3)
    assert fit_text(answer) == "fit p = 0.4 from 3 windows"
    assert fit_text(answer.model_copy(update={"p_value": 2e-130, "n_windows": 1})) == "fit p < 1e-12 from 1 window"


@pytest.mark.parametrize("explained", [False, True])
def test_card_mentions_unknown_location_only_if_unexplained(explained: bool) -> None:
    run = made.whole_run(made.Site())
    found = answers.diagnosis() if explained else None
    window = run["windows"][-1].model_copy(update={"answer": None, "diagnosis": found})
    card = window_card(window, made.run_results(run))
    assert ("Location not yet known" in card) == (not explained)


@pytest.mark.parametrize(
    ("name", "quantity", "text"),
    [
        ("loss", Quantity(value=0.32, std=0.02, unit="-"), "32.0 ± 2.0 %"),
        ("gain", Quantity(value=0.8, std=0.004, unit="-"), "0.800 ± 0.004"),
        ("extent", Quantity(value=0.112, std=0.02, unit="m"), "112 ± 20 mm"),
        ("delay", Quantity(value=4e-4, std=1e-5, unit="s"), "0.400 ± 0.010 ms"),
        ("angle", Quantity(value=np.pi / 18, std=np.pi / 180, unit="rad"), "10.0 ± 1.0 degrees"),
        ("force", Quantity(value=-1200.0, std=40.0, unit="N"), "-1.20 ± 0.04 kN"),
        ("stiffness_rx", Quantity(value=1.55e6, std=2e5, unit="N m/rad"), "1.55 ± 0.20 MN m/rad"),
        ("stiffness_x", Quantity(value=0.0, std=2.0, unit="N/m"), "0.0 ± 2.0 N/m"),
        ("mass", Quantity(value=0.3, std=0.01, unit="kg"), "300 ± 10 g"),
    ],
)
def test_parameters_are_shown_in_common_units(name: str, quantity: Quantity, text: str) -> None:
    assert parameter_text(name, quantity) == text


def test_stiffness_loss_about_each_axis_is_shown_once() -> None:
    """`loss`, the largest of them, is in the JSON for simple readers."""
    losses = {"loss": 0.4, "loss_about_local_y": 0.4, "loss_about_local_z": 0.1, "loss_in_twist": 0.2}
    cause = Cause(
        cause="local_stiffness",
        probability=1.0,
        where=None,
        parameters={name: Quantity(value=value, std=0.03, unit="-") for name, value in losses.items()},
        cannot_be_told_from=(),
    )
    expected = "loss about local y 40 ± 3 %, loss about local z 10 ± 3 %, loss in twist 20 ± 3 %"
    assert cause_text(cause) == f"local stiffness: {expected}"


@pytest.mark.parametrize(
    ("std", "text"),
    [
        (1.03e-3, "on the arm at (0.020, 0.000, 12.346) m ± 1 mm"),
        (0.037, "on the arm at (0.020, 0.000, 12.346) m ± 37 mm"),
        (2.14, "on the arm at (0.020, 0.000, 12.346) m ± 2.1 m"),
        (3e-4, "on the arm at (0.0200, 0.0000, 12.3457) m ± 0.3 mm"),
        (2e-5, "on the arm at (0.02000, 0.00000, 12.34568) m ± 0.02 mm"),
        (None, "on the arm at (0.020, 0.000, 12.346) m"),
    ],
)
def test_position_is_rounded_by_its_standard_deviation(std: float | None, text: str) -> None:
    assert where_text(Where(member="arm", position=(0.02, 0.0, 12.345678), position_std=std)) == text


def test_gain_is_shown_with_standard_deviations_if_known() -> None:
    pair, std = Pair(before=2.41534, after=0.0361), Pair(before=0.021, after=0.0052)
    assert gain_text(pair, std, ".3f") == ("2.415 ± 0.021", "0.036 ± 0.005")
    assert gain_text(pair, None, ".3f") == ("2.415", "0.036")
    assert gain_text(Pair(before=None, after=None), None, ".3f") == ("", "")


def test_gain_of_an_extended_model_covers_all_modes() -> None:
    gain = Gain(
        heldout=True,
        frequency_error_percent=Pair(before=5.83, after=0.131),
        one_minus_mac=Pair(before=0.1, after=0.001),
        log_likelihood=Pair(before=-100.0, after=50.0),
        n_modes=9,
        n_measured=10,
        noise_percent=0.02,
        exceeds_noise=True,
    )
    held_out = [
        "on data not used (held-out logs): 5.830 -> 0.131 % rms (9 of 10 modes)",
        "what remains is more than measurement noise (0.02 %) and less than the usual error of a beam model (0.2 %)",
        "shapes, 1 - MAC: 0.1 -> 0.001",
    ]
    assert gain_texts(gain, None) == held_out
    repeated = gain.model_copy(update={"change_error_percent": Pair(before=5.83, after=0.1312)})
    assert gain_texts(repeated, None) == held_out, "without a reference both errors are the same"
    fitted = gain.model_copy(update={"heldout": False, "change_error_percent": Pair(before=5.8, after=0.13)})
    assert gain_texts(fitted, None)[:2] == [
        "on the data that it was fitted to: 5.830 -> 0.131 % rms (9 of 10 modes)",
        "on data not used (each mode predicted from a fit to the others): 5.8 -> 0.13 % rms",
    ]
    small = gain.model_copy(update={"exceeds_noise": False})
    assert "what remains is within measurement noise (0.02 %)" in gain_texts(small, None)


def test_every_parameter_that_a_model_changes_is_named() -> None:
    def spring(axis: str, after: float, std: float, place: str) -> ParameterChange:
        quantity = f"rotational stiffness about {axis}"
        return ParameterChange(
            name=f"{place}.r{axis}", quantity=quantity, of="", position=(0.0, 0.0, 0.0), place=place, unit="N m/rad",
            before=None, after=after, std=std,
        )  # fmt: skip

    changes = (
        spring("y", 6e6, 2e6, "foot of the left post"),
        spring("x", 6e6, 4e6, "foot of the left post"),
        spring("z", 5e5, 5e5, "foot of the left post"),
        ParameterChange(
            name="steel.E",
            quantity="Young's modulus",
            of="steel",
            position=None,
            unit="Pa",
            before=210e9,
            after=212e9,
            std=2e9,
        ),
    )
    cause = Cause(cause="model_parameters", probability=0.9, where=None, parameters={}, changes=changes)
    first = "rotational stiffness about y at the foot of the left post rigid -> 6.0 ± 2.0 MN m/rad"
    assert cause_text(cause) == f"model parameters: {first}, and 3 more within two deviations of the file"
    assert further_changes_text(further_changes(cause)) == (
        "within two deviations of the file: rotational stiffness about x, z at the foot of the left post; "
        "Young's modulus of steel"
    )
    heading = "Nothing significant to explain: the data agree with the model after small changes of its parameters:"
    small = cause.model_copy(update={"changes": changes[1:]})
    for found, verdict in ((cause, "Explained:"), (small, heading)):
        diagnosis = Diagnosis.model_construct(verdict="explained", causes=(found,))
        assert verdict_text(diagnosis) == verdict
    joint, certain = spring("z", 2.7e3, 1.3e3, "joint"), spring("x", 2e3, 0.1e3, "foot of the left post")
    names = f"{joint.name}; {joint.name}"
    assert uncertain_text([joint, certain, joint]).endswith(f"from the file (--fix NAME keeps its value): {names}")
    assert not uncertain_text([certain])
    feet = tuple(spring(axis, 5e5, 5e5, f"foot of post {k}") for k in range(5) for axis in "xy")
    assert further_changes_text(feet) == "within two deviations of the file: rotational stiffness about x, y at 5 feet"
    joints = tuple(spring(axis, 5e5, 5e5, "joint of the posts and the beam") for _ in range(2) for axis in "xz")
    twice = "within two deviations of the file: rotational stiffness about x, z at the joint of the posts and the beam"
    assert further_changes_text(joints) == twice
    frame = (*feet, *(spring("z", (1 + k) * 1e5, 1e6, f"joint of storey {k}") for k in range(8)))
    few = "at the foot of post 0, at the foot of post 1"
    text = f"within two deviations of the file: rotational stiffness about x, y {few}"
    assert further_changes_text(frame) == f"{text}, at the foot of post 2; and 10 more"
    farthest = spring("z", 1.9e6, 1e6, "joint of the roof")
    text += "; rotational stiffness about z at the joint of the roof; and 11 more"
    assert further_changes_text((*frame, farthest)) == text
    assert further_changes_text(feet[:4]) == f"within two deviations of the file: rotational stiffness about x, y {few}"


@pytest.mark.parametrize(
    ("verdict", "cause", "others", "one"),
    [
        ("explained", "added_mass", (), True),
        ("ambiguous", "distributed_mass", ("added_mass",), True),
        ("ambiguous", "added_mass", ("support_stiffness",), False),
        ("explained", "sensor_gain", (), False),
        ("explained", "distributed_mass", (), False),
    ],
)
def test_single_mass_is_reported_only_if_no_other_cause_fits(
    verdict: str, cause: str, others: tuple[str, ...], one: bool
) -> None:
    first = answers.diagnosis().causes[0].model_copy(update={"cause": cause, "cannot_be_told_from": others})
    assert is_one_mass(answers.diagnosis().model_copy(update={"verdict": verdict, "causes": (first,)})) == one
    assert not is_one_mass(answers.diagnosis().model_copy(update={"verdict": verdict, "causes": (first, first)}))


@pytest.mark.parametrize(("other", "one"), [("sensor_delay", True), ("sensor_gain", False), ("joint_stiffness", False)])
def test_mass_with_a_sensor_delay_counts_as_one_mass(other: str, one: bool) -> None:
    mass, beside = answers.diagnosis().causes
    mass, beside = (c.model_copy(update={"cannot_be_told_from": ()}) for c in (mass, beside))
    causes = (mass, beside.model_copy(update={"cause": other}))
    assert is_one_mass(answers.diagnosis().model_copy(update={"causes": causes})) == one


def test_alternative_mass_causes_count_as_one_mass() -> None:
    mass = answers.diagnosis().causes[0].model_copy(update={"cannot_be_told_from": (), "probability": 0.4})
    spread = mass.model_copy(update={"cause": "distributed_mass", "probability": 0.55})
    either = answers.diagnosis().model_copy(update={"verdict": "ambiguous", "causes": (spread, mass)})
    assert is_one_mass(either)
    both = either.model_copy(update={"verdict": "explained"})
    assert not is_one_mass(both)


def test_residual_forces_are_reported_only_if_significant() -> None:
    nodes = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 2.0)]
    balance = BalanceResult(
        loss=(None, 0.03, -0.01), loss_std=(None, 0.001, 0.001), added=(None, 0.01, 0.2), added_std=(None, 0.1, 0.1),
        log_odds=-18.0,
    )  # fmt: skip
    assert left_over_text(balance, nodes).startswith(
        "residual forces indicate missing stiffness, largest at (0.00, 0.00, 1.00) m"
    )
    assert not left_over_text(balance, nodes[:2])
    assert not left_over_text(balance.model_copy(update={"log_odds": -1.0}), nodes)  # either reading may be right
    assert not left_over_text(balance.model_copy(update={"log_odds": 18.0}), nodes)  # mass, two deviations
    surer = balance.model_copy(update={"log_odds": 18.0, "added_std": (None, 0.01, 0.01)})
    assert "excess mass, largest at (0.00, 0.00, 2.00) m" in left_over_text(surer, nodes)
    gone = surer.model_copy(update={"added": (None, 0.01, -0.2)})
    assert "missing mass, largest at (0.00, 0.00, 2.00) m" in left_over_text(gone, nodes)
    stiffer = balance.model_copy(update={"loss": (None, -0.03, -0.01)})
    assert "excess stiffness, largest at (0.00, 0.00, 1.00) m" in left_over_text(stiffer, nodes)


def test_only_the_first_of_many_parameters_are_listed() -> None:
    quantity = Quantity(value=0.95, std=0.01, unit="-")
    many = Cause(
        cause="model_parameters",
        probability=1.0,
        where=None,
        parameters={f"stiffness of {k}": quantity for k in "abcdefg"},
    )
    reported = "stiffness of a 0.950 ± 0.010, stiffness of b 0.950 ± 0.010, stiffness of c 0.950 ± 0.010, and 4 more"
    assert cause_text(many) == f"model parameters: {reported}"


def test_written_body_is_named_where_it_differs_from_the_reported_one() -> None:
    cause = Cause(
        cause="added_mass",
        probability=0.9,
        where=Where(member="beam", position=(0.8, 0.0, 1.0), position_std=0.01),
        parameters={"mass": Quantity(value=0.4, std=0.02, unit="kg")},
    )
    assert written_bodies_texts([cause], [Body(at=(0.805, 0.0, 1.0), mass=0.41)]) == []
    (text,) = written_bodies_texts([cause], [Body(at=(0.805, 0.0, 1.0), mass=0.45), Body(at=(0.0, 0.0, 1.0), mass=0.4)])
    assert text.startswith("its body has 450 g at (0.805, 0.000, 1.000) m")
    (text,) = written_bodies_texts([cause], [Body(at=(0.82, 0.0, 1.0), mass=0.4)])
    assert text.startswith("its body has 400 g at (0.820, 0.000, 1.000) m")


def test_smallest_changes_have_both_sizes_and_the_length_of_the_stretch() -> None:
    mass = SmallestChange(cause="added_mass", parameter="mass", value=0.1834, value_at_most_places=0.29, unit="kg")
    loss = SmallestChange(
        cause="local_stiffness", parameter="loss", value=0.152, value_at_most_places=None, unit="-", extent=0.3
    )
    assert smallest_changes_text(()) == ""
    assert smallest_changes_text([mass, loss]) == (
        "Smallest changes that differ from errors of the model, at half of all places (at nine tenths): "
        "added mass 180 g (290 g); loss of stiffness 15 % (no size) over 0.3 m."
    )
    assert smallest_changes_text([mass], unchanged=True).endswith(
        "(290 g). If the file was fitted to these logs, its parameters may contain larger ones."
    )


@pytest.mark.parametrize(
    ("off", "expected"),
    [
        (None, "the answer does not use their changes. Repeat with windows twice as long"),
        (1.5, "the answer does not use their changes"),
        (-0.3, "with the causes the model has modes at 71.5 Hz, where they are measured now"),
        (0.0, "with the causes the model has modes at 71.5 Hz, where they are measured now"),
    ],
)
def test_modes_that_are_lost_are_those_that_the_causes_give(off: float | None, expected: str) -> None:
    """A mode may change so far that it is not recognized: the model with the causes has it where a new one is."""
    found = shown()
    *others, new = found.modes
    now = new.model_copy(update={"off_percent_after": off})
    found = found.model_copy(update={"modes": (*others, now), "measured_before": True})
    text = lost_modes_text(found)
    assert text.startswith("1 mode of the reference logs not found in the current ones (60 Hz): ")
    assert expected in text
    assert not lost_modes_text(found.model_copy(update={"measured_before": False}))

"""The contract of `modalwatch diagnose --json`: keys that other programs read, for every verdict."""

import json
import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from monitor.text.diagnosis import diagnosis_answer
from tests.support.updater.diagnosis_data import Change, learnt
from updater import Body, Circumstances, diagnose
from updater.diagnosis import SignalEvidence
from updater.quantities import Breathing, NonlinearGain, Opening

KINDS = {
    "nothing_to_explain": (201, Change()),
    "explained": (202, Change(bodies=(Body(at=(0.2, 0, 1.48), mass=0.3),))),
    "ambiguous": (203, Change(stiffness=0.97)),
    "unexplained": (204, Change(gain=tuple((c, 0.6) for c in ("col_037_x", "col_074_y", "beam_left_z", "beam_mid_y")))),
}
FACTORS = ("global_stiffness", "global_density")
#: keys that alternatives have not
OWN = {"probability", "cannot_be_told_from", "alternatives", "breathing", "signals", "others"}
CAUSE = OWN | {"cause", "where", "parameters", "changes", "advice"}
BREATHING = {"share", "open_time", "p_value", "law", "opening", "heldout"}
OPENING = {"member", "position", "axis", "flexibility", "closed", "mean", "moment", "opens"}
WHERE = {"member", "position", "position_std", "region", "channels", "name"}
GAIN_PAIRS = {"frequency_error_percent", "one_minus_mac", "log_likelihood", "change_error_percent"}
GAIN = {"heldout", "n_modes", "n_measured", "noise_percent", "exceeds_noise", *GAIN_PAIRS}
ADDED = {
    "calibration",
    "reference_steps",
    "failed",
    "within_record",
    "smallest_changes",
    "mass_tests",
    "separation",
    "follows",
    "exchanged_sections",
}  # since the contract was agreed
WHOLE = {"verdict", "causes", "rejected", "modes", "gain", "extended_model", "next_measurement"} | ADDED
PAIR = {"before", "after"}


@cache
def answer(verdict: str) -> dict[str, Any]:
    """Output for a verdict of a kind, of few causes; the event lacks the baseline's fourth mode and has one more."""
    seed, change = KINDS[verdict]
    reference, _, event = learnt(seed)
    current = event(change)
    current.log_frequency[3] = np.nan
    current.shape[3] = np.nan
    extra = replace(current.only(np.array([5])), log_frequency=np.log([200.0]))
    only = FACTORS if verdict == "unexplained" else ("added_mass", *FACTORS)
    diagnosed = diagnose(reference, current, circumstances=Circumstances(extra=extra), only=only)
    found: dict[str, Any] = json.loads(diagnosis_answer(diagnosed).model_dump_json())
    return found


@pytest.mark.parametrize("verdict", KINDS)
def test_every_verdict_has_the_keys_of_the_contract(verdict: str) -> None:
    found = answer(verdict)
    assert found["verdict"] == verdict
    assert set(found) == WHOLE
    assert isinstance(found["next_measurement"], str)
    assert found["next_measurement"]
    for cause in found["causes"]:
        assert set(cause) == CAUSE
        assert 0 <= cause["probability"] <= 1
        assert cause["where"] is None or set(cause["where"]) == WHERE
        assert {other["cause"] for other in cause["alternatives"]} == set(cause["cannot_be_told_from"])
        for other in cause["alternatives"]:
            assert set(other) == CAUSE - OWN | {"log_evidence"}
            assert other["parameters"]
        for quantity in cause["parameters"].values():
            assert set(quantity) == {"value", "std", "unit"}
            assert quantity["std"] > 0
    for rejected in found["rejected"]:
        assert set(rejected) == {"cause", "log_evidence", "why"}
        assert rejected["why"]
        powers = re.findall(r"e([+-]?\d+)", rejected["why"])
        assert all(abs(int(power)) <= 12 for power in powers), rejected["why"]  # more is known of no noise, nor model


@pytest.mark.parametrize("verdict", KINDS)
def test_only_verdicts_with_causes_have_a_gain(verdict: str) -> None:
    found = answer(verdict)
    if verdict in {"explained", "ambiguous"}:
        assert found["causes"]
        assert set(found["gain"]) == GAIN
        assert not found["gain"]["heldout"]
        for name in GAIN_PAIRS:
            assert set(found["gain"][name]) == PAIR
    else:
        assert found["causes"] == []
        assert found["gain"] is None
        assert found["extended_model"] is None
        assert found["rejected"]


@pytest.mark.parametrize("verdict", KINDS)
def test_unpaired_modes_have_null_values(verdict: str) -> None:
    modes = answer(verdict)["modes"]
    assert [set(mode) for mode in modes] == [{"frequency", "mac"}] * 9
    gone = modes[3]
    assert gone["frequency"]["measured"] is None
    assert 60 < gone["frequency"]["before"] < 75  # Hz: the frame's fourth mode
    assert gone["mac"] == {"before": None, "after": None}
    assert modes[6]["frequency"]["measured"] == pytest.approx(200)
    assert modes[6]["frequency"]["before"] is None
    for i in (0, 1, 2, 4, 5, 7, 8):
        frequency = modes[i]["frequency"]
        assert frequency["std"] > 0
        assert abs(frequency["measured"] / frequency["before"] - 1) < 0.1
        assert (frequency["after"] is None) == (verdict in {"nothing_to_explain", "unexplained"})


def test_located_cause_has_a_region_and_common_factor_no_location() -> None:
    (mass,) = answer("explained")["causes"]
    where = mass["where"]
    assert where["member"] == "crossbeam"
    assert where["channels"] == []
    assert where["position_std"] > 0
    assert where["region"]
    assert all(np.shape(piece) == (2, 3) for piece in where["region"])
    (factor,) = answer("ambiguous")["causes"]
    assert factor["where"] is None
    assert factor["cannot_be_told_from"]


def test_breathing_has_the_keys_of_the_contract() -> None:
    assert set(Breathing.model_fields) == BREATHING
    assert set(Opening.model_fields) == OPENING
    assert set(NonlinearGain.model_fields) == {"log_likelihood"}
    assert set(SignalEvidence.model_fields) == {"log_evidence", "decides"}

"""Channels that are left out are said once, those that carry the same samples together."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.explaining import seen_in
from monitor.left_out import fallen_silent, left_out_texts, told_apart


@pytest.mark.parametrize(
    ("given_up", "groups", "rest"),
    [
        ({}, [], []),
        ({"a": "constant"}, [], ["a"]),
        ({"a": "the same as b", "b": "the same as a", "c": "constant (in 1 of 4 windows)"}, [("a", "b")], ["c"]),
        ({"a": "the same as b (in 3 of 4 windows)", "b": "the same as a (in 3 of 4 windows)"}, [("a", "b")], []),
        ({"a": "the same as c", "c": "the same as a", "ab": "the same as a"}, [("a", "c", "ab")], []),
        (
            {"a": "the same as b", "b": "the same as a", "c": "the same as d", "d": "the same as c"},
            [("a", "b"), ("c", "d")],
            [],
        ),
    ],
)
def test_channels_with_the_same_samples_stand_together(
    given_up: dict[str, str], groups: list[tuple[str, ...]], rest: list[str]
) -> None:
    found, others = told_apart(given_up)
    assert found == groups
    assert list(others) == rest


def test_what_is_said_of_them() -> None:
    three = {"a": "the same as b", "b": "the same as c", "c": "the same as b", "d": "constant"}
    together, alone = left_out_texts(three)
    assert together.startswith("a, b and c carry the same samples, as after an error of cabling or export: left out")
    assert alone == "d is left out: constant"


def window(faults: dict[str, str], heard: str) -> Any:
    channels = dict.fromkeys("abc", "ok") | faults
    estimate = SimpleNamespace(channels=tuple(heard))
    return SimpleNamespace(temperature=20.0, rms=1.0, harmonics=np.empty(0), channels=channels, estimate=estimate)


def test_a_channel_that_had_a_spike_in_the_baseline_falls_silent_as_any_other() -> None:
    """What was mended, or left out of a window for a blow, was there; what was never there has not fallen silent."""
    spike, blow = {"a": "spikes: 0.01% of the samples are taken out"}, {"b": "clipped: 0.2% of the samples"}
    before = seen_in([window({"c": "constant"}, "ab"), window(spike | blow | {"c": "constant"}, "a")])
    now = seen_in([window(dict.fromkeys("abc", "constant"), "")] * 3)
    assert fallen_silent(now.faults, before.faults) == {"a": "constant", "b": "constant"}

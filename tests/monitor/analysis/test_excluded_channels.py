"""Excluded channels are reported once, those that contain identical samples together."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.analysis.excluded_channels import left_out_texts, told_apart
from monitor.watch.explanation import conditions_of
from oma import ChannelFault


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
def test_channels_with_identical_samples_are_grouped(
    given_up: dict[str, str], groups: list[tuple[str, ...]], rest: list[str]
) -> None:
    found, others = told_apart(given_up)
    assert found == groups
    assert list(others) == rest


def test_texts_of_excluded_channels() -> None:
    three = {"a": "the same as b", "b": "the same as c", "c": "the same as b", "d": "constant"}
    together, alone = left_out_texts(three)
    assert together.startswith("a, b and c contain identical samples (error of cabling or export?): left out")
    assert alone == "d is left out: constant"


def window(left_out: dict[str, ChannelFault], heard: str) -> Any:
    estimate = SimpleNamespace(channels=tuple(heard))
    return SimpleNamespace(temperature=20.0, rms=1.0, harmonics=np.empty(0), left_out=left_out, estimate=estimate)


def test_channel_is_excluded_only_if_missing_in_all_windows() -> None:
    constant, clipped = ChannelFault(kind="no_signal", text="constant"), ChannelFault(kind="clipped", text="clipped")
    seen = conditions_of([window({"b": clipped, "c": constant}, "a"), window({"c": constant}, "ab")])
    assert seen.left_out == {"c": constant}

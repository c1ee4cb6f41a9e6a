"""The alarm as a state machine: every transition, and what no sequence may bring about."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.alarms import Alarm


def after(overs: list[bool], hold: int) -> Alarm:
    alarm = Alarm(hold_windows=hold)
    for over in overs:
        alarm = alarm.consider(over=over)
    return alarm


@pytest.mark.parametrize(
    ("overs", "state"),
    [
        ([], "normal"),
        ([False], "normal"),
        ([True], "watch"),
        ([True, False], "normal"),
        ([True, True], "alarm"),
        ([True, False, True], "watch"),
        ([True, True, False], "alarm"),
        ([True, True, False, True, False], "alarm"),
        ([True, True, False, False], "normal"),
        ([True, True, False, False, True], "watch"),
    ],
)
def test_two_windows_raise_and_two_clear(overs: list[bool], state: str) -> None:
    assert after(overs, 2).state == state


def test_hold_of_one_raises_at_once() -> None:
    assert after([True], 1).state == "alarm"
    assert after([True, False], 1).state == "normal"


@given(st.lists(st.booleans(), max_size=40), st.integers(1, 5))
def test_alarm_holds_exactly_from_a_run_over_to_a_run_under(overs: list[bool], hold: int) -> None:
    alarm, expected = Alarm(hold_windows=hold), False
    for i, over in enumerate(overs):
        alarm = alarm.consider(over=over)
        run = overs[max(0, i + 1 - hold) : i + 1]
        if len(run) == hold and all(run):
            expected = True
        elif expected and len(run) == hold and not any(run):
            expected = False
        assert (alarm.state == "alarm") == expected
        assert (alarm.state == "watch") == (not expected and over)

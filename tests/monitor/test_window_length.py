"""How long the windows are that logs are cut into, and what is said where they are too short."""

import pytest
from updater_helpers import t_frame

from monitor.diagnosing import window_seconds
from updater import build_model

FRAME = t_frame()
FIRST = float(build_model(FRAME, shear_flexible=True, mass="consistent").modes(1).frequency[0])


def test_a_record_of_three_windows_is_cut_into_three() -> None:
    assert window_seconds(FRAME, 760 / FIRST) == pytest.approx(760 / FIRST / 3)


@pytest.mark.parametrize(("n_logs", "windows"), [(1, 3), (2, 2)])
def test_one_that_is_too_short_says_which_windows_it_holds(n_logs: int, windows: int) -> None:
    shortest = 140 * windows / FIRST
    with pytest.raises(ValueError, match=f"--window {int(shortest / windows)} takes shorter ones"):
        window_seconds(FRAME, shortest, n_logs)


def test_nothing_is_offered_where_no_window_would_do() -> None:
    with pytest.raises(ValueError, match="three windows of 250 periods") as found:
        window_seconds(FRAME, 240 / FIRST)
    assert "--window" not in str(found.value)

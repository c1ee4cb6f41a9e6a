"""Length of the windows into which logs are cut, and the message where they are too short."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from daq import Channel, Recording, load_recordings, write_recordings
from daq.log import as_logs
from monitor.analysis.logs import Held, log_channels, log_held
from monitor.analysis.observation import lowest_frequency, pilot_seconds, window_seconds
from monitor.analysis.time_range import time_range
from tests.support.updater.reference_frame import t_frame
from updater import build_model

REPLAY = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
FRAME = t_frame()
FIRST = float(build_model(FRAME, shear_flexible=True, mass="consistent").modes(1).frequency[0])


def test_a_record_of_three_windows_is_cut_into_three() -> None:
    assert window_seconds(FRAME, 760 / FIRST) == pytest.approx(760 / FIRST / 3)


@pytest.mark.parametrize(("n_logs", "windows"), [(1, 3), (2, 2)])
def test_error_for_a_short_record_suggests_a_window_length(n_logs: int, windows: int) -> None:
    shortest = 140 * windows / FIRST
    with pytest.raises(ValueError, match=f"--window {int(shortest / windows)} allows shorter ones"):
        window_seconds(FRAME, shortest, n_logs)


def test_error_suggests_no_window_length_if_none_is_possible() -> None:
    with pytest.raises(ValueError, match="three windows of 250 periods") as found:
        window_seconds(FRAME, 240 / FIRST)
    assert "--window" not in str(found.value)


def test_windows_fit_within_records_of_an_intermittent_logger() -> None:
    record, total = 700 / FIRST, 60 * 700 / FIRST  # by the total alone 24 windows of two and a half records
    assert window_seconds(FRAME, total) == pytest.approx(2.5 * record)
    assert window_seconds(FRAME, total, record=record) == pytest.approx(record)
    assert window_seconds(FRAME, 3 * record, record=record) == pytest.approx(record / 2)
    assert window_seconds(FRAME, total, record=240 / FIRST) == pytest.approx(2.5 * record)  # too short for a window


@pytest.mark.parametrize(
    ("lowest", "windows"),
    [
        (FIRST, 24),
        (0.85 * FIRST, 24),  # 212 periods
        (FIRST / 2, 12),
        (FIRST / 20, 3),  # too short a record for 250 periods in each of three
        (2 * FIRST, 24),
    ],
)
def test_windows_are_longer_where_a_measured_mode_is_far_below_the_first_one_of_the_file(
    lowest: float, windows: int
) -> None:
    total = 24 * 250 / FIRST
    assert window_seconds(FRAME, 1.001 * total, lowest_measured=lowest) == pytest.approx(1.001 * total / windows)


def test_a_mode_below_the_first_one_of_the_file_is_found_by_a_pilot() -> None:
    """Record of an oscillator at a third of the frequency of the file's first mode, with noise: seed 3."""
    rate, seconds = 8 * FIRST, 4000 / FIRST
    random = np.random.default_rng(3)
    pole = np.exp(2 * np.pi * (FIRST / 3) / rate * (-0.01 + 1j))
    motion = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], random.standard_normal(round(seconds * rate)))
    data = np.outer(motion / motion.std(), [1.0, 0.5]) + 0.1 * random.standard_normal((len(motion), 2))
    channels = tuple(Channel(name=c, device="a", axis=k) for k, c in enumerate("ab"))
    n = round(pilot_seconds(FRAME, seconds) * rate)
    pieces = [Recording(channels=channels, data=data[k : k + n], rate=rate, start=k) for k in range(0, 3 * n, n)]
    assert lowest_frequency(pieces) == pytest.approx(FIRST / 3, rel=0.01)
    assert lowest_frequency(pieces[:1]) == np.inf  # of one window, no scatter is known


def test_record_duration_of_an_intermittent_log_is_detected(tmp_path: Path) -> None:
    def record(start: float, seconds: float) -> Recording:
        data = np.random.default_rng(0).standard_normal((round(100 * seconds), 1))
        channels = (Channel(name="a", device="a", axis=0),)
        return Recording(channels=channels, data=data, rate=100.0, start=round(start * 1e9))

    write_recordings(tmp_path / "pausing.mcap", [record(0, 20), record(50, 20), record(90, 10)])
    assert log_held(tmp_path / "pausing.mcap") == Held(seconds=49.6, record=19.6)
    write_recordings(tmp_path / "whole.mcap", [record(0, 60), record(66, 90)])  # a short outage is no habit
    assert log_held(tmp_path / "whole.mcap") == Held(seconds=149.6, record=149.6)


@pytest.mark.parametrize(("start", "stop", "windows"), [("2m18s", None, 3), (None, "2m5s", 5)])
def test_log_yields_the_expected_number_of_windows(start: str | None, stop: str | None, windows: int) -> None:
    """Devices begin and end at different times, and alignment leaves out the ends."""
    log = time_range(start, stop).of_logs(as_logs([REPLAY]))[0]
    seconds = window_seconds(FRAME, log_held(log).seconds)
    found = list(load_recordings(log, window_seconds=seconds, channels=log_channels(log)))
    assert len(found) == windows
    assert all(len(one.data) == len(found[0].data) for one in found)

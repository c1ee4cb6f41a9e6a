"""Names that were meant by misspelt words."""

import pytest

from daq.bounded_text import meant

CHANNELS = ("CH3", "CH4", "imu.accX", "top_left_z")
KEYS = ("device", "analysis.overlap", "analysis.window_seconds", "alarm.limit", "alarm.limit_low")


@pytest.mark.parametrize(
    ("word", "known", "near"),
    [
        ("Ch3", CHANNELS, "CH3"),
        ("ch30", CHANNELS, "CH3"),
        ("CH3", CHANNELS, "CH3"),
        ("accx", CHANNELS, "imu.accX"),
        ("imu.accY", CHANNELS, "imu.accX"),
        ("top_", CHANNELS, "top_left_z"),
        ("bottom", CHANNELS, ""),
        ("overlp", KEYS, "analysis.overlap"),
        ("limit", KEYS, "alarm.limit"),
        ("dev", KEYS, "device"),
        ("d", KEYS, ""),
        ("x", (), ""),
    ],
)
def test_nearest_word_is_proposed(word: str, known: tuple[str, ...], near: str) -> None:
    assert meant(word, known) == (f", did you mean {near!r}?" if near else "")

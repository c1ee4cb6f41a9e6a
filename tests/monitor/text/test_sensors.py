"""Texts on sensors: the faults of each, or the accuracy of all."""

import numpy as np

from monitor.text.sensors import health_result, health_rows, health_text
from updater.validation import SensorHealth


def health(gain: list[float], delay: list[float], std: float = 0.005) -> SensorHealth:
    n = len(gain)
    return SensorHealth(
        channels=("left", "middle", "right")[:n],
        gain=np.array(gain),
        gain_std=np.full(n, std),
        delay=np.array(delay),
        delay_std=np.full(n, 1e-5),
    )


def test_sensors_without_faults_are_summarized_in_one_line() -> None:
    reported = health_text(health_result(health([1.004, 0.99, 1.0], [2e-5, -1e-5, 0.0])))
    assert reported == (
        "sensors: no gain error over 2.0 % (95 %; largest found: middle, -1.0 ± 0.5 %), no delay over 0.040 ms (95 %)"
    )


def test_sensor_faults_are_listed_with_standard_deviations() -> None:
    found = health_result(health([-0.8, 1.0, 1.0], [0.0, 4e-4, -3e-4]))
    assert health_text(found) == (
        "sensors: left: polarity turned, gain -0.800 ± 0.005; middle: +0.400 ± 0.010 ms late; "
        "right: -0.300 ± 0.010 ms early"
    )
    assert [row["fault"] != "" for row in health_rows(found)] == [True, True, True]


def test_sensor_faults_are_conditional_if_the_change_is_unexplained() -> None:
    found = health_result(health([1.0, 1.0, 1.0], [0.0, 4e-4, 0.0]))
    assert health_text(found, explained=False) == (
        "sensors (assuming that the unexplained part is a sensor fault): middle: +0.400 ± 0.010 ms late"
    )


def test_gain_tolerance_is_at_least_a_tenth_of_a_percent() -> None:
    found = health_result(health([1.0002, 0.9999], [np.nan] * 2, std=1e-4))
    assert health_text(found) == "sensors: no gain error over 0.1 % (95 %; largest found: left, +0.020 ± 0.010 %)"


def test_uncertain_gain_is_not_reported_as_a_fault() -> None:
    found = health_result(health([0.85, 1.0, 1.0], [np.nan] * 3, std=0.05))
    assert health_text(found) == "sensors: no gain error over 25.0 % (95 %; largest found: left, -15 ± 5 %)"
    assert health_rows(found)[0] == {"channel": "left", "gain": "0.85 ± 0.05", "delay": "not known", "fault": ""}

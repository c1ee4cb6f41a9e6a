"""Sentences on the course of a run."""

from monitor.results.run_results import RunResults
from monitor.results.windows import AlarmResult, Novelty, WindowResult
from monitor.text.causes import change_text
from monitor.text.verdicts import changed_between, diagnosis_text
from updater import Diagnosis
from updater.diagnosis.schema.values import Failed

MINUTE = 60 * 10**9


def test_change_is_dated_before_its_alarm_although_a_later_window_is_within_the_limit() -> None:
    """Windows 3 and 4 raise the alarm at 5 min; window 6 is at the limit, window 7 over it."""
    distances = [1.0, 2.0, 1.0, 15.0, 18.0, 13.0, 10.0, 16.0]
    windows = tuple(
        WindowResult(
            index=k,
            start=k * MINUTE,
            end=(k + 1) * MINUTE,
            phase="alarm" if k > 3 else "watching",
            channels=["a_x"],
            modes=[],
            novelty=Novelty(t2=distance, limit=10.0, modes=[]),
        )
        for k, distance in enumerate(distances)
    )
    alarm = AlarmResult(time=5 * MINUTE, state="alarm", text="", window=4)
    results = RunResults(name="frame", reference=None, windows=windows, alarms=(alarm,))
    assert changed_between(results) == (3 * MINUTE, 4 * MINUTE)


def test_unexplained_change_names_what_an_internal_error_left_out() -> None:
    found = Diagnosis(verdict="unexplained", causes=(), modes=(), gain=None, calibration=None)
    assert change_text(found) == "no known cause explains it"
    failed = (Failed(part="added_mass", error="IndexError: 4"), Failed(part="sensor_gain and crack", error="OSError"))
    text = "not considered because of internal errors: added mass, sensor gain and crack"
    incomplete = found.model_copy(update={"failed": failed})
    assert change_text(incomplete) == f"no known cause explains it ({text})"
    assert diagnosis_text(incomplete).endswith(f"between data and model ({text}).")

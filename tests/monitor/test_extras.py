"""What is found beside the verdict may fail, but never costs the alarm."""

import pytest
from watch_helpers import BASELINE, Played, run

from monitor.results import AlarmResult, SelfTestResult
from updater import Body


def fails(*_: object, **__: object) -> None:
    raise IndexError("a case that nobody thought of")


def test_alarm_is_raised_though_diagnosis_sensors_and_self_test_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each would end the process of the analysis, with each window anew."""
    monkeypatch.setattr("monitor.judging.answer", fails)
    monkeypatch.setattr("monitor.judging.sensors", fails)
    monkeypatch.setattr("monitor.self_test.self_test", fails)
    played = Played(7, monkeypatch)
    played.settings = played.settings.model_copy(
        update={"alarm": played.settings.alarm.model_copy(update={"self_test_days": 0.05})}
    )
    pipeline = played.pipeline()
    calm = run(pipeline, played.windows(2 * BASELINE))
    played.put(Body(at=(0.0, 0.0, 0.9), mass=0.25))
    results = run(pipeline, played.windows(3))
    said = [result for result in (*calm, *results) if isinstance(result, AlarmResult)]
    assert [change.kind for change in said if change.raised] == ["state"]
    failed = [change.text.partition(" has failed")[0] for change in said if change.kind == "failed"]
    assert set(failed) == {"the diagnosis", "the look at the sensors", "the self-test"}
    assert failed.count("the self-test") == 1  # not again with each window
    assert all("IndexError: a case that nobody thought of" in change.text for change in said if change.kind == "failed")
    assert not any(isinstance(result, SelfTestResult) for result in calm)

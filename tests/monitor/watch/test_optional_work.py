"""Results other than the verdict may fail, but never cost the alarm."""

import numpy as np
import pytest

from monitor.results.windows import AlarmResult, SelfTestResult
from tests.support.monitor.played_windows import BASELINE, Played, judged, run
from tests.support.thorough import few_of
from updater import Body, Reference
from updater.causes import CATALOGUE, CatalogueEntry, Cause
from updater.inference import Comparison


def fails(*_: object, **__: object) -> None:
    raise IndexError("a case that nobody thought of")


def test_alarm_is_raised_although_diagnosis_sensor_check_and_self_test_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each would end the process of the analysis, with each window again."""
    monkeypatch.setattr("monitor.watch.window_evaluator.answer", fails)
    monkeypatch.setattr("monitor.watch.window_evaluator.sensors", fails)
    monkeypatch.setattr("monitor.watch.pipeline.signals_of", fails)
    monkeypatch.setattr("monitor.watch.self_test.self_test", fails)
    played = Played(7, monkeypatch)
    played.settings = played.settings.model_copy(
        update={"alarm": played.settings.alarm.model_copy(update={"self_test_days": 0.05})}
    )
    pipeline = played.pipeline()
    calm = run(pipeline, played.windows(2 * BASELINE))
    played.put(Body(at=(0.0, 0.0, 0.9), mass=0.25))
    results = run(pipeline, played.windows(3))
    reported = [result for result in (*calm, *results) if isinstance(result, AlarmResult)]
    assert [change.kind for change in reported if change.raised] == ["state"]
    failed = [change.text.partition(" has failed")[0] for change in reported if change.kind == "failed"]
    assert set(failed) == {"the diagnosis", "the look at the sensors", "the self-test", "the selection of signals"}
    assert failed.count("the self-test") == 1  # not again with each window
    assert all(
        "IndexError: a case that nobody thought of" in change.text for change in reported if change.kind == "failed"
    )
    assert not any(isinstance(result, SelfTestResult) for result in calm)


def singular(*_: object, **__: object) -> None:
    raise np.linalg.LinAlgError("Singular matrix")  # a ValueError, but no bad input


def broken(reference: Reference, comparison: Comparison) -> Cause:
    del reference, comparison
    raise IndexError("index 3 is out of bounds")


@pytest.mark.parametrize(
    ("parts", "left"),
    few_of(
        [
            (("explain_windows",), {"increments"}),
            (("compare_windows", "locate_mass_with_forecast", "increment_result"), {"diagnosis"}),
        ]
    ),
)
def test_failed_part_of_the_answer_does_not_affect_the_others(
    parts: tuple[str, ...], left: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The alarm is raised and the other parts are there; a cause that fails within the diagnosis is reported once."""
    causes = {"added_mass": CATALOGUE["added_mass"], "axial_force": CatalogueEntry(propose=broken)}
    monkeypatch.setattr(CATALOGUE, "_all", causes)
    for part in parts:
        monkeypatch.setattr(f"monitor.watch.answer.{part}", singular)
    played = Played(7, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    played.put(Body(at=(0.0, 0.0, 0.9), mass=0.25))
    results = run(pipeline, played.windows(4))
    reported = [result for result in results if isinstance(result, AlarmResult)]
    assert [change.kind for change in reported if change.raised] == ["state"]
    answered = [w for w in judged(results) if any(getattr(w, name) for name in left)]
    assert len(answered) >= 2
    names = ("increments", "diagnosis", "discrepancy", "answer")
    assert {name for name in names if getattr(answered[-1], name)} == left
    failed = [change.text for change in reported if change.kind == "failed"]
    faults = [text for text in failed if text.endswith("has failed: LinAlgError: Singular matrix")]
    assert len(faults) == len(parts) * len(answered)
    of_cause = ["internal error, axial force was not considered: IndexError: index 3 is out of bounds"]
    assert [text for text in failed if text not in faults] == of_cause * ("diagnosis" in left)

"""A structure that changes once more, or gradually, while the alarm is active: the answer is for its present state."""

import numpy as np
import pytest

from daq import Event, FloatArray
from monitor.results.service_events import ChangeAccepted
from monitor.results.windows import AlarmResult, ModalChange, ReferenceResult, Result
from monitor.text.quantities import utc
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.played_windows import BASELINE, START, STEP, Played, judged, run
from tests.support.thorough import few_of
from updater import Body

PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)


def watched(seed: int, monkeypatch: pytest.MonkeyPatch) -> tuple[Played, Pipeline]:
    """Return a site without a structure file after its baseline."""
    played = Played(seed, monkeypatch)
    played.structure = None
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    return played, pipeline


def filled(played: Played, pipeline: Pipeline, masses: FloatArray) -> list[Result]:
    """Return the results of windows with a body that has another mass in each."""
    found = []
    for mass in masses:
        played.put(PUMP.model_copy(update={"mass": float(mass)}))
        found += run(pipeline, played.windows(1))
    return found


def of_kind(results: list[Result], *kinds: str) -> list[AlarmResult]:
    return [r for r in results if isinstance(r, AlarmResult) and r.kind in kinds]


def further(results: list[Result]) -> list[AlarmResult]:
    return of_kind(results, "changed_again", "changing", "change_ended")


def last_change(results: list[Result]) -> ModalChange:
    return [w.change for w in judged(results) if w.change][-1]


def errors(change: ModalChange, played: Played, mass: float) -> FloatArray:
    """Return the errors of the shifts over their deviations."""
    body = PUMP.model_copy(update={"mass": mass})
    true = 100 * (played.true_frequency(body) / played.true_frequency(None) - 1)
    shift = np.array([(mode.shift_percent, mode.shift_std_percent) for mode in change.modes]).T
    return np.asarray((shift[0] - true) / shift[1])


@pytest.mark.parametrize("seed", few_of([81, 82, 83, 84, 85, 86]))
def test_answer_is_for_the_state_after_a_further_step(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline = watched(seed, monkeypatch)
    before = filled(played, pipeline, np.full(10, PUMP.mass))
    assert further(before) == []
    after = filled(played, pipeline, np.full(8, 1.5 * PUMP.mass))
    [notice] = further(after)
    assert (notice.kind, notice.state, notice.quiet) == ("changed_again", "alarm", False)
    steps = [utc(START + (BASELINE + 10 + k) * STEP * 10**9) for k in (-1, 0)]
    assert f"changed again between {steps[0]} and {steps[1]}; the answer is for the state since: " in notice.text
    found = last_change(after)
    assert found.n_windows <= 8
    assert np.abs(errors(found, played, 1.5 * PUMP.mass)).max() < 4
    assert np.abs(errors(found, played, 1.25 * PUMP.mass)).max() > 10  # as far as the mean of both states is
    back = filled(played, pipeline, np.full(8, PUMP.mass))
    assert [notice.kind for notice in further(back)] == ["changed_again"]
    assert np.abs(errors(last_change(back), played, PUMP.mass)).max() < 4


@pytest.mark.parametrize("seed", few_of([91, 92, 93, 94, 95, 96], 0))
def test_answer_is_for_the_end_of_a_gradual_change(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tank that is being filled: the last third of the windows, at their mean time."""
    played, pipeline = watched(seed, monkeypatch)
    masses = np.linspace(0.2, 0.8, 30)
    results = filled(played, pipeline, masses)
    notices = further(results)
    assert [(notice.kind, notice.quiet) for notice in notices] == [("changing", True)]
    assert "the structure changes gradually" in notices[0].text
    found = last_change(results)
    assert found.n_windows < 12
    assert np.nanmax(np.abs(errors(found, played, masses[-found.n_windows :].mean()))) < 5  # a curve is no line
    assert np.nanmax(np.abs(errors(found, played, masses.mean()))) > 5


@pytest.mark.parametrize("seed", few_of([101, 102, 103, 104, 105, 106]))
def test_alarm_of_one_state_has_no_further_change(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each window repeats the look, at a probability of one in a million."""
    played, pipeline = watched(seed, monkeypatch)
    results = filled(played, pipeline, np.full(30, PUMP.mass))
    assert further(results) == []
    assert last_change(results).n_windows == 29


@pytest.mark.parametrize("seed", few_of([111, 112, 113, 114, 115, 116]))
def test_acceptance_waits_for_the_end_of_a_gradual_change(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mean of a filling tank is no state to watch from."""
    played, pipeline = watched(seed, monkeypatch)
    filled(played, pipeline, np.linspace(0.2, 0.8, 24))
    payload = {"cause": "tank in service", "by": "Ada"}
    [waiting] = pipeline.push(Event(topic=ChangeAccepted.topic, time=7, payload=payload))
    assert isinstance(waiting, AlarmResult)
    assert waiting.kind == "accepting"
    assert waiting.text.startswith(
        "to be accepted as 'tank in service' once 5 windows show the state after the gradual change"
    )
    assert of_kind(filled(played, pipeline, np.linspace(0.83, 1.0, 7)), "accepted") == []
    results = filled(played, pipeline, np.full(14, 1.0))
    [ended] = of_kind(results, "change_ended")
    assert (ended.state, ended.quiet) == ("alarm", True)
    [accepted] = of_kind(results, "accepted")
    [reference] = [result for result in results if isinstance(result, ReferenceResult)]
    [change] = reference.accepted
    body = PUMP.model_copy(update={"mass": 1.0})
    true = 100 * (played.true_frequency(body) / played.true_frequency(None) - 1)
    shift, std = np.array([change.shift_percent, change.shift_std_percent], np.float64)  # NaN of a mode that is hidden
    assert np.isfinite(shift).sum() > len(shift) / 2
    assert np.nanmax(np.abs((shift - true) / std)) < 4
    after = [window for window in judged(results) if window.start > accepted.time]
    assert all(window.novelty and window.novelty.t2 < window.novelty.limit for window in after)


def test_first_window_above_the_limit_after_a_calm_one_within_an_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may hold both states: no window of the present state is there yet, and the alarm stays active."""
    played, pipeline = watched(3, monkeypatch)
    states = []
    for body, n in ((PUMP, 3), (None, 1), (PUMP, 1)):
        played.put(body)
        states += [w.phase for w in judged(run(pipeline, played.windows(n)))]
    assert states == ["watching", *4 * ["alarm"]]

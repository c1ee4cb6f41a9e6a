"""Where the law is uncertain, that is reported with the detectable change."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray, Recording
from monitor.detection import DETECTORS, DetectionSettings, LawState, accept, judge, least_unsure, start
from monitor.results.run_results import RunResults
from monitor.results.windows import AlarmResult, ReferenceResult, WindowResult
from monitor.service.replay import ReplayReport
from monitor.text.verdicts import headline
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, without_answers

P, STD, DAY = 6, 5e-4, 144
WEEK = DetectionSettings(rate=1 / 52596 / len(DETECTORS), overlap=0.0, hold=2)


def at(watched: LawState, celsius: float, change: float) -> tuple[float, float | None]:
    """Return how far a noiseless window, all frequencies changed alike, is over the jump's limit, and the least."""
    known, _ = judge(watched, np.zeros((1, P)), np.array([celsius]), np.array([600.0]))
    predicted = watched.law.centre + watched.law.scale * (known.terms[..., 0, :] @ watched.law.coefficient)
    found, after = judge(watched, predicted + change, np.array([celsius]), np.array([600.0]))
    return float(found.value[0, 0] / found.limit[0, 0]), least_unsure(after, found)


def learnt(temperature: FloatArray, *, tailed: bool = False) -> LawState:
    random = np.random.default_rng(11)
    drawn = random.standard_t(4, (len(temperature), P)) if tailed else random.standard_normal((len(temperature), P))
    stated = np.full(drawn.shape, STD)
    return start(STD * drawn, stated, temperature, np.full(len(temperature), 600.0), WEEK)


@pytest.mark.parametrize("tailed", [False, True])
def test_smallest_detectable_change_brings_a_window_to_the_limit(*, tailed: bool) -> None:
    watched = learnt(np.linspace(10.1, 11.2, DAY), tailed=tailed)
    _, least = at(watched, 21.5, 0.0)
    assert least is not None
    print(f"seed 11, {100 * least:.2f} % at 21.5 degC")
    assert at(watched, 21.5, least)[0] == pytest.approx(1.0, rel=0.01)  # between points of a table
    assert least > 1e-3 * 10 * 2  # the prior slope is 1e-3 per kelvin, and a limit lies beyond two deviations


def test_no_uncertainty_is_reported_in_the_learned_temperature_range() -> None:
    days = 15 + 10 * np.sin(2 * np.pi * np.arange(3 * DAY + 1) / DAY)
    narrow, wide = learnt(np.linspace(10.1, 11.2, DAY)), learnt(days)
    assert at(narrow, 10.6, 0.0)[1] is None
    assert at(wide, 15.0, 0.0)[1] is None
    warm = np.full((DAY, 1), 21.5)[:, 0]
    windows = STD * np.random.default_rng(12).standard_normal((DAY, P))
    seen, after = judge(narrow, windows, warm, np.full(DAY, 600.0))
    assert at(accept(after, seen.terms, seen.whitened), 21.5, 0.0)[1] is None
    assert at(learnt(np.full(DAY, np.nan)), np.nan, 0.0)[1] is None


def warmed(windows: Iterator[Recording], celsius: FloatArray) -> Iterator[Recording]:
    for window, temperature in zip(windows, celsius, strict=True):
        yield replace(window, temperature=float(temperature))


def test_headline_states_uncertainty_outside_the_baseline_temperature_range(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without_answers(monkeypatch)
    played = Played(5, monkeypatch)
    celsius = np.concatenate([np.linspace(10.1, 11.2, BASELINE), np.full(4, 10.6), np.full(3, 21.5)])
    results = run(played.pipeline(), warmed(played.windows(len(celsius)), celsius))

    def reported(n: int) -> str:
        windows = tuple(judged(results)[:n])
        events = tuple(r for r in results if isinstance(r, AlarmResult))
        reference = next(r for r in results if isinstance(r, ReferenceResult))
        return headline(RunResults(name="frame", reference=reference, windows=windows, alarms=events), None)

    assert reported(BASELINE + 4) == "Nothing has changed in 4 windows."
    unsure = [w.novelty.unsure for w in judged(results) if w.novelty and w.novelty.unsure]
    least = max(one.least_percent for one in unsure)  # the past, which was colder, is less and less of it
    assert reported(BASELINE + 7) == (
        "No large change: in the last 3 of 7 windows, at 21.5 degC, outside the range of the baseline (10.1 to "
        f"11.2 degC), only changes of all frequencies alike by more than {least:.2g} % are detectable."
    )


def test_missing_uncertainty_field_of_an_old_log_is_no_difference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without_answers(monkeypatch)
    played = Played(5, monkeypatch)
    found = judged(run(played.pipeline(), played.windows(BASELINE + 1)))
    values = found[-1].payload()
    before = values | {"novelty": {name: v for name, v in values["novelty"].items() if name != "unsure"}}
    other = values | {"novelty": values["novelty"] | {"t2": values["novelty"]["t2"] + 1e-12}}
    for last, same in ((values, True), (before, True), (other, False)):
        logged = [*found[:-1], WindowResult.model_validate(last)]
        report = ReplayReport(attached={}, found=list(found), logged=list(logged), memory="", window_seconds=1.0)
        assert report.same == same

"""A structure that changes while a baseline is learned: live, learning starts again; reference logs lose the rest."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation
from monitor.analysis.states.stationarity import step_text
from monitor.results.windows import AlarmResult, Result
from monitor.watch.memory import memory_text, parse_memory
from oma.windows import Windows
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, without_answers
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body

PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)


def texts(results: list[Result]) -> list[str]:
    return [r.text for r in results if isinstance(r, AlarmResult)]


@pytest.mark.parametrize("seed", few_of([41, 42]))
def test_live_learning_restarts_at_a_change(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played = Played(seed, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE - 5))
    played.put(PUMP)
    reported = run(pipeline, played.windows(5))
    [text] = texts(reported)
    print(text)
    assert "the structure changed within the baseline at 2026-01-01 01:10:00 UTC" in text
    assert "learning begins anew with the 5 windows since" in text
    pipeline = played.pipeline(parse_memory(memory_text(pipeline.memory)))  # a restart loses nothing of that
    learnt = run(pipeline, played.windows(BASELINE - 5))
    assert texts(learnt) == [f"baseline learned from {BASELINE} windows"]
    later = run(pipeline, played.windows(6))
    assert not [r for r in later if isinstance(r, AlarmResult) and r.raised]
    levels = [w.novelty.level for w in judged(later) if w.novelty]
    assert max(levels) < 1
    played.put(None)
    back = run(pipeline, played.windows(3))
    assert [r for r in back if isinstance(r, AlarmResult) and r.raised]


@pytest.mark.thorough
def test_baseline_of_a_repeatedly_changing_structure_is_finally_learnt(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played = Played(43, monkeypatch)
    pipeline = played.pipeline()
    reported: list[str] = []
    for k in range(12):
        played.put(PUMP if k % 2 else None)
        reported += texts(run(pipeline, played.windows(5)))
        if reported and reported[-1].startswith("baseline learned"):
            break
    print(*reported, sep="\n")
    assert sum("begins anew" in text for text in reported) == 3
    assert reported[-1].startswith(f"baseline learned from {BASELINE} windows, though the structure changed within")


def observation(seed: int, bodies: list[Body | None]) -> Observation:
    random = np.random.default_rng(seed)
    models = {body: true_model(np.random.default_rng((seed, 1)), body) for body in set(bodies)}
    measured = [measure(models[body], random, np.ones(12)) for body in bodies]
    minute = 60 * 10**9
    estimates = tuple(replace(m, start=k * minute, end=(k + 1) * minute) for k, m in enumerate(measured))
    nothing = np.full(len(bodies), np.nan)
    return Observation(
        windows=Windows(
            estimates=estimates,
            harmonics=np.empty(0),
            channels={},
            quality=(),
            problems=(),
            start=0,
            end=len(bodies) * minute,
            rate=500.0,
        ),
        estimates=estimates,
        tracks=(np.arange(8),) * len(bodies),
        temperature=nothing,
        rms=nothing,
    )


@pytest.mark.parametrize("seed", few_of([44, 45]))
def test_reference_windows_of_another_state_are_excluded(seed: int) -> None:
    before = observation(seed, [None] * 5 + [PUMP] * 3)
    found = explain(t_frame(), before, before.chosen(np.arange(5, 8)), only=("added_mass",))
    diagnosis = found.diagnosis
    [step] = diagnosis.reference_steps
    print(f"seed {seed}", step_text(step), sep="\n")
    assert (step.n_windows, step.of_windows, step.start) == (3, 8, 5 * 60 * 10**9)
    assert found.reference.baseline.n.max() == 5
    [cause] = diagnosis.causes
    assert cause.cause == "added_mass"
    mass = cause.parameters["mass"]
    assert abs(mass.value - PUMP.mass) < 4 * mass.std

"""A site without a structure file: the measured modes are watched; a model is added without learning anew."""

from dataclasses import replace

import numpy as np
import pytest

from daq import Event
from monitor.results.service_events import AcceptanceUndone, ChangeAccepted
from monitor.results.windows import (
    AlarmResult,
    ModalChange,
    ReferenceResult,
    Result,
    SelfTestResult,
    event_result,
    result_event,
)
from monitor.text.modal_change import modal_change_text
from monitor.watch.commissioning import ProofError, gather
from monitor.watch.memory import check_saved_state, memory_text, parse_memory
from monitor.watch.memory.codec import encode
from monitor.watch.pipeline import Pipeline
from oma import ModalEstimate
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, without_answers
from tests.support.thorough import few_of
from updater import Body, PairingError, parse_structure, t_structure_toml

PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)


def watched(seed: int, monkeypatch: pytest.MonkeyPatch) -> tuple[Played, Pipeline, list[Result]]:
    """Return a site without a structure, its pipeline with a learned baseline, and the results."""
    played = Played(seed, monkeypatch)
    played.structure = None
    pipeline = played.pipeline()
    return played, pipeline, run(pipeline, played.windows(BASELINE))


def restarted(played: Played, pipeline: Pipeline) -> Pipeline:
    """Return a pipeline that continues from the saved state, with the present structure."""
    found = check_saved_state(memory_text(pipeline.memory), "memory.json", played.structure, played.settings)
    assert found.text, found.refused
    return played.pipeline(parse_memory(found.text))


def alarms(results: list[Result]) -> list[AlarmResult]:
    return [r for r in results if isinstance(r, AlarmResult)]


def levels(results: list[Result]) -> list[float]:
    """Return each window's novelty over its limit."""
    return [w.novelty.level for w in judged(results) if w.novelty]


def last_change(results: list[Result]) -> ModalChange:
    return [w.change for w in judged(results) if w.change][-1]


@pytest.mark.parametrize("seed", few_of([71, 72, 73, 74, 75, 76]))
def test_change_raises_the_alarm_and_names_the_modes_that_moved(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, learnt = watched(seed, monkeypatch)
    [baseline] = [r for r in learnt if isinstance(r, ReferenceResult)]
    assert not baseline.has_model
    assert [len(m.shape) for m in baseline.modes] == [12] * 8
    assert event_result(result_event(baseline)) == baseline  # as others read it from the log
    calm = run(pipeline, played.windows(15))
    assert not alarms(calm)  # one false alarm per year: 0.0003 expected
    played.put(PUMP)
    results = run(pipeline, played.windows(4))
    raised = [alarm for alarm in alarms(results) if alarm.raised]
    assert len(raised) == 1
    change = last_change(results)
    true = 100 * (played.true_frequency(PUMP) / played.true_frequency(None) - 1)
    shift = np.array([m.shift_percent for m in change.modes])
    std = np.array([m.shift_std_percent for m in change.modes])
    print(np.round((shift - true) / std, 1))
    assert np.all(np.abs(shift - true) < 4 * std)
    assert std.max() < 0.15  # a window has up to 0.05 %; slow effects that 12 windows cannot exclude are included
    moved = [m.id for m in change.modes if "frequency" in m.changed]
    assert moved == [k + 1 for k in np.flatnonzero(np.abs(true) > 0.1)]  # the others move by less than 0.02 %
    assert f"frequency of mode {moved[0]} (" in raised[0].text
    assert 0.98 < min(m.mac for m in change.modes) < 0.999
    assert all(w.answer is None and w.diagnosis is None for w in judged(results))


def test_damping_and_shapes_that_moved_are_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(81, monkeypatch)
    modes = played._modes
    shape, factor = modes.shape.copy(), np.where(np.isin(np.arange(8), (3, 5)), 0.99, 1.0)
    shape[5, 0] += 0.1
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    damping = modes.damping + np.where(np.arange(8) == 3, 20 * modes.damping_std, 0)
    played._modes = replace(modes, frequency=modes.frequency * factor, damping=damping, shape=shape)
    change = last_change(run(pipeline, played.windows(6)))
    assert {m.id: m.changed for m in change.modes if m.changed} == {
        4: ["frequency", "damping"],
        6: ["frequency", "shape"],
    }
    mode = change.modes[3]
    assert abs(mode.damping_shift - 20 * modes.damping_std[3]) < 4 * mode.damping_shift_std
    text = modal_change_text(change)
    print(text)
    assert text.startswith("frequency of mode 4 (68.")
    assert "shape of mode 6 (MAC 0.9" in text
    assert "damping of mode 4 from" in text


def test_one_mode_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(82, monkeypatch)
    played.structure, played.hidden = None, tuple(range(7))
    pipeline = played.pipeline()
    assert not [alarm for alarm in alarms(run(pipeline, played.windows(BASELINE + 10))) if alarm.raised]
    played._modes = replace(played._modes, frequency=0.99 * played._modes.frequency)
    results = run(pipeline, played.windows(22))  # 18 or 19 windows: a wrong pole of one mode lasts for some, too
    assert [alarm for alarm in alarms(results) if alarm.raised]
    [mode] = last_change(results).modes
    assert abs(mode.shift_percent + 1) < 4 * mode.shift_std_percent


def test_accepted_change_is_the_new_baseline_until_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(83, monkeypatch)
    played.put(PUMP)
    played.dead = {"beam_left_y": "cut"}  # as far as the other channels show it
    run(pipeline, played.windows(7))
    [reference, accepted] = list(pipeline.push(event(ChangeAccepted.topic, cause="pump, 250 g", by="Ada", alarm=None)))
    assert isinstance(reference, ReferenceResult)
    assert isinstance(accepted, AlarmResult)
    assert accepted.kind == "accepted"
    assert "pump, 250 g" in accepted.text
    assert "(frequency of mode 1" in accepted.text
    assert max(levels(run(pipeline, played.windows(6)))) < 1
    pipeline = restarted(played, pipeline)
    assert max(levels(run(pipeline, played.windows(3)))) < 1
    assert len(list(pipeline.push(event(AcceptanceUndone.topic, by="Bob", note="")))) == 2
    assert min(levels(run(pipeline, played.windows(2)))) > 1


def event(topic: str, **payload: object) -> Event:
    return Event(topic=topic, time=7, payload=payload)


def test_restart_repeats_what_an_undisturbed_run_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(84, monkeypatch)
    run(pipeline, played.windows(2))
    other = restarted(played, pipeline)
    windows = list(played.windows(4))
    assert run(other, iter(windows)) == run(pipeline, iter(windows))


def test_self_test_and_proof_need_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(85, monkeypatch)
    run(pipeline, played.windows(1))
    played.wait(8)  # one would be due
    assert not [r for r in run(pipeline, played.windows(7)) if isinstance(r, SelfTestResult)]
    played.put(PUMP)
    run(pipeline, played.windows(4))
    with pytest.raises(ProofError, match="expected a structure file in the settings, found none"):
        gather(pipeline.memory, None, played.settings)


def with_local_mode(modes: ModalEstimate, k: int, frequency: float) -> ModalEstimate:
    """Return modes with one more, the k-th, that no model of the frame has."""
    shape = np.where(np.arange(12) % 3 == 0, 1.0, -0.4) / np.linalg.norm(np.where(np.arange(12) % 3 == 0, 1.0, -0.4))
    more = modes[np.insert(np.arange(modes.n_modes), k, k)]
    more.frequency[k], more.frequency_std[k], more.shape[k] = frequency, 1e-4 * frequency, shape
    return more


def test_model_is_added_without_learning_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mode that the model lacks is not monitored; the others keep their numbers, and the detectors their state."""
    without_answers(monkeypatch)
    played = Played(86, monkeypatch)
    played._modes = with_local_mode(played._modes, 5, 120.0)
    played.structure = None
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE + 8))
    before = pipeline.memory
    played.structure = parse_structure(t_structure_toml())
    pipeline = restarted(played, pipeline)
    [reference, resumed] = list(pipeline.resume(1))
    assert isinstance(reference, ReferenceResult)
    assert isinstance(resumed, AlarmResult)
    print(resumed.text)
    assert reference.has_model
    assert [m.id for m in reference.modes] == [1, 2, 3, 4, 5, 7, 8, 9]
    assert "the model of the structure file is learned from this baseline; mode 6 without a mode of" in resumed.text
    assert pipeline.memory.baseline[0].start == before.baseline[0].start
    assert encode(pipeline.memory.detector) == encode(before.detector)
    assert not alarms(run(pipeline, played.windows(2)))
    pipeline = restarted(played, pipeline)  # the state is now that of a site with this structure
    assert [m.id for m in judged(run(pipeline, played.windows(1)))[0].modes] == [1, 2, 3, 4, 5, 7, 8, 9]
    played._modes = with_local_mode(played._true_modes(PUMP), 5, 120.0)
    changed = run(pipeline, played.windows(2))
    assert [alarm for alarm in alarms(changed) if alarm.raised]
    assert [w.increments for w in judged(changed) if w.increments]  # the model's part of the answer


def test_model_that_does_not_fit_is_refused_and_the_watch_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(87, monkeypatch)
    played.structure = parse_structure(t_structure_toml())

    def unpaired(*_: object) -> None:
        raise PairingError("only 2 measured modes are paired with a mode of the model")

    monkeypatch.setattr("monitor.watch.baseline.learned_baseline.learn_reference", unpaired)
    pipeline = restarted(played, pipeline)
    [reference, resumed] = list(pipeline.resume(1))
    assert isinstance(reference, ReferenceResult)
    assert isinstance(resumed, AlarmResult)
    print(resumed.text)
    assert not reference.has_model
    assert resumed.text.endswith(
        "; the structure file is not used: only 2 measured modes are paired with a mode of the model"
    )
    assert max(levels(run(pipeline, played.windows(3)))) < 1
    assert pipeline.memory.without_model  # the next, corrected file is tried again


def test_structure_with_delays_of_channels_needs_a_new_baseline(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, _ = watched(88, monkeypatch)
    text = t_structure_toml() + "\n[sensors.beam_left_y]\ndelay = 1e-3\n"
    found = check_saved_state(memory_text(pipeline.memory), "", parse_structure(text), played.settings)
    assert found.text is None
    assert "the structure file: none then" in (found.refused or "")

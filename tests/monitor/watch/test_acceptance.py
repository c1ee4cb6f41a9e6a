"""An accepted change is the new normal, recorded and undone; the knowledge of scatter and temperature stays."""

from pathlib import Path

import numpy as np
import pytest

from daq import Event
from monitor.outputs.history import HistoryStore, Reader, Span, database_url
from monitor.results.service_events import AcceptanceUndone, ChangeAccepted, CommandRefused
from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult, result_event
from monitor.service.operator_commands import Acceptance, Inbox, UndoAcceptance, write_command
from monitor.watch.memory import memory_text, parse_memory
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.cli import Commands
from tests.support.monitor.played_windows import BASELINE, Played, judged, run, without_answers
from tests.support.thorough import few_of
from updater import Body, parse_structure, t_structure_toml
from updater.causes import CATALOGUE

PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)
SECOND = Body(at=(0.3, 0.0, 1.48), mass=0.2)


_RUN: dict[tuple[int, int], tuple[str, list[Result]]] = {}  # saved state and results, by seed and number of windows


@pytest.fixture(autouse=True)
def _few_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Consider three causes of what is accepted, not all: which one is named is not under test here."""
    names = ("added_mass", "local_stiffness", "global_stiffness")
    monkeypatch.setattr(CATALOGUE, "_all", {name: CATALOGUE[name] for name in names})


def changed(seed: int, monkeypatch: pytest.MonkeyPatch, n: int) -> tuple[Played, Pipeline, list[Result]]:
    """Return a run of n windows of a structure with a pump, and its results."""
    played = Played(seed, monkeypatch)
    if (seed, n) not in _RUN:
        pipeline = played.pipeline()
        run(pipeline, played.windows(BASELINE))
        played.put(PUMP)
        with monkeypatch.context() as patched:
            without_answers(patched)
            results = run(pipeline, played.windows(n))
        _RUN[seed, n] = memory_text(pipeline.memory), results
        return played, pipeline, results
    text, results = _RUN[seed, n]
    assert len(list(played.windows(BASELINE + n))) == BASELINE + n  # which the saved state holds
    played.put(PUMP)
    return played, played.pipeline(parse_memory(text)), results


def accept(pipeline: Pipeline, alarm: int | None = None) -> list[Result]:
    payload = {"cause": "pump, 250 g", "by": "Ada", "alarm": alarm}
    return list(pipeline.push(Event(topic=ChangeAccepted.topic, time=7, payload=payload)))


def levels(results: list[Result]) -> list[float]:
    """Return each window's novelty over its limit."""
    return [w.novelty.t2 / w.novelty.limit for w in judged(results) if w.novelty]


def test_accepted_change_is_the_new_reference_until_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    played, pipeline, reported = changed(11, monkeypatch, 7)
    raised = next(r.time for r in reported if isinstance(r, AlarmResult) and r.raised)
    before, after = played.true_frequency(None), played.true_frequency(PUMP)
    [reference, accepted] = accept(pipeline, raised)
    assert isinstance(reference, ReferenceResult)
    assert isinstance(accepted, AlarmResult)
    assert (accepted.kind, accepted.state) == ("accepted", "normal")
    assert "accepted by Ada as 'pump, 250 g' (2" in accepted.text  # what the diagnosis found, about 250 g
    [booked] = reference.accepted
    assert (booked.cause, booked.by, booked.raised, booked.n_windows) == ("pump, 250 g", "Ada", raised, 6)
    off = np.array(booked.shift_percent) - 100 * (after / before - 1)
    assert np.all(np.abs(off) < 4 * np.array(booked.shift_std_percent))
    assert pipeline.memory.accepted[0].structure.count("[[body]]") == 1  # a mass, not a softer material

    later = run(pipeline, played.windows(6))
    assert max(levels(later)) < 1  # no alarm by what was accepted
    assert all(m.id == i for w in judged(later) for i, m in enumerate(w.modes, 1))
    restored = played.pipeline(parse_memory(memory_text(pipeline.memory)))
    window = next(played.windows(1))
    assert [r.payload() for r in restored.analyse(window)] == [r.payload() for r in pipeline.analyse(window)]

    without_answers(monkeypatch)
    [reference, undone] = pipeline.push(
        Event(topic=AcceptanceUndone.topic, time=8, payload={"by": "Bob", "note": "wrong one"})
    )
    assert isinstance(reference, ReferenceResult)
    assert isinstance(undone, AlarmResult)
    assert reference.accepted == []
    assert undone.text.endswith("undone by Bob, the earlier reference is used again: wrong one")
    again = run(pipeline, played.windows(2))
    assert min(levels(again)) > 1
    assert any(isinstance(r, AlarmResult) and r.raised for r in again)


@pytest.mark.thorough
def test_accepted_removal_of_a_body_is_saved_and_its_return_located(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """200 g on the crossbeam: the accepted structure is calibrated with the body on and does not have it."""
    causes = {name: CATALOGUE[name] for name in ("added_mass", "local_stiffness")}
    monkeypatch.setattr(CATALOGUE, "_all", causes)
    box = Body(at=(-0.2, 0.0, 1.48), mass=0.2, offset=(0.0, 0.03, 0.04), inertia=(8e-5, 8e-5, 8e-5))
    played = Played(14, monkeypatch)
    played.put(box)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    played.put(None)
    with monkeypatch.context() as patched:
        without_answers(patched)
        run(pipeline, played.windows(6))
    found = judged(run(pipeline, played.windows(1)))[-1]
    assert found.answer is not None
    assert found.answer.mass < 0
    assert [r.payload().get("kind") for r in accept(pipeline)][-1] == "accepted"
    assert parse_structure(pipeline.memory.accepted[0].structure).body == ()
    assert max(levels(run(pipeline, played.windows(3)))) < 1
    restored = played.pipeline(parse_memory(memory_text(pipeline.memory)))
    played.put(box)
    with monkeypatch.context() as patched:
        without_answers(patched)
        back = run(restored, played.windows(3))
    assert any(isinstance(r, AlarmResult) and r.raised for r in back)
    last = judged(run(restored, played.windows(1)))[-1]
    assert last.answer is not None
    assert abs(last.answer.position[0] + 0.2) < 0.02
    assert abs(last.answer.mass - 0.2) < 4 * last.answer.mass_std


@pytest.mark.thorough
@pytest.mark.parametrize("seed", few_of([12, 13]))
def test_next_change_after_an_accepted_one_is_detected(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played, pipeline, _ = changed(seed, monkeypatch, 6)
    assert accept(pipeline)[-1].payload()["kind"] == "accepted"
    assert max(levels(run(pipeline, played.windows(2)))) < 1
    played.put(SECOND)
    reported = run(pipeline, played.windows(2))
    assert min(levels(reported)) > 1
    assert [r.kind for r in reported if isinstance(r, AlarmResult) and r.raised] == ["state"]  # a new alarm


@pytest.mark.thorough
def test_modes_missing_after_an_acceptance_are_monitored_again_when_identified(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(17, monkeypatch)
    pipeline = played.pipeline()
    [*_, first, _] = (r for r in run(pipeline, played.windows(BASELINE)) if not isinstance(r, WindowResult))
    played.put(PUMP)
    played.hidden = (2, 4)
    without_answers(monkeypatch)
    run(pipeline, played.windows(6))
    [reference, accepted] = accept(pipeline)
    assert isinstance(first, ReferenceResult)
    assert isinstance(reference, ReferenceResult)
    assert isinstance(accepted, AlarmResult)
    left = [1, 2, 4, *range(6, len(first.modes) + 1)]
    assert [mode.id for mode in first.modes] == list(range(1, len(first.modes) + 1))
    assert [mode.id for mode in reference.modes] == left
    [booked] = reference.accepted
    assert [i + 1 for i, shift in enumerate(booked.shift_percent) if shift is None] == [3, 5]
    assert accepted.text.endswith(
        "; modes 3, 5 not identified, and not monitored until identified in most windows again"
    )

    assert max(levels(run(pipeline, played.windows(5)))) < 1
    restored = played.pipeline(parse_memory(memory_text(pipeline.memory)))
    window = next(played.windows(1))
    [hidden] = pipeline.analyse(window)
    assert [hidden.payload()] == [r.payload() for r in restored.analyse(window)]
    assert isinstance(hidden, WindowResult)
    assert [mode.id for mode in hidden.modes] == left

    played.hidden = (4,)  # mode 3 is back, where the pump has moved it to
    reported = [r for r in run(pipeline, played.windows(2 * BASELINE)) if not isinstance(r, WindowResult)]
    [reference, again] = reported
    assert isinstance(reference, ReferenceResult)
    assert isinstance(again, AlarmResult)
    assert (again.kind, again.state, again.quiet) == ("seen_again", "normal", True)
    assert again.text.startswith(
        "mode 3 monitored again, not identified since 'pump, 250 g' was accepted: frequency moved by "
    )
    assert [mode.id for mode in reference.modes] == sorted([*left, 3])
    [booked] = reference.accepted
    moved, std = booked.shift_percent[2], booked.shift_std_percent[2]
    assert moved is not None
    assert std is not None
    before, after = played.true_frequency(None)[2], played.true_frequency(PUMP)[2]
    assert abs(moved - 100 * (after / before - 1)) < 4 * std
    assert max(levels(run(pipeline, played.windows(6)))) < 1

    [reference, _] = pipeline.push(Event(topic=AcceptanceUndone.topic, time=8, payload={"by": "Bob"}))
    assert isinstance(reference, ReferenceResult)
    assert [mode.id for mode in reference.modes] == [mode.id for mode in first.modes]
    assert [mode.frequency for mode in reference.modes] == [mode.frequency for mode in first.modes]
    assert min(levels(run(pipeline, played.windows(2)))) > 1  # the pump still hangs there
    played.put(None)
    assert max(levels(run(pipeline, played.windows(6))[1:])) < 1  # all as before it, but for mode 5


@pytest.mark.parametrize("hidden", [(0, 1, 2, 3, 4, 5)])
def test_change_with_too_few_identified_modes_is_not_accepted(
    hidden: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    without_answers(monkeypatch)
    played = Played(18, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    played.put(PUMP)
    played.hidden = hidden
    run(pipeline, played.windows(6))
    [refused] = accept(pipeline)
    assert refused.payload()["kind"] == "refused"
    text = refused.payload()["text"]
    assert text.startswith("'pump, 250 g' cannot be accepted: only mode 7, 8 of 8 identified since the change")


def test_acceptance_waits_for_enough_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three windows of it: one may hold both states, so three more are needed; a restart forgets nothing."""
    without_answers(monkeypatch)
    played, pipeline, _ = changed(16, monkeypatch, 3)
    [waits] = accept(pipeline)
    assert isinstance(waits, AlarmResult)
    assert (waits.kind, waits.state) == ("accepting", "alarm")
    assert waits.text.endswith("5 windows since the change; there are 2")
    pipeline = played.pipeline(parse_memory(memory_text(pipeline.memory)))
    kinds = [r.kind for r in run(pipeline, played.windows(3)) if isinstance(r, AlarmResult)]
    assert kinds == ["accepted"]


def test_change_that_disappears_is_not_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    played, pipeline, _ = changed(16, monkeypatch, 3)
    accept(pipeline)
    played.put(None)
    reported = [r for r in run(pipeline, played.windows(2)) if isinstance(r, AlarmResult)]
    assert [r.kind for r in reported] == ["state", "refused"]
    assert "the change has disappeared" in reported[-1].text
    assert accept(pipeline)[0].payload()["text"] == "not accepted: no alarm is active"
    [refused] = pipeline.push(Event(topic=AcceptanceUndone.topic, time=9, payload={}))
    assert refused.payload()["text"] == "nothing is undone: no change has been accepted"


def test_pending_acceptance_can_be_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undone before there were windows enough, it does not come true when there are."""
    without_answers(monkeypatch)
    played, pipeline, _ = changed(16, monkeypatch, 3)
    [waits] = accept(pipeline)
    [undone] = pipeline.push(Event(topic=AcceptanceUndone.topic, time=8, payload={"by": "Ada", "note": ""}))
    assert [waits.payload()["kind"], undone.payload()["kind"]] == ["accepting", "undone"]
    later = run(pipeline, played.windows(6))
    assert not any(isinstance(result, AlarmResult) and result.kind == "accepted" for result in later)
    assert judged(later)[-1].phase == "alarm"


def test_acceptance_of_an_inactive_alarm_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    without_answers(monkeypatch)
    _, pipeline, _ = changed(16, monkeypatch, 3)
    [refused] = accept(pipeline, 12345)
    assert "the active alarm is of 2026-01-01" in refused.payload()["text"]


def test_inbox_reads_acceptance_and_undo_commands(tmp_path: Path) -> None:
    write_command(tmp_path, Acceptance(cause="pump", by="Ada", alarm=5))
    assert list(Inbox(tmp_path).taken()) == [ChangeAccepted(by="Ada", cause="pump", alarm=5)]
    write_command(tmp_path, UndoAcceptance(by="Bob"))
    assert list(Inbox(tmp_path).taken()) == [AcceptanceUndone(by="Bob")]
    path = write_command(tmp_path, UndoAcceptance())
    path.write_text('{"kind": "accept", "by": "Ada"}')  # as what?
    assert [type(event) for event in Inbox(tmp_path).taken()] == [CommandRefused]


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    device = '[[device]]\nname = "a"\ndriver = "epson-uart"\nport = "/dev/none"\nchannels = {y = "beam_left_y"}\n'
    (tmp_path / "site.toml").write_text(f'structure = "t_structure.toml"\n{device}', encoding="utf-8")
    return tmp_path / "site.toml"


def test_accept_command_contains_the_time_of_its_alarm(modalwatch: Commands, site: Path) -> None:
    state, minute = site.parent / "state", 60 * 10**9
    refused = modalwatch("accept", site, "--reason", "pump")
    assert (refused.code, "ALARM: no alarm is known" in refused.err) == (2, True)
    raised = AlarmResult(time=10**18, state="alarm", text="ALARM: 198 g", window=3)
    url = database_url(None, state)
    with HistoryStore(url) as store:
        store.write([result_event(raised)])
    assert "--reason: expected what the change is" in modalwatch("accept", site).err
    assert "found '2031'" in modalwatch("accept", site, "2031", "--reason", "pump").err
    done = modalwatch("accept", site, "2001-09-09 01:46", "--reason", "pump, 150 g", "--by", "Ada")
    assert (done.code, done.err) == (0, "")
    assert "ALARM: 198 g" in done.out
    assert "no monitor is running: the command is executed at the next start" in done.out
    assert list(Inbox(state).taken()) == [ChangeAccepted(by="Ada", cause="pump, 150 g", alarm=10**18)]
    assert modalwatch("accept", site, "--undo", "--by", "Bob").code == 0
    assert [type(event) for event in Inbox(state).taken()] == [AcceptanceUndone]

    text = "accepted by Ada as 'pump, 150 g'"
    closed = AlarmResult(time=10**18 + minute, state="normal", text=text, window=9, kind="accepted", lasted=60.0)
    with HistoryStore(url) as store:
        store.write([result_event(closed)])
    with Reader(url) as reader:
        [alarm] = reader.alarms(Span(start=0, end=2**62))
    assert (alarm.cleared, alarm.lasted, alarm.text) == (10**18 + minute, 60.0, text)
    assert "ALARM: no alarm is active" in modalwatch("accept", site, "--reason", "pump").err

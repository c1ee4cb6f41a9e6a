"""A saved run continues as if it had never stopped; unusable states are refused, with a message."""

import hashlib
import json
import typing
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from daq import Channel, Event, Recording
from monitor.analysis.window import IdentifiedWindow
from monitor.detection.alarm import Alarm, AlarmRules
from monitor.results.service_events import AcceptanceUndone, ChangeAccepted
from monitor.results.windows import AlarmResult, ReferenceResult
from monitor.watch.memory import MEMORY, CalmSignals, CodecError, MemoryFile, memory_text, parse_memory, recall
from monitor.watch.memory.codec import decode, encode, stored_fields
from monitor.watch.memory.state import VERSION, Memory
from tests.support.daq.blocks import make_block
from tests.support.monitor.played_windows import (
    BASELINE,
    START,
    STEP,
    Played,
    judged,
    run,
    site_settings,
    without_answers,
)
from tests.support.thorough import few_of
from updater import Body, parse_structure, t_structure_toml

PUMP = Body(at=(0.0, 0.0, 0.9), mass=0.25)


@dataclass(frozen=True, eq=False)
class Held:
    """One value of every type of the codec."""

    real: npt.NDArray[np.float64]
    several: tuple[npt.NDArray[np.complex128], ...]
    named: dict[str, float]
    state: str | None
    whole: int
    yes: bool
    inside: Alarm


@settings(max_examples=30)
@given(
    arrays(np.float64, st.tuples(st.integers(0, 3), st.integers(0, 3))),
    arrays(np.complex128, 2),
    st.floats(),
    st.none() | st.text(),
    st.integers(-(2**62), 2**62),
)
def test_all_values_are_restored_bit_for_bit(
    real: npt.NDArray[np.float64], turned: npt.NDArray[np.complex128], number: float, word: str | None, whole: int
) -> None:
    alarm = Alarm(rules=AlarmRules(latched=True), raised=whole, flips=(1, 2))
    held = Held(real, (turned, turned[:0]), {"a": number}, word, whole, True, alarm)
    back: Held = decode(Held, json.loads(json.dumps(encode(held))))
    assert (back.real.tobytes(), back.real.shape) == (real.tobytes(), real.shape)
    assert [a.tobytes() for a in back.several] == [a.tobytes() for a in held.several]
    assert np.float64(back.named["a"]).tobytes() == np.float64(number).tobytes() or np.isnan(number)
    assert (back.state, back.whole, back.yes, back.inside) == (word, whole, True, alarm)


@pytest.mark.parametrize(
    ("place", "value", "reported"),
    [
        ("whole", 1.5, "whole: expected int, found '1.5'"),
        ("whole", True, "whole: expected int, found 'True'"),
        ("real", [1], "real: expected an array, found"),
        ("real", {"dtype": "O", "shape": [], "data": ""}, "real: expected an array of numbers, found 'object'"),
        ("several", [{"dtype": "<c16", "shape": [3], "data": ""}], r"several\[0\]: expected an array"),
        ("named", [], "named: expected an object"),
        ("inside", {}, "inside: expected an object of"),
    ],
)
def test_values_of_a_wrong_type_are_named(place: str, value: object, reported: str) -> None:
    held = encode(Held(np.ones(1), (), {}, None, 1, True, Alarm(rules=AlarmRules())))
    with pytest.raises(CodecError, match=reported):
        decode(Held, held | {place: value})


@pytest.mark.parametrize("stops", [(3, BASELINE - 1, BASELINE, BASELINE + 3, BASELINE + 4)])
def test_restarts_do_not_change_the_results(stops: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """The same windows with restarts between them: while a baseline is learned; before, in and after a hold."""
    played = Played(5, monkeypatch)
    without_answers(monkeypatch)
    windows = list(played.windows(BASELINE + 5))
    through, split, reported = played.pipeline(), played.pipeline(), []
    for number, window in enumerate(windows):
        if number == BASELINE + 2:
            played.put(PUMP)
        if number in stops:
            split = played.pipeline(parse_memory(memory_text(split.memory)))
        expected = [result.payload() for result in through.analyse(window)]
        assert [result.payload() for result in split.analyse(window)] == expected
        reported += expected
    assert [s["kind"] for s in reported if s.get("state") == "alarm" and "kind" in s] == [
        "state"
    ]  # one alarm, raised once


def test_first_block_after_a_restart_reports_reference_and_active_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(6, monkeypatch)
    before = played.pipeline()
    run(before, played.windows(BASELINE))
    played.put(PUMP)
    without_answers(monkeypatch)
    raised = next(r for r in run(before, played.windows(3)) if isinstance(r, AlarmResult) and r.raised)
    after = played.pipeline(before.memory)
    [reference, resumed] = after.push(replace(make_block("d_beam_left_y", 0), arrival_time=2**61))
    assert isinstance(reference, ReferenceResult)
    assert isinstance(resumed, AlarmResult)
    assert (reference.time, reference.n_windows, resumed.time) == (2**61, BASELINE, 2**61)
    assert (resumed.kind, resumed.state, resumed.since) == ("resumed", "alarm", raised.time)
    assert not resumed.raised
    assert f"baseline of {BASELINE} windows" in resumed.text
    assert list(after.push(make_block("d_beam_left_y", 250))) == []  # once
    [window] = judged(run(after, played.windows(1)))
    assert window.increments is not None
    assert window.increments.n_windows == 3  # evidence of before the restart, less the window that may hold both states


def test_restored_run_uses_the_present_limits_and_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(7, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(BASELINE))
    played.settings = site_settings("false_alarms_per_year = 100\nhold_windows = 3")
    memory = pipeline.memory
    window = next(played.windows(1))
    [usual] = judged(list(pipeline.analyse(window)))
    changed = played.pipeline(memory)
    [rarer] = judged(list(changed.analyse(window)))
    assert usual.novelty is not None
    assert rarer.novelty is not None
    assert [d.value for d in usual.novelty.detectors] == [d.value for d in rarer.novelty.detectors]
    assert all(a.limit > b.limit for a, b in zip(usual.novelty.detectors, rarer.novelty.detectors, strict=True))
    assert changed.memory.alarm.rules.hold_windows == 3


def remembered(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Leave a memory of three windows in a folder."""
    played = Played(8, monkeypatch)
    pipeline = played.pipeline()
    run(pipeline, played.windows(3))
    path = folder / MEMORY
    path.write_text(memory_text(pipeline.memory), encoding="utf-8")
    return path


def test_saved_state_of_a_different_site_is_refused_with_the_difference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remembered(tmp_path, monkeypatch)
    structure, settings = parse_structure(t_structure_toml()), site_settings()
    assert recall(tmp_path, structure, settings).refused is None
    assert recall(tmp_path, structure, site_settings("hold_windows = 5")).refused is None  # does not matter
    shorter = settings.model_copy(update={"analysis": settings.analysis.model_copy(update={"window_seconds": 300.0})})
    found = recall(tmp_path, structure, shorter)
    assert (found.text, found.refused) == (None, "analysis.window_seconds: 600 then, 300 now")
    heavier = structure.model_copy(update={"body": (PUMP,)})
    assert (recall(tmp_path, heavier, settings).refused or "").startswith("the structure file: ")


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_damaged_saved_state_is_detected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """A bit changed, or the end cut off; SHA-256 detects either."""
    path = remembered(tmp_path, monkeypatch)
    content = bytearray(path.read_bytes())
    random = np.random.default_rng(seed)
    path.write_bytes(content[: random.integers(len(content))])
    structure, settings = parse_structure(t_structure_toml()), site_settings()
    assert "memory.json: it is" in (recall(tmp_path, structure, settings).refused or "")
    content[random.integers(len(content))] ^= 1 << int(random.integers(7))  # stays UTF-8
    path.write_bytes(content)
    found = recall(tmp_path, structure, settings)
    assert found.text is None
    assert "memory.json" in (found.refused or "")


def test_missing_saved_state_is_no_error(tmp_path: Path) -> None:
    assert recall(tmp_path, parse_structure(t_structure_toml()), site_settings()).refused is None


def test_saved_state_of_another_version_is_refused() -> None:
    with pytest.raises(CodecError, match=f"it is of version 99, this program reads {VERSION}"):
        parse_memory('{"modalwatch": 99, "sha256": ""}\n{}')


def test_saved_state_without_signals_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As version 10 wrote it: the baseline is not learned again after an update."""
    now = remembered(tmp_path, monkeypatch).read_text()
    values = json.loads(now.partition("\n")[2])
    assert values.pop("signals") is None
    content = json.dumps(values)
    head = json.dumps({"modalwatch": 10, "sha256": hashlib.sha256(content.encode()).hexdigest()})
    assert memory_text(parse_memory(f"{head}\n{content}")) == now


def stored_fields_of(kind: Any, found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Add the stored fields of a type and of all types in it, with their hints."""
    if isinstance(kind, type) and is_dataclass(kind) and kind.__name__ not in found:
        hints = typing.get_type_hints(kind)
        found[kind.__name__] = [f"{name}: {hints[name]}" for name in stored_fields(kind)]
        for name in stored_fields(kind):
            stored_fields_of(hints[name], found)
    for inside in typing.get_args(kind):
        stored_fields_of(inside, found)
    return found


@pytest.mark.parametrize(
    ("kind", "version_11"), [(Memory, "22c0a7a04c8b"), (IdentifiedWindow, "46f8de6d0c1b")], ids=["state", "steps"]
)
def test_stored_fields_change_with_their_version_only(kind: type, version_11: str) -> None:
    """With another field, a monitor would learn its baseline again after an update: raise the version, read the old."""
    fields = sorted((name, sorted(own)) for name, own in stored_fields_of(kind, {}).items())
    assert (VERSION, hashlib.sha256(repr(fields).encode()).hexdigest()[:12]) == (11, version_11)


def test_saved_state_is_written_only_after_its_result_is_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not before its result is logged, nor within the second after it; at the end at once."""
    now = 100.0
    monkeypatch.setattr("monitor.watch.memory.file.time.monotonic", lambda: now)
    events = [Event(topic="/result/window", time=n, payload={}) for n in range(3)]
    path = tmp_path / "state" / MEMORY
    with MemoryFile(path) as memory:
        for n, event in enumerate(events):
            memory.after(event)
            memory.expect(f"memory {n}")
        now += 5
        memory.write()
        assert not path.exists()
        memory.take(Event(topic="/result/window", time=0, payload={}))  # another one
        memory.take(events[1])
        memory.write()
        assert not path.exists()
        now += 1.5
        memory.write()
        assert path.read_text() == "memory 1"
        memory.take(events[2])
    assert path.read_text() == "memory 2"
    assert [p.name for p in path.parent.iterdir()] == [MEMORY]


def test_state_arriving_after_its_result_was_logged_is_written(tmp_path: Path) -> None:
    """On a busy machine the log is quicker than the words: each memory waited for a result that had been before it."""
    path = tmp_path / MEMORY
    for n in range(3):
        event = Event(topic="/result/window", time=n, payload={})
        with MemoryFile(path) as memory:
            memory.expect("of nothing")
            memory.after(event)
            memory.take(event)
            memory.expect(f"memory {n}")
        assert path.read_text() == f"memory {n}"


def test_unwritable_state_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where the folder should be")
    event = Event(topic="/result/window", time=0, payload={})
    with MemoryFile(tmp_path / "state" / MEMORY) as memory:
        memory.after(event)
        memory.expect("x")
        memory.take(event)
    assert "memory.json: " in (memory.problem or "")


def test_signals_before_a_change_are_the_end_of_the_longest_stretch_without_a_gap() -> None:
    """Saved and restored bit for bit; none of a record whose stretches are too short."""
    random = np.random.default_rng(35)
    data = random.standard_normal((40_000, 2))
    data[[9_000, 35_000], 1] = np.nan
    channels = tuple(Channel(name=name, device="d", axis=axis) for axis, name in enumerate("ab"))
    recording = Recording(channels=channels, data=data, rate=1000.0, start=7)
    kept = CalmSignals.of(recording)
    assert kept
    back: CalmSignals = decode(CalmSignals, json.loads(json.dumps(encode(kept))))
    assert back.data.tobytes() == kept.data.tobytes()
    assert (back.channels, back.rate, back.start) == (channels, 1000.0, 7 + round((35_000 - 2**14) * 1e6))
    np.testing.assert_array_equal(back.recording.data, data[35_000 - 2**14 : 35_000].astype(np.float32))
    data[::8_000, 0] = np.nan
    assert CalmSignals.of(recording) is None


def test_signals_before_a_change_are_of_the_first_calm_window_of_each_reference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They stay the same in an alarm, and are chosen again after an acceptance and after it is undone."""
    monkeypatch.setattr("monitor.watch.memory.signals._SHORTEST", 32)  # half of a window
    played = Played(12, monkeypatch)
    played.structure = None
    pipeline = played.pipeline()

    def chosen() -> int | None:
        """Return the number of the window whose signals are kept."""
        signals = pipeline.memory.signals
        return (signals.start - START) // (STEP * 10**9) if signals else None

    run(pipeline, played.windows(BASELINE))
    assert chosen() is None
    run(pipeline, played.windows(2))
    assert chosen() == BASELINE
    played.put(Body(at=(0.0, 0.0, 0.9), mass=0.25))
    assert judged(run(pipeline, played.windows(6)))[-1].phase == "alarm"
    assert chosen() == BASELINE
    payload = {"cause": "pump", "by": "Ada", "alarm": None}
    list(pipeline.push(Event(topic=ChangeAccepted.topic, time=7, payload=payload)))
    assert chosen() is None
    run(pipeline, played.windows(2))
    assert chosen() == BASELINE + 8
    list(pipeline.push(Event(topic=AcceptanceUndone.topic, time=8, payload={"by": "Bob", "note": ""})))
    assert chosen() is None

"""Steps of a delivery by a clock set by hand: heartbeats, reports of both lanes, the end of their threads."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from monitor.outputs.notices import NoticeSender
from monitor.results.service_events import NoticeFailed, NoticeRecovered
from monitor.settings import NotifySettings
from tests.support.daq.blocks import make_block

TARGETS: dict[str, dict[str, Any]] = {
    "webhook": {"webhook": "http://127.0.0.1:9/x"},
    "command": {"command": ["true"]},
    "mqtt": {"mqtt": "mqtt://127.0.0.1/t"},
}


@dataclass
class HandTime:
    """A clock that is set by hand."""

    now: float = 0.5  # s

    def monotonic(self) -> float:
        return self.now

    def time_ns(self) -> int:
        return 10**18


@dataclass
class HandThread:
    """A thread that takes some time to end."""

    clock: HandTime
    takes: float  # s
    joined: list[float] = field(default_factory=list)

    @property
    def ending(self) -> "HandThread":
        return self

    def set(self) -> None:
        self.joined.append(-1.0)

    def join(self, timeout: float) -> None:
        self.joined.append(timeout)
        self.clock.now += min(self.takes, timeout)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> HandTime:
    clock = HandTime()
    monkeypatch.setattr("monitor.outputs.notices.delivery.time", clock)
    return clock


def sender(folder: Path, **fields: Any) -> NoticeSender:
    return NoticeSender(NotifySettings.model_validate(TARGETS["webhook"] | fields), folder / "n.jsonl", "frame")


def test_heartbeat_is_periodic_while_data_are_recent(tmp_path: Path, clock: HandTime) -> None:
    made, beats = sender(tmp_path, heartbeat_minutes=2.0), []
    for second in range(0, 400, 5):
        clock.now = 0.5 + second
        if second <= 250:
            made.put(make_block("left", second))
        if second == 255:
            clock.now += 0.001
        beats += [second] if made._heartbeat() else []
    assert beats == [0, 120, 240]
    clock.now = 500.0
    made.put(make_block("left", 500))
    clock.now = 505.0
    assert made._heartbeat() is not None
    assert sender(tmp_path)._heartbeat() is None


@pytest.mark.parametrize("kind", TARGETS)
def test_lane_failures_are_reported_once_and_a_success_triggers_retries(
    kind: str, tmp_path: Path, clock: HandTime
) -> None:
    made = NoticeSender(NotifySettings.model_validate(TARGETS[kind]), tmp_path / "n.jsonl", "frame")
    for lane in (made.alarms, made.others, made.alarms):
        lane.problem, lane.due = "no answer", 300.0
        made._report(lane)
    assert list(made.events()) == [NoticeFailed(to=kind, why="no answer")]
    assert (made.alarms.due, made.others.due) == (300.0, 300.0)
    made.alarms.problem = None
    made._report(made.alarms)
    assert list(made.events()) == []  # the other lane still fails
    assert (made.alarms.due, made.others.due) == (0.0, 0.0)
    assert made.problem == "no answer"
    made.others.problem = None
    made._report(made.others)
    assert [type(event) for event in made.events()] == [NoticeRecovered]
    made._report(made.others)
    assert list(made.events()) == []
    made.others.left = True  # by an earlier run
    made._report(made.others)
    assert [type(event) for event in made.events()] == [NoticeRecovered]


@pytest.mark.parametrize(("takes", "second"), [(0.25, 3.75), (10.0, 0.0)])
def test_shutdown_takes_at_most_one_delivery_timeout_plus_one_second(
    takes: float, second: float, tmp_path: Path, clock: HandTime
) -> None:
    made = sender(tmp_path, timeout_seconds=3.0)
    threads = [HandThread(clock, takes), HandThread(clock, takes)]
    for lane, thread in zip((made.alarms, made.others), threads, strict=True):
        lane.thread = thread  # type: ignore[assignment]
    made.__exit__()
    assert threads[0].joined == [-1.0, 4.0]
    assert threads[1].joined == [-1.0, pytest.approx(second)]

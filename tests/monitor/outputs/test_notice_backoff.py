"""Back-off, Retry-After and the hourly quota, counted in requests to a server within hours of a clock set by hand."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from monitor.outputs.notices import NoticeError, make_sender
from monitor.outputs.notices.lane import Lane, Quota
from monitor.settings import NotifySettings
from monitor.text.notices import Notice
from tests.support.monitor.notices import NOTICE, Server

TROUBLE = replace(NOTICE, kind="trouble", state="")
STEP = 5  # s


@dataclass
class HandTime:
    """A clock that is set by hand."""

    now: float = 1000.0  # s

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> HandTime:
    clock = HandTime()
    monkeypatch.setattr("monitor.outputs.notices.lane.time", clock)
    return clock


@pytest.fixture
def server() -> Iterator[Server]:
    with Server().running() as made:
        yield made


def play(lane: Lane, clock: HandTime, seconds: int, count: Callable[[], int]) -> list[int]:
    """Let a lane work every five seconds; return when it sent something [s]."""
    sent = []
    for second in range(0, seconds, STEP):
        before = count()
        lane._keep()
        lane._deliver(last=False)
        sent += [second] * (count() - before)
        clock.now += STEP
    return sent


def lane_of(server: Server, folder: Path, per_hour: int = 100) -> Lane:
    sender = make_sender(NotifySettings(webhook=server.url))
    return Lane(sender, folder / "n.jsonl", Quota(per_hour), 5.0, lambda _: None)


def test_retry_interval_grows_during_an_outage_and_resets_on_recovery(
    server: Server, tmp_path: Path, clock: HandTime
) -> None:
    """After 5 s, doubled each time, up to ten minutes: twelve requests in the first hour, six in each later one."""
    server.answer = 503
    lane = lane_of(server, tmp_path)
    lane.put(TROUBLE)
    first = [0, 5, 15, 35, 75, 155, 315, 635, 1235, 1835, 2435, 3035]
    assert play(lane, clock, 3600, lambda: server.refused) == first
    assert play(lane, clock, 3600, lambda: server.refused) == [35, 635, 1235, 1835, 2435, 3035]
    assert (lane.problem, lane.idle) == ("webhook: 503 Service Unavailable", False)
    server.answer = 200
    assert play(lane, clock, 600, lambda: len(server.got)) == [35]
    assert (lane.problem, lane.idle, lane.due) == (None, True, 0.0)
    server.answer = 503
    lane.put(TROUBLE)
    assert play(lane, clock, 40, lambda: server.refused) == [0, 5, 15, 35]


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        ("120", [0, 120, 240, 360, 480, 600, 760, 1080, 1680, 2280, 2880, 3480]),  # until the back-off is longer
        ("3000", [0, 3000]),
        ("999999999", [0, 3600]),  # an hour at most
        ("2", [0, 5, 15, 35, 75, 155, 315, 635, 1235, 1835, 2435, 3035, 3635]),
    ],
)
def test_retry_after_header_delays_the_next_request(
    server: Server, tmp_path: Path, clock: HandTime, asked: str, sent: list[int]
) -> None:
    server.answer, server.retry_after = 429, asked
    lane = lane_of(server, tmp_path)
    lane.put(TROUBLE)
    assert play(lane, clock, 3640, lambda: server.refused) == sent


def test_alarm_is_sent_at_once_despite_retry_after(server: Server, tmp_path: Path, clock: HandTime) -> None:
    server.answer, server.retry_after = 429, "3000"
    lane = lane_of(server, tmp_path)
    lane.put(TROUBLE)
    play(lane, clock, 100, lambda: server.refused)
    lane.put(NOTICE)
    assert play(lane, clock, 10, lambda: server.refused) == [0]
    server.answer = 200
    assert play(lane, clock, 10, lambda: len(server.got)) == []
    assert lane.due == 1000.0 + 100 + 3000


def test_hourly_limit_does_not_apply_to_alarms(server: Server, tmp_path: Path, clock: HandTime) -> None:
    """Two per hour: those of the last hour count, to the second; an alarm takes all that waits with it."""
    lane, got = lane_of(server, tmp_path, per_hour=2), (lambda: len(server.got))
    assert play_with(lane, clock, [TROUBLE], got) == [0]
    assert play_with(lane, clock, [TROUBLE], got) == [0]
    assert play_with(lane, clock, [TROUBLE], got) == []
    assert play(lane, clock, 3560, got) == []  # until an hour after the first
    assert play(lane, clock, 60, got) == [10]
    assert play_with(lane, clock, [TROUBLE], got) == [0]
    assert play_with(lane, clock, [TROUBLE], got) == []
    assert play_with(lane, clock, [NOTICE], got) == [0]
    assert [notice["kind"] for notice in server.got[-1]["notices"]] == ["trouble", "alarm"]
    assert lane.idle


def play_with(lane: Lane, clock: HandTime, notices: list[Notice], count: Callable[[], int]) -> list[int]:
    for notice in notices:
        lane.put(notice)
    return play(lane, clock, 10, count)


def test_failed_heartbeat_is_not_retried_and_delays_no_notice(tmp_path: Path, clock: HandTime) -> None:
    sent: list[str] = []

    def send(notices: list[Notice], _: int) -> None:
        sent.append(notices[0].kind)
        raise NoticeError("refused", wait=500.0)

    beats = [replace(NOTICE, kind="heartbeat")]
    lane = Lane(send, tmp_path / "n.jsonl", Quota(9), 5.0, lambda _: None, lambda: beats.pop() if beats else None)
    lane._beat()
    lane._beat()
    assert (sent, lane.due, lane.problem) == (["heartbeat"], 0.0, "refused")


def test_trouble_notices_are_only_counted_when_the_spool_is_full(
    tmp_path: Path, clock: HandTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("monitor.outputs.notices.lane._MUCH", 400)
    others: list[int] = []
    lane = Lane(lambda _, n: others.append(n), tmp_path / "n.jsonl", Quota(9), 5.0, lambda _: None)
    for _ in range(6):
        lane.put(TROUBLE)
    lane.put(NOTICE)
    lane._keep()
    kept = len((tmp_path / "n.jsonl").read_text().splitlines())
    assert lane.dropped == 7 - kept > 0
    assert '"alarm"' in (tmp_path / "n.jsonl").read_text().splitlines()[-1]
    lane._deliver(last=False)
    assert (others, lane.dropped) == ([7 - kept], 0)


def test_notices_without_a_writable_spool_are_kept_in_limited_memory(
    tmp_path: Path, clock: HandTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("monitor.outputs.notices.lane._MAX_IN_MEMORY", 2)
    (tmp_path / "state").write_text("")
    got: list[tuple[int, int]] = []
    lane = Lane(
        lambda notices, n: got.append((len(notices), n)), tmp_path / "state" / "n", Quota(9), 5.0, lambda _: None
    )
    for _ in range(5):
        lane.put(TROUBLE)
    lane._keep()
    assert not lane.idle
    lane._deliver(last=False)
    assert got == [(2, 3)]
    assert lane.idle


def test_lane_waits_for_the_previous_lane_of_the_same_file(server: Server, tmp_path: Path, clock: HandTime) -> None:
    before, after = lane_of(server, tmp_path), lane_of(server, tmp_path)
    after.put(TROUBLE)
    after.wait_for(before)
    before.thread.start()
    assert play(after, clock, 3, lambda: len(server.got)) == []
    before.thread.ending.set()
    before.thread.join(5.0)
    after._deliver(last=True)
    assert len(server.got) <= 1
    assert after.idle


def test_notices_of_an_earlier_run_are_pending_until_delivered(server: Server, tmp_path: Path, clock: HandTime) -> None:
    before = lane_of(server, tmp_path)
    before.put(TROUBLE)
    before._keep()
    lane = lane_of(server, tmp_path)
    assert lane.left
    server.answer = 503
    play(lane, clock, STEP, lambda: server.refused)
    assert lane.left
    server.answer = 200
    play(lane, clock, 20, lambda: len(server.got))
    assert not lane.left
    assert not lane_of(server, tmp_path).left

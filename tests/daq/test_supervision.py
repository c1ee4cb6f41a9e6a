"""Background threads after unforeseen exceptions: restarted, counted, reported; nothing else is lost by them."""

import re
import time
from pathlib import Path
from typing import Any

import pytest

from daq import Event, Item, read_log
from daq.events import ThreadFailed, ThreadRecovered
from daq.log import DiskGuard, ResilientWriter, Retention, RotatingWriter, WriterThread
from daq.supervision import FAILURES, Failures, SupervisedThread, error_text
from tests.support.daq.blocks import make_block
from tests.support.monitor.notices import until

#: threads that end with what they wait for, and run nothing that could fail
PLAIN = {
    "daq/signals.py",
    "daq/supervision.py",
    "daq/emulator/can/slcan.py",
    "monitor/service/servers/web/process.py",
    "monitor/cli/demo/demonstration.py",
    "monitor/outputs/notices/deadline.py",
}


def test_failing_thread_is_restarted_counted_and_reported_once() -> None:
    failures, runs = Failures(calm_seconds=0.3), []

    def work() -> None:
        runs.append(time.monotonic())
        if len(runs) < 3:
            raise OverflowError("year 99999999999 is out of range")
        thread.ending.wait()

    thread = SupervisedThread("sender", work, longest_pause=0.05, failures=failures)
    thread.start()
    until(lambda: len(runs) == 3)
    assert failures.counts == {"sender": 2}
    assert (failures.problem or "").startswith("sender: OverflowError (test_super")
    [reported] = failures.events()
    assert isinstance(reported, ThreadFailed)
    assert reported.thread == "sender"
    until(lambda: failures.problem is None)
    assert list(failures.events()) == [ThreadRecovered(thread="sender", failures=2)]
    thread.ending.set()
    thread.join(2.0)
    assert not thread.is_alive()


@pytest.mark.parametrize("error", [MemoryError(), RecursionError("deep"), SystemExit(3), KeyError("x")])
def test_permanently_failing_thread_ends_on_request(error: BaseException) -> None:
    def work() -> None:
        raise error

    failures = Failures()
    thread = SupervisedThread("bad", work, failures=failures)
    thread.start()
    until(lambda: failures.counts)
    thread.ending.set()
    thread.join(2.0)
    assert not thread.is_alive()
    assert failures.counts["bad"] == 2
    assert error_text(error).startswith(type(error).__name__)


def test_exception_in_log_reader_affects_only_one_item(tmp_path: Path) -> None:
    stated: list[Item] = []

    def take(item: Item) -> None:
        if isinstance(item, Event) and item.payload == {"n": 1}:
            raise ZeroDivisionError
        stated.append(item)

    before = FAILURES.counts.get("log readers", 0)
    events = [Event(topic="/event/x", time=n, payload={"n": n}) for n in range(3)]
    recorder = RotatingWriter(tmp_path, {}, 10**18)
    with WriterThread(ResilientWriter(recorder, DiskGuard(tmp_path, Retention()), stated.append), take) as log:
        for event in events:
            log.put(event)
    assert [item.payload["n"] for item in stated if isinstance(item, Event)] == [0, 2]
    assert len(list(read_log(recorder.paths[0]))) == 3
    assert FAILURES.counts["log readers"] == before + 1


@pytest.mark.parametrize("payload", [{"why": {1, 2}}, {"why": 1.0, (1, 2): "x"}])
def test_unserializable_event_is_dropped_and_other_items_are_written(tmp_path: Path, payload: dict[Any, Any]) -> None:
    recorder = RotatingWriter(tmp_path, {}, 10**18)
    keeper = ResilientWriter(recorder, DiskGuard(tmp_path, Retention()), lambda event: None)
    written = Event(topic="/event/y", time=1, payload={})
    with WriterThread(keeper, lambda item: None) as log:
        log.put(Event(topic="/event/x", time=1, payload=payload))
        log.put(make_block("left", 0))
        log.put(written)
    kept = list(read_log(recorder.paths[0]))
    assert [item.topic if isinstance(item, Event) else item.device for item in kept] == ["left", "/event/y"]
    assert keeper.problem == "lost: 1 of events"


def test_every_thread_of_the_monitor_is_supervised() -> None:
    root = Path(__file__).parents[2]
    plain = re.compile(r"\b(threading\.Thread|threading\.Timer|QueueListener)\b")
    paths = [path for package in ("daq", "oma", "updater", "monitor") for path in (root / package).rglob("*.py")]
    found = {path.relative_to(root).as_posix() for path in paths if plain.search(path.read_text(encoding="utf-8"))}
    assert found == PLAIN

"""Events at a site that is unattended for years: power cuts, changes of clocks, an analysis that hangs."""

import gc
import json
import os
import time
import weakref
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from daq import SystemClock
from monitor.errors import StartError
from monitor.service.startup.instance_lock import only_one
from monitor.watch.memory import LoadedState
from tests.support.monitor.runs import LawState, QuietWorker, blocks, watched_site
from tests.support.processes import script_process

PORTS = Path(__file__).parents[2] / "support" / "daq" / "emulated_ports.py"
HOUR = 3600 * 10**9  # ns


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LawState:
    return watched_site(tmp_path, monkeypatch)


@pytest.fixture
def ports() -> Iterator[list[str]]:
    """Return where two devices stream."""
    now = time.time_ns()
    with script_process(PORTS, 2, 1, now, now) as (_, reported):
        yield json.loads(reported)


@pytest.mark.live
def test_restart_continues_without_a_missing_device(watched: LawState, ports: list[str]) -> None:
    """After a power cut one of two is dead: the other one is monitored, and the loss is reported."""
    watched.write({"beam_left": ("/dev/nowhere", 500.0), "beam_right": (ports[1], 500.0)})
    watched.recalled = LoadedState(text="of a run before")
    with watched.running() as ended:
        watched.until_told("device_failed", 1)
        watched.flows("beam_right")
        watched.stop()
        ended.result()
    assert watched.events("device_failed")[0].payload["device"] == "beam_left"


@pytest.mark.live
@pytest.mark.parametrize("text", [None, "of a run before"])
def test_start_without_any_device_is_refused(watched: LawState, text: str | None) -> None:
    watched.write({"beam_left": ("/dev/nowhere", 500.0), "beam_right": ("/dev/nothing", 500.0)})
    watched.recalled = LoadedState(text=text)
    with watched.running() as ended, pytest.raises(StartError, match=r"device beam_left: .*nowhere"):
        ended.result()


@pytest.mark.live
def test_first_start_requires_every_device(watched: LawState, ports: list[str]) -> None:
    watched.write({"beam_left": (ports[0], 500.0), "beam_right": ("/dev/nowhere", 500.0)})
    with watched.running() as ended, pytest.raises(StartError, match=r"device beam_right: .*nowhere"):
        ended.result()


def test_second_monitor_of_a_site_is_refused(tmp_path: Path) -> None:
    """A second one is refused with the first one's process, for as long as that lives."""
    state = tmp_path / "state"
    with only_one(state), pytest.raises(StartError, match=f"runs already, process {os.getpid()}$"), only_one(state):
        pass
    with only_one(state):
        (state / "running").unlink()
        with pytest.raises(StartError, match=r"runs already$"), only_one(state):
            pass
    with only_one(state):
        pass
    (tmp_path / "file").write_text("")
    with only_one(tmp_path / "file"):
        pass  # a state folder that cannot be is reported elsewhere


class SetClock:
    """The host's clocks, of which the wall clock can be set."""

    def __init__(self) -> None:
        self.ahead = 0  #: [ns]

    def time_ns(self) -> int:
        return time.time_ns() + self.ahead

    @staticmethod
    def monotonic_ns() -> int:
        return time.monotonic_ns()


def test_clock_ignores_host_clock_changes_until_follow_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    host = SetClock()
    monkeypatch.setattr("daq.timing.host_clock.time", host)
    clock = SystemClock()
    before = clock.now()
    host.ahead = -3 * HOUR
    assert 0 <= clock.now() - before < HOUR
    assert clock.off == pytest.approx(-3 * HOUR, abs=0.1 * HOUR)
    clock.follow()
    assert before - clock.now() > 2 * HOUR
    assert abs(clock.off) < 10**9


@pytest.mark.live
@pytest.mark.parametrize("hours", [-3, 5])
def test_host_clock_change_starts_a_new_log(
    watched: LawState, ports: list[str], monkeypatch: pytest.MonkeyPatch, hours: int
) -> None:
    """Within a log times are even; the devices are set up again, and the shift is reported once."""
    host, shown = SetClock(), list[object]()
    monkeypatch.setattr("daq.timing.host_clock.time", host)
    monkeypatch.setattr("monitor.service.site_run.Outputs.show_again", lambda outputs: shown.append(outputs))
    watched.write({"beam_left": (ports[0], 500.0), "beam_right": (ports[1], 500.0)})
    with watched.running() as ended:
        watched.flows("beam_left")
        host.ahead = hours * HOUR
        watched.until(lambda: len(QuietWorker.made) == 2)
        watched.flows("beam_left")
        watched.flows("beam_right")
        watched.stop()
        report = ended.result()
    [stated] = watched.events("clock_changed")
    assert len(shown) == 1  # a live view goes on with the new log: it ended over scans that are counted anew
    assert stated.payload["by_s"] == pytest.approx(3600 * hours, abs=1.0)
    before, after = ([b.arrival_time for b in blocks((log,), "beam_left")] for log in report.logs)
    assert after[0] - before[-1] == pytest.approx(hours * HOUR, abs=10 * 10**9)
    for times in (before, after):
        # a busy host may read late by seconds; the clock was set by hours
        assert all(0 < later - earlier < HOUR // 100 for earlier, later in pairwise(times))


@pytest.mark.live
def test_missing_last_results_do_not_delay_a_reload(
    watched: LawState, ports: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be amid a diagnosis: the watchdog is not to be left without food for as long."""
    monkeypatch.setattr("monitor.service.log_and_analysis._LAST_RESULTS_SECONDS", 0.3)
    devices = {"beam_left": (ports[0], 500.0), "beam_right": (ports[1], 500.0)}
    watched.write(devices)
    with watched.running() as ended:
        watched.flows("beam_left")
        QuietWorker.made[0].hangs = True
        watched.write(devices, "[analysis]\nwindow_seconds = 30\n")
        watched.reload()
        watched.until_told("reloaded", 1)
        watched.flows("beam_left")
        watched.stop()
        ended.result()
    assert len(watched.events("analysis_lagging")) == 1
    assert watched.events("gap") == []


@pytest.mark.live
def test_permanent_log_failure_is_reported(
    watched: LawState, ports: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure without a known cause: data continue to arrive, and nothing is written. The watchdog ends it after a
    while.
    """
    watched.write({"beam_left": (ports[0], 500.0), "beam_right": (ports[1], 500.0)})
    with watched.running() as ended:
        watched.flows("beam_left")

        def fail(_: object) -> None:
            raise OSError(5, "Input/output error")

        monkeypatch.setattr("daq.log.ResilientWriter.flush", fail)
        watched.flows("beam_left")
        watched.flows("beam_left")
        watched.stop()
        report = ended.result()
    assert report.disk_failure == "nothing more is written: [Errno 5] Input/output error"
    assert sum(len(block.counts) for block in blocks(report.logs, "beam_left")) < watched.scans("beam_left")


class Circle:
    """An object with a reference to itself."""

    def __init__(self) -> None:
        self.own = self


@pytest.mark.live
def test_reference_cycles_are_freed_periodically(
    watched: LawState, ports: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("monitor.service.site_run._SWEEP", 0.1)
    watched.write({"beam_left": (ports[0], 500.0), "beam_right": (ports[1], 500.0)})
    gc.disable()
    try:
        with watched.running() as ended:
            watched.flows("beam_left")
            lost = weakref.ref(Circle())
            watched.until(lambda: lost() is None)
            watched.stop()
            ended.result()
    finally:
        gc.enable()

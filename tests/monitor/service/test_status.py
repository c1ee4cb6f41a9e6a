"""Status of a running monitor: devices, rates, ages and latency, by clocks that nobody sets."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from daq import Event, SystemClock
from monitor.analysis.temperature import reading
from monitor.results.residuals import ChannelResiduals
from monitor.results.service_events import AnalysisCaughtUp, DeviceReplaced, WindowsLeftOut
from monitor.results.site_status import FILE_NAME
from monitor.results.windows import WindowResult, event_result, result_event
from monitor.service.status import MonitorStatus, Pace
from tests.support.daq.blocks import make_block
from tests.support.monitor.history import run_events
from tests.support.monitor.service.status import PACE, WELL

EVENTS = run_events()


def test_status_counts_gaps_losses_and_scans_per_device(tmp_path: Path) -> None:
    status = MonitorStatus(tmp_path / FILE_NAME, ("left",), PACE, SystemClock())
    status.take(make_block("left", 0))
    status.take(Event(topic="/event/gap", time=1, payload={"device": "left"}))
    status.take(Event(topic="/event/device_failed", time=1, payload={"device": "left"}))
    status.write(*WELL)
    device = json.loads((tmp_path / FILE_NAME).read_text())["devices"]["left"]
    assert (device["gaps"], device["lost"], device["scans"]) == (1, True, len(make_block("left", 0).counts))


def test_status_has_the_last_temperature_of_devices_and_site(tmp_path: Path) -> None:
    status = MonitorStatus(tmp_path / FILE_NAME, ("left", "right"), PACE, SystemClock())
    status.take(make_block("left", 0))
    status.take(replace(make_block("right", 0), temperature=math.nan))
    for celsius in (4.0, -3.5):
        status.take(reading(1, celsius, "weather.csv"))
    status.write(*WELL)
    found = json.loads((tmp_path / FILE_NAME).read_text())
    assert {name: device["temperature"] for name, device in found["devices"].items()} == {"left": 21.5, "right": None}
    assert found["temperature"] == -3.5


def test_residuals_are_in_the_status_until_they_are_outdated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a window after the last block, they are no present state."""
    wall, ages = [1e9], [0.0]
    monkeypatch.setattr("monitor.service.status.time", FakeTime(wall, ages))
    status = MonitorStatus(tmp_path / FILE_NAME, ("left",), Pace(step=60.0, window=60.0), SystemClock())
    for time, deviations in ((1, {"a": 0.5, "b": 2.0}), (2, {"a": 7.0, "b": 1.0})):
        status.take_residuals(
            ChannelResiduals(time=time, seconds=3.0, ratio=dict.fromkeys("ab", 1.0), deviation=deviations, limit=6.0)
        )
    present = status.write(*WELL)
    assert present is not None
    assert present.residuals is not None
    assert (present.residuals.over, present.residual_course) == ({"a": 7.0}, [2.0, 7.0])
    ages[0] += 31.0
    later = status.write(*WELL)
    assert later is not None
    assert (later.residuals, later.residual_course) == (None, [])


def test_wall_clock_change_does_not_affect_ages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """NTP may set it by hours, back and forth: data continue to count as new, and a silent device is reported."""
    wall, ages = [1e9], [0.0]
    monkeypatch.setattr("monitor.service.status.time", FakeTime(wall, ages))
    status = MonitorStatus(tmp_path / FILE_NAME, ("left",), Pace(step=60.0, window=600.0), SystemClock())
    for step in (7200.0, -9000.0):
        status.take(make_block("left", 0))
        wall[0] += step
        assert status.silence == 0.0
        ages[0] += 30.0
        status.write(*WELL)
        reported = json.loads((tmp_path / FILE_NAME).read_text())
        assert reported["devices"]["left"]["silent"] == status.silence == 30.0
        assert not reported["window_overdue"]  # a first window may take its length and two steps
    ages[0] += 700.0
    status.write(*WELL)
    assert json.loads((tmp_path / FILE_NAME).read_text())["window_overdue"]


class FakeTime:
    """The two clocks that there are."""

    def __init__(self, wall: list[float], ages: list[float]) -> None:
        self._wall, self._ages = wall, ages

    def time(self) -> float:
        return self._wall[0]

    def monotonic(self) -> float:
        return self._ages[0]


def test_rate_is_averaged_over_several_seconds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks come in pieces: of each second alone it would be 750 one time and 1250 the next."""
    ages = [0.0]
    monkeypatch.setattr("monitor.service.status.time", FakeTime([1e9], ages))
    status, first = MonitorStatus(tmp_path / FILE_NAME, ("left",), PACE, SystemClock()), 0
    for second in range(60):
        for _ in range(3 if second % 2 else 5):
            status.take(make_block("left", first, n=250))
            first += 250
        ages[0] += 1.0
        status.write(*WELL)
        rate = json.loads((tmp_path / FILE_NAME).read_text())["devices"]["left"]["rate"]
        if second > 10:
            assert rate == pytest.approx(1000.0, abs=30.0)


def test_rate_is_computed_between_blocks_and_falls_without_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks of 0.7 s, looked at each second: over ten seconds of the clock they would be 9.8 or 10.5 s of scans."""
    ages, rates = [0.0], []
    monkeypatch.setattr("monitor.service.status.time", FakeTime([1e9], ages))
    status, first = MonitorStatus(tmp_path / FILE_NAME, ("left",), PACE, SystemClock()), 0
    for tick in range(1, 601):  # tenths of a second
        ages[0] = 0.1 * tick
        if tick % 7 == 0 and tick < 400:
            status.take(make_block("left", first, n=700))
            first += 700
        if tick % 10 == 0:
            status.write(*WELL)
            rates.append(json.loads((tmp_path / FILE_NAME).read_text())["devices"]["left"]["rate"])
    assert rates[15:39] == pytest.approx([1000.0] * 24, rel=1e-6)
    assert rates[45] < 700.0
    assert rates[-1] == 0.0


def test_device_replaced_during_a_restart_is_reported(tmp_path: Path) -> None:
    """Ports may have been reassigned: two exchanged sensors must be reported before the alarm."""
    stated = []
    for serial in ("S1", "S1", "S2", "S2"):
        status = MonitorStatus(tmp_path / FILE_NAME, ("left",), PACE, SystemClock())
        payload = {"device": "left", "serial": serial, "filter_delay": 0.1}
        status.take(Event(topic="/event/device_open", time=1, payload=payload))
        stated.append(list(status.events()))
        status.write(*WELL)
    replaced = DeviceReplaced(device="left", before={"serial": "S1"}, now={"serial": "S2"})
    assert stated == [[], [], [replaced], []]


def test_lasting_channel_failure_and_recovery_are_each_reported_once(tmp_path: Path) -> None:
    """One window may miss a channel for a gap; copies are reported together; a window without modes reports nothing."""
    dead, twice = {"a": "constant", "b": "constant"}, {"c": "the same as d", "d": "the same as c"}
    rows = [{"a": "constant"}, {}, dead, dead, None, dead | twice, dead | twice, twice, twice, {}]
    status, stated = MonitorStatus(tmp_path / FILE_NAME, (), PACE, SystemClock()), {}
    for index, row in enumerate(rows):
        heard = [channel for channel in "abcd" if channel not in (row or {})]
        window = {"index": index, "start": 0, "end": 1, "phase": "watching", "channels": heard, "modes": []}
        reported = {"problem": "no resonance stands out"} if row is None else {"faults": row}
        status.take(result_event(WindowResult.model_validate(window | reported)))
        if found := [(event.topic.removeprefix("/event/"), *event.payload().values()) for event in status.events()]:
            stated[index] = found
    copies = "contain identical samples (error of cabling or export?)"
    assert stated == {
        3: [("channel_failed", "a, b", "constant")],
        6: [("channel_failed", "c, d", copies)],
        7: [("channel_recovered", "a, b")],
        9: [("channel_recovered", "c, d")],
    }


def test_channels_of_a_lost_device_are_not_reported_individually(tmp_path: Path) -> None:
    """A dead channel of another device is reported; and so is one that is still missing when the device is back."""
    status = MonitorStatus(
        tmp_path / FILE_NAME, ("left", "right"), PACE, SystemClock(), {"a": "left", "b": "left", "c": "right"}
    )
    gone = dict.fromkeys("ab", "0% of the samples are there")
    rows = [gone | {"c": "constant"}] * 3 + ["device_recovered"] + [{"a": "constant", "c": "constant"}] * 2
    stated = []
    status.take(Event(topic="/event/device_failed", time=0, payload={"device": "left"}))
    for index, row in enumerate(rows):
        if isinstance(row, str):
            status.take(Event(topic=f"/event/{row}", time=0, payload={"device": "left"}))
            continue
        heard = [channel for channel in "abc" if channel not in row]
        window = {"index": index, "start": 0, "end": 1, "phase": "watching", "channels": heard, "modes": []}
        status.take(result_event(WindowResult.model_validate(window | {"faults": row})))
        stated += [(index, e.topic.removeprefix("/event/"), e.payload()["channels"]) for e in status.events()]
    assert stated == [(1, "channel_failed", "c"), (5, "channel_failed", "a")]


class FastClock:
    """Ten seconds of data per second; does not move."""

    speed = 10.0

    def __init__(self, now: int) -> None:
        self._now = now

    def now(self, _: int = 0) -> int:
        return self._now


def test_latency_is_wall_time_since_the_last_sample(tmp_path: Path) -> None:
    """A result 5 s of data after the end of its window came 0.5 s of wall time after it."""
    raised = next(e for e in EVENTS if e.topic == "/result/alarm" and e.payload["state"] == "alarm")
    status = MonitorStatus(tmp_path / FILE_NAME, ("left",), PACE, FastClock(raised.time + 5_000_000_000))
    status.take(raised)
    status.take(next(e for e in EVENTS if e.topic == "/result/window" and e.time == raised.time))
    status.write(*WELL)
    assert json.loads((tmp_path / FILE_NAME).read_text())["latency"] == {"alarm": 0.5, "window": 0.5}


def test_skipped_windows_are_an_event_and_an_overload_problem(tmp_path: Path) -> None:
    """An overloaded machine analyses a window now and then: that does not make it well. Ten in a row do."""
    status = MonitorStatus(tmp_path / FILE_NAME, ("left",), Pace(step=600.0, window=600.0), SystemClock())
    window = next(result for event in EVENTS if isinstance(result := event_result(event), WindowResult))
    skipped = window.model_copy(update={"skipped": True, "problem": "left out"})

    def take(*results: WindowResult) -> tuple[list[Any], str | None]:
        for result in results:
            status.take(result_event(result))
        status.write(*WELL)
        status._due = 0.0
        return list(status.events()), json.loads((tmp_path / FILE_NAME).read_text())["overload"]

    assert take(window) == ([], None)
    assert take(skipped, skipped, window, skipped) == (
        [WindowsLeftOut(why="the analysis has fallen behind")],
        "3 of the last 5 windows left out: the analysis has fallen behind",
    )
    assert take(*[window] * 9)[1] == "1 of the last 10 windows left out: the analysis has fallen behind"
    assert take(window) == ([AnalysisCaughtUp(left_out=3)], None)
    status.take(Event(topic="/event/analysis_lagging", time=1, payload={"left_out_s": 6000.0}))
    assert [type(event) for event in status.events()] == [WindowsLeftOut]

import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import Block, CanAddress, DeviceReader, Driver, Event, HostClock, Item, ScaledClock, SystemClock, make_driver
from daq.drivers import EPSON_SCALE
from daq.timing import SharedTime
from monitor.errors import SettingsError, StartError
from monitor.rig import Place, PlayReport, RigEvent, Scenario, World, draw_t_frame, dump_scenario, play, run_rig
from tests.support.monitor.rig import ORIGIN, nominal, t_frame
from tests.support.thorough import few_of
from updater import Body

pytestmark = [pytest.mark.live, pytest.mark.xdist_group("busy")]  # one after the other: they keep a processor busy

SPEED = 10.0
RUN = "import sys; from pathlib import Path; from monitor.rig import run_rig; a = sys.argv; "
RUN += "run_rig(Path(a[1]), speed=float(a[2]), ports=Path(a[3]), report=Path(a[4]))"
_READY_SECONDS = 30.0


class RigProcess:
    """A rig in a process of its own."""

    def __init__(self, folder: Path, scenario: Scenario) -> None:
        self._ports, self._report = folder / "ports.json", folder / "rig.json"
        (folder / "scenario.toml").write_text(dump_scenario(scenario), encoding="utf-8")
        self._ports.write_text("a stale file of an earlier rig", encoding="utf-8")
        command = [sys.executable, "-c", RUN, str(folder / "scenario.toml"), str(SPEED), str(self._ports)]
        quiet = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen([*command, str(self._report)], env=quiet, stderr=subprocess.PIPE, text=True)

    def ready(self) -> dict[str, Any]:
        end, text = time.monotonic() + _READY_SECONDS, ""
        while time.monotonic() < end and self.process.poll() is None:
            with suppress(FileNotFoundError):  # not there yet, or the stale one has just been removed
                text = self._ports.read_text(encoding="utf-8")
            if text.startswith("{"):
                found: dict[str, Any] = json.loads(text)
                return found
            time.sleep(0.02)
        self.process.kill()
        raise AssertionError(f"the rig did not get ready: {self.process.communicate()[1]}")

    def report(self) -> dict[str, Any]:
        _, reported = self.process.communicate(timeout=20)
        assert (self.process.returncode, reported) == (0, "")
        found: dict[str, Any] = json.loads(self._report.read_text(encoding="utf-8"))
        return found


@contextmanager
def rig(folder: Path, scenario: Scenario) -> Iterator[RigProcess]:
    started = RigProcess(folder, scenario)
    try:
        yield started
    finally:
        started.process.kill()
        started.process.communicate()


def driver_of(place: Place | dict[str, Any]) -> Driver:
    """Return the driver of a device, at the address given by the rig or its file."""
    if isinstance(place, dict):
        place = CanAddress(**place)
    return make_driver("epson-can" if isinstance(place, CanAddress) else "epson-uart", place, 1000.0)


@contextmanager
def reading(ports: Mapping[str, Place | dict[str, Any]], clock: HostClock) -> Iterator[list[Item]]:
    """Read all ports with the driver until the end of the block."""
    items: list[Item] = []
    readers = [DeviceReader(name, driver_of(place), 1000.0, clock, items.append) for name, place in ports.items()]
    for reader in readers:
        reader.connect()
        reader.start()
    try:
        yield items
    finally:
        for reader in readers:
            reader.stop()
        for reader in readers:
            reader.join()


def scans(items: list[Item], device: str) -> list[Block]:
    return [item for item in items if isinstance(item, Block) and item.device == device]


def n_missing(blocks: list[Block]) -> int:
    """Count the scans that blocks skip."""
    ends = [block.first_index + len(block.counts) for block in blocks]
    return sum(block.first_index - end for block, end in zip(blocks[1:], ends[:-1], strict=True))


def _reached(items: list[Item], device: str, n_scans: int) -> bool:
    blocks = scans(items, device)
    return bool(blocks) and blocks[-1].end_index >= n_scans


def played(folder: Path, scenario: Scenario, n_scans: int) -> tuple[dict[str, Any], list[Item], ScaledClock]:
    """Play a scenario until each device has been read n_scans times, then end it by a signal."""
    with rig(folder, scenario) as process:
        found = process.ready()
        clock = ScaledClock(**found["clock"])
        with reading(found["ports"], clock) as items:
            end = time.monotonic() + _READY_SECONDS
            while time.monotonic() < end and not all(_reached(items, name, n_scans) for name in found["ports"]):
                time.sleep(0.1)
        process.process.send_signal(signal.SIGTERM)
        return process.report(), items, clock


def test_devices_stream_at_tenfold_speed_without_dropped_scans(
    tmp_path: Path,
) -> None:
    scenario = draw_t_frame("t_structure", 31, duration=0, between=(6.0, 7.0))
    report, items, _ = played(tmp_path, scenario, 15_000)
    received = sum(len(block.counts) for device in scenario.device for block in scans(items, device.name))
    assert report["dropped"] == 0
    assert report["dropped_by_device"] == {device.name: 0 for device in scenario.device}
    for device in scenario.device:
        blocks = scans(items, device.name)
        assert n_missing(blocks) == 0
        data = np.concatenate([block.counts for block in blocks]) * EPSON_SCALE
        assert len(data) >= 15_000
        assert 0.002 < data.std(0).max() < 0.1
    # what was under way when the readers stopped: in ports, in devices, in a block not full; 0.5 s of wall time or less
    assert 0 <= report["sent"] - received < 6 * 5000
    opened = [item.time for item in items if isinstance(item, Event) and item.topic == "/event/device_open"]
    assert len(report["events"]) == 1
    late = (report["events"][0] - max(opened)) * 1e-9 - scenario.event[0].at
    assert abs(late) < 5.0  # 0.5 s of wall time, if others have the machine, from driver to rig or back


def test_accelerated_rig_waits_for_readers_that_are_held_up(tmp_path: Path) -> None:
    """A port holds 170 ms at tenfold speed; a real one at real time holds ten times as long."""
    hold_the_interpreter = ctypes.PyDLL(None).usleep  # a call by PyDLL keeps all other threads of this process waiting
    with rig(tmp_path, nominal(32)) as process:
        found = process.ready()
        with reading(found["ports"], ScaledClock(**found["clock"])) as items:
            for n_scans in (3000, 11_000):
                end = time.monotonic() + _READY_SECONDS
                while time.monotonic() < end and not all(_reached(items, name, n_scans) for name in found["ports"]):
                    time.sleep(0.1)
                hold_the_interpreter(600_000)
            process.process.send_signal(signal.SIGTERM)
            report = process.report()
    assert report["dropped"] == 0
    assert report["sent"] > 6 * 11_000
    assert all(n_missing(scans(items, name)) == 0 for name in found["ports"])


def test_no_device_is_lost_while_the_world_is_held(tmp_path: Path) -> None:
    """A demonstration holds its world while the analysis is behind; nodes of a bus count as lost after 1 s."""
    scenario = draw_t_frame("t_structure", 33, duration=0, between=None)
    assert any(device.node is not None for device in scenario.device)
    with rig(tmp_path, scenario) as process:
        found = process.ready()
        world = SharedTime(Path(found["clock"]["shared"]))
        with reading(found["ports"], ScaledClock(**found["clock"])) as items:
            for n_scans, seconds in ((3000, 2.5), (6000, 0.0)):
                end = time.monotonic() + _READY_SECONDS
                while time.monotonic() < end and not all(_reached(items, name, n_scans) for name in found["ports"]):
                    time.sleep(0.1)
                world.hold(seconds)
                time.sleep(seconds)
            lost = [item for item in items if isinstance(item, Event) and item.topic == "/event/device_failed"]
            process.process.send_signal(signal.SIGTERM)
            report = process.report()
    assert report["dropped"] == 0
    assert not lost
    assert all(_reached(items, name, 6000) for name in found["ports"])


def test_rig_and_reader_share_one_time_scale(tmp_path: Path) -> None:
    scenario = nominal(5)
    report, items, clock = played(tmp_path, scenario, 12_000)
    assert clock.speed == SPEED
    assert report["events"] == []
    for device in scenario.device:
        blocks = scans(items, device.name)
        index, arrival = np.array([(b.arrival_index, b.arrival_time) for b in blocks]).T
        late = arrival - ORIGIN - index / 1000 * 1e9 / (1 + device.clock_error)
        # each few seconds a scan is read at once, however busy the machine: within a period of its sampling, 1 ms
        earliest = [part.min() for part in np.array_split(late, 4)]
        assert np.ptp(earliest) < 1e6


@pytest.mark.thorough  # a rig in a thread does so by default: test_stalled_rig_loses_no_scans
def test_rig_stops_at_the_end_of_its_duration(tmp_path: Path) -> None:
    scenario = nominal(6).model_copy(update={"duration": 5.0})
    with rig(tmp_path, scenario) as process:
        found = process.ready()
        with reading(found["ports"], ScaledClock(**found["clock"])):
            report = process.report()
    assert report["sent"] + report["dropped"] >= 6 * 5000


@pytest.mark.parametrize("number", few_of([signal.SIGTERM, signal.SIGINT]))
def test_rig_without_readers_stops_on_a_signal(tmp_path: Path, number: signal.Signals) -> None:
    with rig(tmp_path, nominal(7)) as process:
        process.ready()
        process.process.send_signal(number)
        assert process.report()["sent"] == 0


class HandClock:
    """A clock that is set by hand."""

    def __init__(self, speed: float) -> None:
        self.speed, self.time = speed, ORIGIN

    def now(self, _: int = 0) -> int:
        return self.time


@dataclass
class Playing:
    """A rig in a thread of this process, its time set by hand."""

    clock: HandClock
    ports: dict[str, Place]
    stop: threading.Event
    done: list[PlayReport]
    happened: list[tuple[RigEvent, int]]
    thread: threading.Thread
    sampling: threading.Event  #: set once all devices sample

    def jump(self, seconds: float) -> None:
        """Set the time, once all devices sample: commands may take long to reach them on a busy machine."""
        assert self.sampling.wait(_READY_SECONDS)
        self.clock.time += round(seconds * 1e9)

    def report(self) -> PlayReport:
        """Wait until the scenario's duration is over."""
        self.thread.join(_READY_SECONDS)
        assert len(self.done) == 1
        return self.done[0]


@contextmanager
def playing(scenario: Scenario, speed: float = 1.0) -> Iterator[Playing]:
    clock, stop, asked, sampling = HandClock(speed), threading.Event(), threading.Event(), threading.Event()
    ports, done, happened = dict[str, Place](), list[PlayReport](), list[tuple[RigEvent, int]]()

    def ready(found: dict[str, Place]) -> None:
        ports.update(found)
        asked.set()

    def begin(world: World, moment: int) -> tuple[int, ...]:
        sampling.set()
        return begin_of_world(world, moment)

    def run() -> None:
        with tempfile.NamedTemporaryFile() as file, pytest.MonkeyPatch.context() as patch:
            patch.setattr(World, "begin", begin)
            shared = SharedTime(Path(file.name), ORIGIN)
            done.append(play(t_frame(), scenario, clock, shared, ready, stop, lambda *event: happened.append(event)))

    begin_of_world = World.begin
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert asked.wait(_READY_SECONDS)
    try:
        yield Playing(clock, ports, stop, done, happened, thread, sampling)
    finally:
        stop.set()
        thread.join()


def test_stalled_rig_loses_no_scans() -> None:
    scenario = nominal(8, bodies=((3.0, Body(at=(0.1, 0, 1.48), mass=0.2)),)).model_copy(update={"duration": 3.9})
    # the host did not sleep, only the rig: 4 s are made up for, 250 servings of 384 bytes a device
    with playing(scenario) as rig, reading(rig.ports, SystemClock()) as items:
        rig.jump(4.0)
        report = rig.report()
    assert report.dropped == 0
    assert report.events == (ORIGIN + 3_000_000_000,)
    assert rig.happened == [(scenario.event[0], ORIGIN + 3_000_000_000)]
    assert 6 * (3900 - 64) <= report.sent <= 6 * 4001  # the filters still hold the last 64 ms
    assert all(n_missing(scans(items, name)) == 0 for name in rig.ports)


def test_unread_scans_are_dropped_and_counted() -> None:
    scenario = nominal(9).model_copy(update={"duration": 59.5})
    with playing(scenario, speed=20.0) as rig:
        drivers = [driver_of(place) for place in rig.ports.values()]
        for driver in drivers:
            driver.open()
        rig.jump(60.0)
        report = rig.report()
    held = 6 * (20 * 4096 + 640 * 1024) // 24  # frames in the devices' buffers, and in ports of kernels that hold most
    assert 0 < report.sent <= held
    assert 6 * (59_500 - 64) <= report.sent + report.dropped <= 6 * 60_001
    assert sum(report.dropped_by_device.values()) == report.dropped
    assert min(report.dropped_by_device.values()) > 0


def test_a_bad_speed_or_scenario_is_refused_before_anything_starts(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    ports, report = tmp_path / "ports.json", tmp_path / "rig.json"
    path.write_text(dump_scenario(nominal()), encoding="utf-8")
    with pytest.raises(ValueError, match="speed: expected a positive number, found 0"):
        run_rig(path, speed=0.0, ports=ports, report=report)
    path.write_text("seed = 'one'", encoding="utf-8")
    with pytest.raises(SettingsError, match="structure: Field required"):
        run_rig(path, speed=1.0, ports=ports, report=report)
    assert not ports.exists()


def test_missing_output_folder_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(dump_scenario(nominal()), encoding="utf-8")
    missing = tmp_path / "none" / "ports.json"
    with pytest.raises(StartError, match=r"ports\.json: cannot be written: No such file"):
        run_rig(path, speed=1.0, ports=missing, report=tmp_path / "rig.json")

"""The rig of a demo waits for the analysis of its monitor."""

import time
from dataclasses import asdict
from pathlib import Path

import pytest

from daq import ScaledClock
from daq.timing import SharedTime
from monitor.cli.demo.demonstration import Pace
from monitor.results.windows import WindowResult
from monitor.rig.player import _LeashedClock

ORIGIN, WINDOW = 10**18, 20 * 10**9  # ns


def result(end: int) -> WindowResult:
    return WindowResult(
        index=0, start=end - WINDOW, end=end, phase="learning", channels=[], modes=[], rms={}, problem=None
    )


@pytest.mark.parametrize(("windows", "held"), [(1, False), (3, True)])
def test_world_is_held_while_the_analysis_is_behind(tmp_path: Path, windows: int, held: bool) -> None:
    world = SharedTime(tmp_path / "time", ORIGIN)
    begun = time.time_ns() - 3600 * 10**9
    clock = ScaledClock(speed=20.0, origin_wall=begun, origin=ORIGIN, shared=str(tmp_path / "time"))
    pace = Pace(asdict(clock), window=WINDOW * 1e-9)
    world.step(ORIGIN + 10 * WINDOW)
    pace.keep(result(ORIGIN + (10 - windows) * WINDOW))
    assert world.held is held
    pace.keep(result(ORIGIN + 9 * WINDOW))
    assert not world.held
    world.step(ORIGIN + 11 * WINDOW)  # before the next result
    assert world.held


def test_real_time_waits_for_nobody() -> None:
    clock = ScaledClock(speed=1.0, origin_wall=time.time_ns(), origin=ORIGIN)
    Pace(asdict(clock), window=WINDOW * 1e-9).keep(result(ORIGIN - 10 * WINDOW))


def test_a_hold_ends_by_itself(tmp_path: Path) -> None:
    """A reader that was killed does not hold the world for ever."""
    world = SharedTime(tmp_path / "time", ORIGIN)
    world.hold(0.05)
    assert world.held
    time.sleep(0.06)
    assert not world.held


def test_rig_is_no_faster_after_a_hold(tmp_path: Path) -> None:
    """It would make up for the hold at twice its speed."""
    world = SharedTime(tmp_path / "time", ORIGIN)
    speed, begun = 20.0, time.time_ns()
    rig = _LeashedClock(ScaledClock(speed=speed, origin_wall=begun, origin=ORIGIN), world)
    world.hold(60.0)
    time.sleep(0.2)
    rig.step(0)
    held = rig.now()
    world.hold(0.0)
    since = time.time_ns()
    for _ in range(20):
        time.sleep(0.005)
        rig.step(0)
    passed = time.time_ns() - since
    assert 0 < rig.now() - held < 1.1 * speed * passed

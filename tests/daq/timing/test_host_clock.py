"""Clocks of the host, and the time that an emulated world shares through a file."""

import time
from pathlib import Path

import pytest

from daq import ScaledClock
from daq.timing import SharedTime


def test_shared_time_is_that_of_the_last_step_before(tmp_path: Path) -> None:
    written = SharedTime(tmp_path / "time", 5)
    read = SharedTime(tmp_path / "time")
    walls = []
    for step in (10, 20, 30):
        walls.append(time.monotonic_ns())
        written.step(step)
    assert [read.at(wall) for wall in walls] == [5, 10, 20]
    assert read.at(time.monotonic_ns()) == 30
    assert read.at(walls[0] - 10**12) == 5


def test_shared_time_keeps_its_last_steps(tmp_path: Path) -> None:
    written = SharedTime(tmp_path / "time", 0)
    begun = time.monotonic_ns()
    for step in range(1, 3001):
        written.step(step)
    assert written.at(time.monotonic_ns()) == 3000
    assert written.at(begun) == 3000 - 1024 + 1  # the oldest that is kept


def test_clock_stands_still_with_the_world(tmp_path: Path) -> None:
    origin, wall = 10**18, time.time_ns()
    world = SharedTime(tmp_path / "time", origin)
    clock = ScaledClock(speed=10.0, origin_wall=wall, origin=origin, shared=str(tmp_path / "time"))
    free = ScaledClock(speed=10.0, origin_wall=wall, origin=origin)
    before = time.monotonic_ns()
    assert clock.now() == origin < free.now()
    world.step(origin + 1000)
    assert clock.now() == origin + 1000
    assert clock.now(age=time.monotonic_ns() - before) == origin  # of what was received before the step
    world.step(SharedTime.NEVER)
    assert clock.now() <= free.now()
    assert clock.now() > origin + 1000


def test_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "time").write_text("12:00")
    with pytest.raises(OSError, match="not a file of shared time"):
        SharedTime(tmp_path / "time")

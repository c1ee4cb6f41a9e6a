"""Held-out logs that are not independent of the logs of the fit."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, LogExcerpt, Recording, write_recordings
from daq.types import find_gaps
from monitor.cli.data.diagnose.held_out import check_independent
from monitor.errors import ArgumentError

RATE, SECONDS = 100.0, 20.0


def log(path: Path, seed: int, start: int = 0) -> Path:
    data = np.random.default_rng(seed).standard_normal((round(RATE * SECONDS), 2))
    channels = tuple(Channel(name=name, device="import", axis=axis) for axis, name in enumerate("xy"))
    recording = Recording(channels=channels, data=data, rate=RATE, start=start, gaps=find_gaps(channels, data))
    write_recordings(path, [recording])
    return path


def excerpt(path: Path, start: float, stop: float) -> LogExcerpt:
    return LogExcerpt(log=path, start=round(1e9 * start), stop=round(1e9 * stop), text=f"{start:g} to {stop:g} s")


def test_samples_of_the_fit_are_refused(tmp_path: Path) -> None:
    own = log(tmp_path / "after.mcap", 1)
    copy = Path(shutil.copy(own, tmp_path / "copy.mcap"))
    for other in (own, copy, excerpt(own, 5.0, 9.0)):
        with pytest.raises(ArgumentError, match=r"^--held-out: .*copy\.mcap has samples that the fit uses too"):
            check_independent([copy], [other])


def test_other_times_and_other_samples_of_one_time_are_taken(tmp_path: Path) -> None:
    own, same_time = log(tmp_path / "after.mcap", 1), log(tmp_path / "second.mcap", 2)
    later = log(tmp_path / "later.mcap", 1, start=round(3600e9))
    check_independent([same_time, later], [own])
    check_independent([excerpt(own, 10.0, 20.0)], [excerpt(own, 0.0, 10.0)])


def test_one_table_of_modes_twice_is_refused(tmp_path: Path) -> None:
    first, second = tmp_path / "modes.csv", tmp_path / "again.csv"
    first.write_text("frequency\n10.5\n38\n", encoding="utf-8")
    with pytest.raises(ArgumentError, match="has samples that the fit uses too"):
        check_independent([first], [Path(shutil.copy(first, second))])
    second.write_text("frequency\n10.6\n38\n", encoding="utf-8")
    check_independent([first], [second])

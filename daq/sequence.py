"""Files of measurements that follow each other: a logger that begins a new table every five minutes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from daq.datafile import Measured, devices_of
from daq.errors import DataError
from daq.recording import Recording, find_gaps

_RATES_ALIKE = 2e-5  # relative: a tenth of what shifts of frequencies are told by
_MOST_OVERLAP = 1.5  # samples: by what dates are rounded to, and clocks differ


def in_order(files: Sequence[tuple[Path, Measured]]) -> tuple[Measured, ...]:
    """Return what files hold by time, at one rate, the same channels on the same devices.

    Each begins on the time grid of the first, as many samples after the one before as their dates tell, to the nearest:
    a logger whose converter and clock differ by some parts in a million drops no file for it, however many there are.

    Parameters
    ----------
    files : paths, and what was read of them; one file alone stays as it is

    Raises
    ------
    DataError
        Naming a file that has no dates, other channels or another rate than the first, or that overlaps another.
    """
    if len(files) == 1:
        return (files[0][1],)
    for path, measured in files:
        if not measured.dated:
            raise DataError(path, "states no dates: its place among the other files is not known; import it alone")
    ordered = sorted(files, key=lambda file: file[1].recording.start)
    first_path, first = ordered[0][0], ordered[0][1].recording
    patterns: list[tuple[str, ...]] = [() for _ in first.channels]
    placed: list[Recording] = []
    before, sample = (first_path, first.start), 0
    for path, measured in ordered:
        recording = replace(_alike(path, measured.recording, first_path, first), rate=first.rate)
        sample += _pause(path, recording, before)
        placed.append(replace(recording, start=first.start + round(sample / first.rate * 1e9)))
        before, sample = (path, recording.end), sample + len(recording.data)
        patterns = [(*own, channel.device) for own, channel in zip(patterns, recording.channels, strict=True)]
    channels = devices_of([channel.name for channel in first.channels], patterns)
    return tuple(
        replace(
            measured,
            recording=replace(recording, channels=channels, gaps=find_gaps(channels, recording.data)),
        )
        for (_, measured), recording in zip(ordered, placed, strict=True)
    )


def _alike(path: Path, found: Recording, first_path: Path, first: Recording) -> Recording:
    """Return a recording with its channels in the order of the first's."""
    names, wanted = ([channel.name for channel in one.channels] for one in (found, first))
    if sorted(names) != sorted(wanted):
        other = sorted(set(names) ^ set(wanted))
        raise DataError(path, f"has not the channels of {first_path}: only one of them has {', '.join(other):.100}")
    if abs(found.rate / first.rate - 1) > _RATES_ALIKE:
        raise DataError(path, f"has {found.rate:.8g} samples a second, {first_path} {first.rate:.8g}")
    place = [names.index(name) for name in wanted]
    return replace(found, channels=tuple(found.channels[i] for i in place), data=found.data[:, place])


def _pause(path: Path, found: Recording, before: tuple[Path, int]) -> int:
    """Return how many samples lie between a recording and the end [ns UTC] of the one before."""
    pause = (found.start - before[1]) * 1e-9
    if pause * found.rate < -_MOST_OVERLAP:
        raise DataError(path, f"begins {-pause:.6g} s before {before[0]} ends")
    return max(round(pause * found.rate), 0)

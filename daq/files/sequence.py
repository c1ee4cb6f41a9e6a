"""Files of measurements that follow each other: a logger that begins a new table every five minutes."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from daq.errors import DataError
from daq.files.columns.time_grid import TOLERANCE
from daq.files.measured import Measured, processed
from daq.files.measurement_file import devices_of, read_measured, read_unprocessed
from daq.files.options import DataOptions
from daq.types import Recording, find_gaps

_RATES_ALIKE = 2e-5  # relative: a tenth of detectable shifts of frequencies
_MAX_OVERLAP = 1.5  # samples: rounding of dates ...
_MAX_DRIFT = 1e-4  # ... and, relative to a file's length, the rate error of a converter


def read_in_order(paths: Sequence[Path], options: DataOptions) -> tuple[Measured, ...]:
    """Read one file of measurements, or several that follow each other, as `read_measured` and `in_order` do.

    Signals are differentiated, filtered and resampled across files.
    """
    if len(paths) == 1:
        return (read_measured(paths[0], options),)
    runs: list[list[Measured]] = []
    for part in in_order([(path, read_unprocessed(path, options)) for path in paths]):
        if runs and (part.recording.start - runs[-1][-1].recording.end) * 1e-9 * part.recording.rate < 0.5:
            runs[-1].append(part)
        else:
            runs.append([part])
    return tuple(part for run in runs for part in processed(paths[0], run, options))


def in_order(files: Sequence[tuple[Path, Measured]]) -> tuple[Measured, ...]:
    """Return the content of files in order of time, at one rate (that of the longest), with the same channels.

    Each file begins on the time grid of the first, at the sample nearest to its date. Files of a logger whose converter
    and clock differ by some tens of parts per million are thus combined without a loss, however many there are.

    Parameters
    ----------
    files : paths, and their content; a single file is unchanged

    Raises
    ------
    DataError
        Naming a file that has no dates, other channels or another rate than the longest, or that overlaps another.
    """
    if len(files) == 1:
        return (files[0][1],)
    for path, measured in files:
        if not measured.dated:
            raise DataError(path, "states no dates: its place among the other files is not known; import it alone")
    ordered = sorted(files, key=lambda file: file[1].recording.start)
    model_path, model = max(((path, m.recording) for path, m in ordered), key=lambda file: len(file[1].data))
    recordings = [replace(_alike(path, m.recording, model_path, model), rate=model.rate) for path, m in ordered]
    places = [0]  # samples from the first one's start
    for (before_path, _), (path, _), (before, found) in zip(ordered, ordered[1:], pairwise(recordings), strict=False):
        places.append(places[-1] + len(before.data) + _pause(path, found, before_path, before))
    patterns = zip(*([channel.device for channel in recording.channels] for recording in recordings), strict=True)
    channels = devices_of(model.channels, list(patterns))
    return tuple(
        replace(
            measured,
            recording=replace(
                recording,
                start=recordings[0].start + round(place / model.rate * 1e9),
                channels=channels,
                gaps=find_gaps(channels, recording.data),
            ),
        )
        for (_, measured), recording, place in zip(ordered, recordings, places, strict=True)
    )


def _alike(path: Path, found: Recording, model_path: Path, model: Recording) -> Recording:
    """Return a recording with its channels in the model's order; its rate counts by its number of samples."""
    names, wanted = ([channel.name for channel in one.channels] for one in (found, model))
    if sorted(names) != sorted(wanted):
        other = sorted(set(names) ^ set(wanted))
        raise DataError(path, f"has not the channels of {model_path}: only one of them has {', '.join(other):.100}")
    if abs(found.rate / model.rate - 1) > max(_RATES_ALIKE, TOLERANCE / len(found.data)):
        raise DataError(path, f"has {found.rate:.8g} samples per second, {model_path} {model.rate:.8g}")
    if names == wanted:
        return found
    place = [names.index(name) for name in wanted]
    return replace(found, channels=tuple(found.channels[i] for i in place), data=found.data[:, place])


def _pause(path: Path, found: Recording, before_path: Path, before: Recording) -> int:
    """Return how many samples lie between a recording and the one before."""
    pause = (found.start - before.end) * 1e-9
    if pause * found.rate < -max(_MAX_OVERLAP, _MAX_DRIFT * len(before.data)):
        raise DataError(path, f"begins {-pause:.6g} s before {before_path} ends")
    return max(round(pause * found.rate), 0)

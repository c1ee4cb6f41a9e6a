"""Held-out logs that are not independent of the logs of the fit."""

import filecmp
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from daq import AnyLog, Block, IntArray, LogExcerpt, read_log
from daq.log import log_span
from monitor.errors import ArgumentError

_LOG = ".mcap"
_SCANS = 64  # consecutive scans of a held-out log that are searched in the other logs
_SECOND = 10**9  # ns
_MIN_VALUES = 3  # different scans among them: fewer are of a silent sensor


def check_independent(held_out: Sequence[AnyLog], fitted: Sequence[AnyLog]) -> None:
    """Refuse held-out logs with samples that the fit uses.

    Logs of one time are permitted if their samples differ: tables without dates all begin in 1970.

    Raises
    ------
    ArgumentError
        Naming both logs.
    LogError
        If one of them cannot be read.
    """
    for own in held_out:
        for other in fitted:
            if _share_samples(own, other):
                raise ArgumentError(
                    "--held-out", f"{own} has samples that the fit uses too ({other}): give a record of another time"
                )


def _share_samples(one: AnyLog, other: AnyLog) -> bool:
    paths = [log for log in (one, other) if isinstance(log, Path)]
    if len(paths) == 2 and all(path.is_file() for path in paths) and filecmp.cmp(paths[0], paths[1], shallow=False):
        return True
    if any(path.suffix != _LOG for path in paths):  # modes have no samples
        return False
    spans = [_span(log) for log in (one, other)]
    start, stop = max(span[0] for span in spans), min(span[1] for span in spans)
    if start >= stop:
        return False
    middle = (start + stop) // 2
    near = (max(middle - _SECOND, start), min(middle + _SECOND, stop))
    theirs = _scans(other, *near)
    for device, scans in _scans(one, *near).items():
        first = max((len(scans) - _SCANS) // 2, 0)
        wanted = scans[first : first + _SCANS]
        if len(np.unique(wanted, axis=0)) < _MIN_VALUES:
            continue
        if device in theirs and _holds(theirs[device], wanted):
            return True
    return False


def _span(log: AnyLog) -> tuple[int, int]:
    """Return the first and the last time of a log or of its excerpt [ns UTC]; an empty span if there are no scans."""
    start, stop = log_span(log) or (0, 0)
    return (max(start, log.start), min(stop, log.stop)) if isinstance(log, LogExcerpt) else (start, stop)


def _scans(log: AnyLog, start: int, stop: int) -> dict[str, IntArray]:
    """Return the counts (n_scans, n_axes) of each device from start to stop [ns UTC]."""
    whole = log.log if isinstance(log, LogExcerpt) else log
    found: dict[str, list[IntArray]] = {}
    for item in read_log(LogExcerpt(log=whole, start=start, stop=stop, text="")):
        if isinstance(item, Block):
            found.setdefault(item.device, []).append(item.counts)
    return {device: np.concatenate(parts) for device, parts in found.items()}


def _holds(scans: IntArray, wanted: IntArray) -> bool:
    """Return whether consecutive scans hold the wanted ones."""
    if scans.shape[1] != wanted.shape[1]:
        return False
    n = len(wanted)
    return any(
        np.array_equal(scans[row : row + n], wanted) for row in np.flatnonzero((scans == wanted[0]).all(1)).tolist()
    )

"""Modes of the logs that a command is given, with its progress."""

import math
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from daq import AnyLog, LogError, Recording, load_recordings
from daq.log import as_logs
from monitor.analysis.logs import log_channels, log_held
from monitor.analysis.modal_table.table import is_table, read_tables
from monitor.analysis.observation import Observation, lowest_frequency, observe, pilot_seconds, window_seconds
from monitor.analysis.selection import Selection
from monitor.analysis.time_range import TimeRange
from monitor.cli.terminal import Work, echo, files_of_logs
from monitor.errors import ArgumentError, RecordLengthError
from oma import OmaError
from updater import Structure


def check_structure_first(structure: Path, logs: Sequence[Path]) -> None:
    """Refuse a log in the place of the structure file, with the file among the logs.

    Raises
    ------
    ArgumentError
        With the right order.
    """
    exchanged = next((path for path in logs if path.suffix == ".toml"), None)
    if exchanged is not None and structure.suffix != ".toml":
        raise ArgumentError("STRUCTURE.toml", f"expected the structure file before the logs: {exchanged} {structure}")


def observe_logs(
    structure: Structure,
    paths: Sequence[Path],
    window: float | None,
    what: str,
    work: Work,
    selection: Selection,
    within: TimeRange,
    exponential_window: float | None = None,
    lowest: float = math.inf,
) -> Observation:
    """Return the modes of logs, or of tables of modes, window by window.

    Parameters
    ----------
    structure : with the sensors
    paths : logs, or tables of modes
    window : length of a window [s]; by default by the lengths of the logs and the first mode, of the structure or, if
        far lower, measured
    what : name of the state for the progress
    work : progress
    selection : with channels that are left out
    within : range of the logs
    exponential_window : time constant, of frequency responses [s]
    lowest : frequency of the lowest mode that was measured in another state [Hz]

    Raises
    ------
    LogError
        If logs and tables are mixed, no channel is a sensor of the structure, or there are too few data or modes.
    ArgumentError
        If a range of tables is requested.
    """
    tables = [path for path in paths if is_table(path)]
    if tables and len(tables) < len(paths):
        raise LogError(tables[0], "expected modal tables only, or logs only, for one state")
    if tables and not within.whole:
        raise ArgumentError(", ".join(within.options), f"expected a log, found a table of modes: {tables[0]}")
    if tables:
        return read_tables(structure, paths, exponential_window)
    logs = within.of_logs(as_logs(paths), lambda text: echo(f"{', '.join(path.name for path in paths)}: {text}"))
    try:
        if window is None:
            work.stage(f"{what}: length", files_of_logs(logs))
            window = _window(structure, logs, selection, lowest)
        work.windows_of(what, logs)
        recordings = sensor_recordings(structure, logs, window, selection.without_channels)
        return observe(recordings, lambda one: work.window(one.start), structure.delays)
    except (OmaError, RecordLengthError) as error:
        raise LogError(", ".join(map(str, logs)), str(error)) from error


def _window(structure: Structure, logs: Sequence[AnyLog], selection: Selection, lowest: float) -> float:
    """Return how long windows are [s]: as logs are, or within the records of loggers that pause."""
    held = [log_held(log) for log in logs]
    shortest = min(one.seconds for one in held)
    record = min((one.record for one in held if one.record < one.seconds), default=math.inf)
    usual = window_seconds(structure, shortest, len(held), record)
    pilot = pilot_seconds(structure, shortest, len(held), record)
    if pilot > usual:
        lowest = min(lowest, lowest_frequency(sensor_recordings(structure, logs, pilot, selection.without_channels)))
    return window_seconds(structure, shortest, len(held), record, lowest)


def sensor_recordings(
    structure: Structure, logs: Sequence[AnyLog], seconds: float, left_out: Collection[str]
) -> Iterator[Recording]:
    """Yield the windows of logs, without channels that are no sensors of the structure or are left out."""
    for log in logs:
        found = log_channels(log)
        channels = tuple(c for c in found if c.name in structure.active_channels and c.name not in left_out)
        if not channels:
            have, know = ", ".join(c.name for c in found), ", ".join(structure.channels)
            raise LogError(str(log), f"expected channels named as the structure's sensors ({know}), found {have}")
        yield from load_recordings(log, window_seconds=seconds, channels=channels)

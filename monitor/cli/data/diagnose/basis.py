"""Basis of a diagnosis, for the head of its report: logs with their starts and lengths, fitted model parameters."""

from collections.abc import Sequence
from pathlib import Path

from daq import AnyLog, LogExcerpt
from daq.log import as_logs, files_of, log_span
from monitor.analysis.modal_table.table import is_table
from monitor.analysis.time_range import WHOLE, TimeRange
from monitor.text.causes import further_changes_text, parameter_change_text
from monitor.text.quantities import duration_text, utc
from updater.reference import Calibration

_SECOND = 10**9  # ns
_DATED = 365 * 86400 * _SECOND  # an earlier start is that of a table without dates
_MAX_LOGS = 4  # of one state that are all listed


def log_facts(name: str, paths: Sequence[Path], within: TimeRange = WHOLE) -> list[tuple[str, str]]:
    """Return names and values on the logs or tables of one state, nothing for none; errors as for `log_span`.

    Parameters
    ----------
    name : of the state
    paths : of logs or folders of them, or of tables of modes
    within : range of the logs
    """
    if any(map(is_table, paths)):
        return [(name, "; ".join(path.name for path in paths))]
    texts = [_log_text(log) for log in within.of_logs(as_logs(paths))] if paths else []
    if len(texts) > _MAX_LOGS:
        texts = [f"{len(texts)} logs, first {texts[0]}", f"last {texts[-1]}"]
    return [(name, "; ".join(texts))] if texts else []


def _log_text(log: AnyLog) -> str:
    """Return the file name of a log, its start and its length."""
    first, *others = (path.name for path in files_of(log))
    name = f"{first} and {len(others)} more files" if others else first
    span = log_span(log)
    if span is None:
        return name
    start, stop = span
    if isinstance(log, LogExcerpt):
        start, stop = max(start, log.start), min(stop, log.stop)
    length = duration_text(round((stop - start) / _SECOND))
    return f"{name}, {length}" if start < _DATED else f"{name}, {utc(start)}, {length}"


def calibration_facts(calibration: Calibration) -> list[tuple[str, str]]:
    """Return the model parameters that the reference logs changed significantly; nothing if none is fitted."""
    changes = calibration.changes()
    moved = "; ".join(parameter_change_text(change) for change in changes if change.listed)
    others = further_changes_text([change for change in changes if not change.listed])
    names = ("Fitted to the reference", "Also fitted" if moved else "Fitted to the reference")
    return [(name, text) for name, text in zip(names, (moved, others), strict=True) if text]

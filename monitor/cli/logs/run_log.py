"""The log of one run."""

from collections.abc import Sequence
from pathlib import Path

from daq.log import PartedLog, as_logs, newest_log
from monitor.errors import ArgumentError


def one_log(paths: Sequence[Path]) -> Path | PartedLog:
    """Return the one log that paths mean: a file, files of one run, or of a folder the newest run.

    Raises
    ------
    ArgumentError
        If they are logs of more than one run.
    LogError
        If a folder holds no log.
    """
    if len(paths) == 1:
        return newest_log(paths[0])
    logs = as_logs(paths)
    if len(logs) > 1:
        raise ArgumentError(
            "LOG",
            f"expected the files of one run, found those of {len(logs)}: {logs[0]}, {logs[1]}; "
            "tables that follow each other become one log by `modalwatch import DATA... -o LOG.mcap`",
        )
    return logs[0]

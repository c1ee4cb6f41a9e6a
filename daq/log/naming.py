"""Names of log files, and the files of one run."""

import itertools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from daq.errors import LogError
from daq.log.mcap_log import read_part
from daq.log.parts import AnyLog, Part, PartedLog, files_of


def log_path(folder: Path, start: int) -> Path:
    """Return a path for a new log that starts at a time [ns UTC]; names sort by time."""
    stem = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(start // 10**9))
    names = itertools.chain([stem], (f"{stem}_{k:04d}" for k in itertools.count(1)))
    return next(path for name in names if not (path := folder / f"{name}.mcap").exists())


def as_logs(paths: Sequence[Path]) -> list[Path | PartedLog]:
    """Return the logs at some paths: the files of one run are one log, a folder has all its logs by their starts.

    A path that is not a log is returned unchanged: reading it will raise the error.

    Raises
    ------
    LogError
        If a folder holds none.
    """
    files = dict.fromkeys(itertools.chain.from_iterable(map(_expanded, paths)))
    runs: dict[str, list[tuple[Part, Path]]] = {}
    for path in files:
        part = _part(path)
        runs.setdefault(part.run if part else str(path), []).append((part or _ALONE, path))
    return [_joined(run) for run in runs.values()]


_ALONE = Part(run="", started=0, number=0)


def _joined(run: list[tuple[Part, Path]]) -> Path | PartedLog:
    files = tuple(path for _, path in sorted(run, key=lambda entry: entry[0].number))
    return PartedLog(files) if len(files) > 1 else files[0]


def _part(path: Path) -> Part | None:
    try:
        return read_part(path)
    except LogError:
        return None


def _expanded(path: Path) -> Iterator[Path]:
    """Yield the logs of a folder and of its `log` folder, else the path itself."""
    if not path.is_dir():
        yield path
        return
    found = [*sorted(path.glob("*.mcap")), *sorted(path.glob("log/*.mcap"))]
    if not found:
        raise LogError(path, "holds no log: expected *.mcap in it or in its folder log/")
    yield from found


def newest_log(path: Path) -> Path | PartedLog:
    """Return the log at a path; of a folder the one that was written to last, with all files of its run.

    Raises
    ------
    LogError
        If a folder holds none.
    """
    logs = as_logs([path])
    return max(logs, key=_written) if len(logs) > 1 else logs[0]


def _written(log: AnyLog) -> tuple[int, str]:
    last = files_of(log)[-1]
    return last.stat().st_mtime_ns, last.name

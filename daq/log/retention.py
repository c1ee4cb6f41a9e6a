"""Choice of recorded files to delete when the disk fills: oldest first, never the newest, none of another run."""

import math
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

from daq.errors import LogError
from daq.log.mcap_log import read_part
from daq.log.parts import Part, lock

_STEP = 0.1  # share of the retention time that a pause between two files, or a changed clock, counts at most
_LOOK_SECONDS = 60.0  # wall time between scans of the folder, with files of years [s]; free space is queried each time


@dataclass(frozen=True, kw_only=True)
class Retention:
    """Limits on the recorded data that are kept; the first limit that is passed counts."""

    seconds: float = math.inf  #: recording time since a file was written last [s]
    size: float = math.inf  #: size of all recorded files of the folder [bytes]
    least_free: float = 0.0  #: room on the disk that is left to others [bytes]


@dataclass(frozen=True, kw_only=True)
class ExpiredFile:
    """A file that goes, and why."""

    path: Path
    size: int  #: [bytes]
    why: str


class DiskGuard:
    """Choice of the next recorded file to delete.

    Parameters
    ----------
    folder : of the logs
    retention : limits on what is kept
    """

    def __init__(self, folder: Path, retention: Retention) -> None:
        self._folder, self._retention = folder, retention
        self._parts: dict[Path, Part | None] = {}  # parts of files that were read
        self._due = 0.0

    @property
    def free(self) -> int:
        """Free space on the disk [bytes]."""
        return shutil.disk_usage(self._folder).free

    @property
    def short(self) -> bool:
        """Return whether less than the required space is free."""
        return self.free < self._retention.least_free

    def surplus(self, *, full: bool = False) -> ExpiredFile | None:
        """Return the oldest file if it must be deleted; None if no file must, or if only the newest is left.

        A file that is open for writing, and the one finished last, always stay.

        Parameters
        ----------
        full : the disk has refused data, independent of the reported free space
        """
        now = time.monotonic()
        if not (full or self.short or now >= self._due):
            return None
        self._due = now + _LOOK_SECONDS
        recorded = self._recorded()
        finished = list(islice((path for path in recorded if not _is_open(path)), 2))  # years are not looked through
        if len(finished) < 2:
            return None
        oldest = finished[0]
        why = self._why(recorded, oldest, full=full)
        if why is None:
            return None
        self._due = 0.0  # there may be more
        return ExpiredFile(path=oldest, size=oldest.stat().st_size, why=why)

    def _why(self, recorded: list[Path], oldest: Path, *, full: bool) -> str | None:
        """Return why the oldest one must go, None if it need not."""
        if full:
            return "the disk is full"
        if self.short:
            return f"{self.free / 1e9:.3g} GB are free, less than {self._retention.least_free / 1e9:.3g}"
        if self._retention.size < math.inf:
            size = sum(path.stat().st_size for path in recorded)
            if size > self._retention.size:
                return f"the logs use {size / 1e9:.3g} GB, more than {self._retention.size / 1e9:.3g}"
        age = self._age(recorded)
        if age > self._retention.seconds:
            return f"{age / 86400:.3g} days were recorded since, more than {self._retention.seconds / 86400:.3g}"
        return None

    def _age(self, recorded: list[Path]) -> float:
        """Return how long others have been recorded since the oldest one [s].

        Counted from file to file, not by the present clock: a clock error of years would delete all of them.
        """
        if self._retention.seconds == math.inf:
            return 0.0
        written = [path.stat().st_mtime for path in recorded]
        most = _STEP * self._retention.seconds
        return sum(min(max(after - before, 0.0), most) for before, after in pairwise(written))

    def _recorded(self) -> list[Path]:
        """Return the files that runs have recorded, by their age."""
        here = set(self._folder.glob("*.mcap"))
        self._parts = {path: part for path, part in self._parts.items() if path in here}
        for path in here - self._parts.keys():
            self._parts[path] = _part(path)
        return [path for *_, path in sorted(self._aged())]

    def _aged(self) -> Iterator[tuple[int, str, int, Path]]:
        for path, part in self._parts.items():
            if part is not None:
                yield part.started, part.run, part.number, path


def _part(path: Path) -> Part | None:
    try:
        return read_part(path)
    except LogError:
        return None


def _is_open(path: Path) -> bool:
    """Return whether a process writes to a file."""
    with path.open("rb") as file:
        return not lock(file)

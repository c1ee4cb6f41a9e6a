"""Logs as files: one file, the files of one run, or a range of time in either; lock of an open one against repair."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

PART = "modalwatch.part"  # name of the metadata record


@dataclass(frozen=True, kw_only=True)
class Part:
    """Number of the file and of its run, stored in the log as metadata."""

    run: str  #: the same in all files of a run, and in those of no other
    started: int  #: when the run started [ns UTC]
    number: int  #: number of the file in its run, from 0

    def metadata(self) -> dict[str, str]:
        """Return it as the file has it."""
        return {"run": self.run, "started": str(self.started), "number": str(self.number)}

    @staticmethod
    def parse(metadata: Mapping[str, str]) -> "Part":
        """Return the part that metadata describe; ValueError or KeyError if they describe none."""
        return Part(run=metadata["run"], started=int(metadata["started"]), number=int(metadata["number"]))


@dataclass(frozen=True)
class PartedLog:
    """Files that are read one after the other as one log."""

    files: tuple[Path, ...]  #: two or more, in the order of writing

    def __str__(self) -> str:
        """Name the first and the last one."""
        return f"{self.files[0]} to {self.files[-1].name}"

    @property
    def name(self) -> str:
        """Names of the first and the last one, without their folder."""
        return f"{self.files[0].name} to {self.files[-1].name}"


BEGINNING, END = 0, (1 << 63) - 1  #: times [ns UTC] before and after those of every log


@dataclass(frozen=True, kw_only=True)
class LogExcerpt:
    """The part of a log within a range of time: `read_log` yields nothing else of it."""

    log: Path | PartedLog
    start: int = BEGINNING  #: first time within it [ns UTC]
    stop: int = END  #: first time after it [ns UTC]
    text: str  #: the range for users, such as "60 to 120 s"

    def __str__(self) -> str:
        """Name the log and the range."""
        return f"{self.log} ({self.text})"

    @property
    def name(self) -> str:
        """Name of the log without its folder, and the range."""
        return f"{self.log.name} ({self.text})"


AnyLog = Path | PartedLog | LogExcerpt  #: one file, the files of one run, or a part of either


def files_of(log: AnyLog) -> tuple[Path, ...]:
    """Return the files of a log, in the order of writing; of an excerpt those of the whole log."""
    if isinstance(log, LogExcerpt):
        return files_of(log.log)
    return log.files if isinstance(log, PartedLog) else (log,)


if sys.platform == "win32":

    def lock(file: IO[bytes]) -> bool:
        """Return that the file is ours: Windows does not let another process replace a file that is open."""
        return not file.closed
else:
    import fcntl

    def lock(file: IO[bytes]) -> bool:
        """Lock an open file until it is closed, or its process ends; False if another process holds it."""
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

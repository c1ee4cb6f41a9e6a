"""The files of one run: each stands alone, together they are one log."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

PART = "modalwatch.part"  # name of the metadata record


@dataclass(frozen=True, kw_only=True)
class Part:
    """Which file of which run a log is; it stands in the file as metadata."""

    run: str  #: the same in all files of a run, and in those of no other
    started: int  #: when the run started [ns UTC]
    number: int  #: of the file in its run, from 0

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


AnyLog = Path | PartedLog  #: one file, or the files of one run


def files_of(log: AnyLog) -> tuple[Path, ...]:
    """Return the files of a log, in the order of writing."""
    return log.files if isinstance(log, PartedLog) else (log,)

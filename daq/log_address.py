"""Address of a device that is played from a log."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class LogAddress:
    """A device in a log."""

    path: Path  #: of the log, or of the folder with the files of one run
    device: str  #: its name in the log
    speed: float = 1.0  #: seconds of data a second of wall time

    def __str__(self) -> str:
        return f"{self.path} device {self.device}"

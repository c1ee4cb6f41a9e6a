"""Errors that stop the monitor before or during a run.

MonitorError
    SettingsError   SITE.toml cannot be used; names file and key
    ArgumentError   an argument that makes no sense; names it
    BodiesError     file of bodies at known places that cannot be used; names file and field
    ResultsError    a log, folder or file of which nothing can be shown; names it
    StartError      it could not start: a device, a port, a folder
    RecordLengthError   logs too short for the windows that an analysis needs (a ValueError as well)
StateError          modes of one state of the structure that cannot be compared; a ValueError, like its cause
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from daq.bounded_text import one_line

State = Literal["reference", "current", "heldout"]  #: state of the structure: before, now, now but held out


class MonitorError(Exception):
    """Base of all errors of this package; the message is one printable line of bounded length."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class SettingsError(MonitorError):
    """Settings that cannot be used."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


class BodiesError(MonitorError):
    """File of bodies at known places that cannot be used."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


class ArgumentError(MonitorError):
    """An argument of a command that makes no sense."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name


class ResultsError(MonitorError):
    """Results that cannot be shown."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise ResultsError for a file that cannot be written."""
    try:
        yield
    except OSError as error:
        raise ResultsError(path, f"cannot be written: {error.strerror}") from error


class StartError(MonitorError):
    """Something needed to start is not there."""


class RecordLengthError(MonitorError, ValueError):
    """Logs too short for the windows that an analysis needs."""


class StateError(ValueError):
    """Modes of one state that cannot be compared."""

    def __init__(self, state: State, message: str) -> None:
        super().__init__(message)
        self.state = state

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

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, Self

from daq.errors import FileError, OneLineError

#: state of the structure: before, now, now but held out, now with a known mass
State = Literal["reference", "current", "heldout", "mass"]


class MonitorError(OneLineError):
    """Base of all errors of this package."""


class SettingsError(FileError, MonitorError):
    """Settings that cannot be used."""


class BodiesError(FileError, MonitorError):
    """File of bodies at known places that cannot be used."""


class ArgumentError(MonitorError):
    """An argument of a command that makes no sense."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name

    @classmethod
    def of_file(cls, name: str) -> Callable[[Path, str], Self]:
        """Return a function that makes the error of a file, which this argument names."""
        return lambda path, message: cls(name, f"{path}: {message}")


@contextmanager
def drawing(path: Path, option: str) -> Iterator[None]:
    """Raise ArgumentError where matplotlib cannot write a picture; ValueError is of an unknown file name extension."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise ArgumentError(option, f"{path}: cannot be written: {error}".splitlines()[0]) from error


class ResultsError(FileError, MonitorError):
    """Results that cannot be shown."""


class StartError(MonitorError):
    """Something needed to start is not there."""


class RecordLengthError(MonitorError, ValueError):
    """Logs too short for the windows that an analysis needs."""


class StateError(ValueError):
    """Modes of one state that cannot be compared."""

    def __init__(self, state: State, message: str) -> None:
        super().__init__(message)
        self.state = state

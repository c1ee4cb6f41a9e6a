"""Errors between a sensor and a recording.

DaqError
    DriverError         a device that does not answer as its protocol says
        DeviceLost      a device that answered and is gone
    LogError            a log that cannot be read or written; names the file
    ItemError           an item that no log can hold
    DataError           a file of measurements that cannot be imported; names the file, and line or field
    DbcError            a description of CAN frames that cannot be used; names the file, and line, message or signal
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from daq.bounded_text import one_line


class OneLineError(Exception):
    """Error whose message is one printable line of bounded length."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class FileError(OneLineError):
    """Error that names a file or folder."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path, self.message = path, message


class DaqError(OneLineError):
    """Base of all errors of this package."""


class DriverError(DaqError):
    """A device does not follow its protocol; names the port."""

    def __init__(self, port: str, message: str) -> None:
        super().__init__(f"{port}: {message}")
        self.port = port


class DeviceLost(DriverError):  # noqa: N818 - what happened, not an error of somebody's
    """A device that was streaming and is gone, or silent."""


class LogError(FileError, DaqError):
    """A log file that cannot be used."""


class ItemError(DaqError):
    """An item that no log can hold."""


class DataError(FileError, DaqError):
    """A file of measurements that cannot be imported."""


class DbcError(FileError, DaqError):
    """A DBC file lacks a required signal or message."""


def system_reason(error: Exception) -> str:
    """Return the text of an error; of one of the system its reason alone, without the number."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def reading(path: Path, error: Callable[[Path, str], Exception]) -> AbstractContextManager[None]:
    """Raise an error of this kind where a file cannot be read."""
    return _access(path, error, "read")


def writing(path: Path, error: Callable[[Path, str], Exception]) -> AbstractContextManager[None]:
    """Raise an error of this kind where a file cannot be written."""
    return _access(path, error, "written")


@contextmanager
def _access(path: Path, error: Callable[[Path, str], Exception], how: str) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        raise error(path, f"cannot be {how}: {problem.strerror or problem}") from problem

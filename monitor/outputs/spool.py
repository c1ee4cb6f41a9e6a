"""Items that cannot be delivered now, kept on disk in order: one line each, so that a cut line costs only itself."""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from daq.bounded_text import parse_json

_LOCK = threading.Lock()  # between appending and removing, of any spool of this process
_LARGEST = 64 * 10**6  # bytes


class Spool:
    """A file of lines of JSON that wait.

    Parameters
    ----------
    path : of the file; there only while something waits
    largest : size beyond which nothing more is kept [bytes]
    """

    def __init__(self, path: Path, *, largest: int = _LARGEST) -> None:
        self.path, self._largest = path, largest

    @property
    def waiting(self) -> bool:
        """Return whether entries are waiting."""
        return self.path.exists()

    @property
    def size(self) -> int:
        """Size of the waiting items [bytes]."""
        try:
            return self.path.stat().st_size
        except OSError:
            return 0

    def append(self, lines: Iterable[str]) -> int:
        """Keep lines; return how many there was no room for."""
        lines = list(lines)
        if not lines:
            return 0
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with _LOCK, self.path.open("a+b") as file:
                if file.seek(0, os.SEEK_END):
                    file.seek(-1, os.SEEK_END)
                    if file.read(1) != b"\n":
                        file.write(b"\n")  # a kill has cut the line: the next one stays whole
                for kept, line in enumerate(lines):
                    if file.tell() + len(line) >= self._largest:
                        return len(lines) - kept
                    file.write(line.encode() + b"\n")
        except OSError:
            return len(lines)
        return 0

    def deliver(self, take: Callable[[list[str]], None], batch: int) -> int:
        """Deliver the waiting entries, oldest first, `batch` lines at a time; return their number.

        Exceptions of `take` are passed on, and everything stays: `take` must accept a line twice. An incomplete line is
        left out.
        """
        if not self.waiting:
            return 0
        count = 0
        with self.path.open("rb") as file:
            with _LOCK:
                end = self.size  # later entries may be incomplete
            while lines := list(islice(_lines(file, end), batch)):
                take(lines)
                count += len(lines)
            with _LOCK:
                self._forget(file)
        return count

    def _forget(self, file: BinaryIO) -> None:
        """Remove the entries that were read; entries appended meanwhile by another thread stay.

        A file that is not the spool any more has been delivered and removed by another thread.
        """
        if not self._is_spool(file):
            return
        rest = file.read()
        if not rest:
            self.path.unlink()
            return
        unfinished = self.path.with_suffix(".part")
        unfinished.write_bytes(rest)
        os.replace(unfinished, self.path)

    def _is_spool(self, file: BinaryIO) -> bool:
        try:
            return os.path.samestat(os.fstat(file.fileno()), self.path.stat())
        except FileNotFoundError:
            return False


def _lines(file: BinaryIO, end: int) -> Iterator[str]:
    """Yield whole lines from here to a place in a file [bytes], without their ends."""
    while file.tell() < end:
        line = file.readline().decode(errors="replace")
        if _whole(line):
            yield line.rstrip("\n")


def _whole(line: str) -> bool:
    if not line.endswith("\n"):
        return False
    try:
        return isinstance(parse_json(line), dict)
    except ValueError:
        return False

"""The service data (SDO) side of an emulated CANopen node: its objects, read and written by their numbers.

Writes of up to four bytes, reads of any length (segmented where four are not enough); CiA 301, section 7.2.4.3.
"""

from collections.abc import Callable
from dataclasses import dataclass

Place = tuple[int, int]  #: index, subindex
_NO_OBJECT, _NO_SUBINDEX, _READ_ONLY = 0x0602_0000, 0x0609_0011, 0x0601_0002
_WRONG_LENGTH, _WRONG_VALUE, _UNKNOWN_COMMAND, _WRONG_TOGGLE = 0x0607_0010, 0x0609_0030, 0x0504_0001, 0x0503_0000
_DOWNLOAD, _UPLOAD, _NEXT, _ABORT = 0x20, 0x40, 0x60, 0x80  # commands, in the upper three bits


@dataclass(frozen=True)
class Entry:
    """One object."""

    value: bytes
    accepts: Callable[[bytes], bool] | None = None  #: None: it cannot be written


class SdoServer:
    """Objects of one node.

    Parameters
    ----------
    entries : at the start
    written : called with the entry that was written
    """

    def __init__(self, entries: dict[Place, Entry], written: Callable[[Place], None]) -> None:
        self._entries, self._written = entries, written
        self._left = b""  # of a read under way
        self._place: Place = (0, 0)
        self._toggle = 0

    def __getitem__(self, place: Place) -> int:
        """Return an object as a number."""
        return int.from_bytes(self._entries[place].value, "little")

    def set(self, place: Place, value: int) -> None:
        """Change an object from inside the device."""
        entry = self._entries[place]
        self._entries[place] = Entry(value.to_bytes(len(entry.value), "little"), entry.accepts)

    def answer(self, request: bytes) -> bytes | None:
        """Return the reply to a request of eight bytes, None if it requires none."""
        if len(request) != 8:
            return None
        command = request[0] & 0xE0
        if command == _NEXT:
            return self._segment(request[0] & 0x10)
        self._place, self._left = (int.from_bytes(request[1:3], "little"), request[3]), b""
        if command == _ABORT:
            return None
        if command not in (_DOWNLOAD, _UPLOAD):
            return self._abort(_UNKNOWN_COMMAND)
        if self._place not in self._entries:
            known = any(index == self._place[0] for index, _ in self._entries)
            return self._abort(_NO_SUBINDEX if known else _NO_OBJECT)
        return self._upload() if command == _UPLOAD else self._download(request)

    def _download(self, request: bytes) -> bytes:
        if not request[0] & 0x02:
            return self._abort(_UNKNOWN_COMMAND)  # longer than four bytes: no object is
        entry = self._entries[self._place]
        value = request[4 : 8 - (request[0] >> 2 & 3 if request[0] & 1 else 4 - len(entry.value))]
        if entry.accepts is None:
            return self._abort(_READ_ONLY)
        if len(value) != len(entry.value):
            return self._abort(_WRONG_LENGTH)
        if not entry.accepts(value):
            return self._abort(_WRONG_VALUE)
        self._entries[self._place] = Entry(value, entry.accepts)
        self._written(self._place)
        return self._reply(0x60, bytes(4))

    def _upload(self) -> bytes:
        value = self._entries[self._place].value
        if len(value) <= 4:
            return self._reply(0x43 | (4 - len(value)) << 2, value.ljust(4, b"\0"))
        self._left, self._toggle = value, 0
        return self._reply(0x41, len(value).to_bytes(4, "little"))

    def _segment(self, toggle: int) -> bytes:
        if not self._left:
            return self._abort(_UNKNOWN_COMMAND)
        if toggle != self._toggle:
            return self._abort(_WRONG_TOGGLE)
        part, self._left = self._left[:7], self._left[7:]
        self._toggle ^= 0x10
        return bytes([toggle | (7 - len(part)) << 1 | (not self._left)]) + part.ljust(7, b"\0")

    def _reply(self, command: int, data: bytes) -> bytes:
        return bytes([command]) + self._place[0].to_bytes(2, "little") + bytes([self._place[1]]) + data

    def _abort(self, code: int) -> bytes:
        self._left = b""
        return self._reply(0x80, code.to_bytes(4, "little"))

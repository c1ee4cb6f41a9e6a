"""Vector's BLF files read with bounded memory and in bounded time.

python-can's reader inflates a container to whatever size it has, and does not end where an object states a length of 0.
"""

import struct
import zlib
from collections.abc import Generator

from daq.protocol.can_library import can

_HEADER = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, object type
_CONTAINER = struct.Struct("<H6xL4x")  # method of compression, size uncompressed
_LOG_CONTAINER, _PLAIN, _DEFLATED = 10, 0, 2
_MAX_CONTAINER = 16 << 20  # bytes uncompressed: writers make 128 kB
_MAX_OBJECT = 64 << 20
_PADDING = 8  # bytes in which the next object begins


class BoundedBlfReader(can.BLFReader):
    """Reader of a BLF file that refuses containers which are larger than any writer makes."""

    def __iter__(self) -> Generator[can.Message, None, None]:
        """Yield the messages."""
        while head := self.file.read(_HEADER.size):
            signature, _, _, size, kind = _HEADER.unpack(head)
            if signature != b"LOBJ" or not _HEADER.size <= size <= _MAX_OBJECT:
                raise can.io.blf.BLFParseError(f"object of {size} bytes")
            body = self.file.read(size - _HEADER.size)
            self.file.read(size % 4)
            if kind == _LOG_CONTAINER:
                data = _contents(body)
                _check_objects(self._tail + data)
                yield from self._parse_container(data)
        self.stop()


def _contents(body: bytes) -> bytes:
    method, _ = _CONTAINER.unpack_from(body)
    if method == _PLAIN:
        return body[_CONTAINER.size :]
    if method != _DEFLATED:
        raise can.io.blf.BLFParseError(f"unknown method of compression {method}")
    data = zlib.decompressobj().decompress(body[_CONTAINER.size :], _MAX_CONTAINER + 1)
    if len(data) > _MAX_CONTAINER:
        raise can.io.blf.BLFParseError(f"container: expected up to {_MAX_CONTAINER} bytes uncompressed, found more")
    return data


def _check_objects(data: bytes) -> None:
    """Refuse objects that are shorter than their own header: the next one would be the same for ever."""
    at = data.find(b"LOBJ", 0, _PADDING)
    while at >= 0 and at + _HEADER.size <= len(data):
        size = _HEADER.unpack_from(data, at)[3]
        if size < _HEADER.size:
            raise can.io.blf.BLFParseError(f"object of {size} bytes")
        at = data.find(b"LOBJ", at + size, at + size + _PADDING)

"""Records of a log file in their order, read in large pieces; the indexes between chunks are passed over.

The stock reader takes each field of each record from the file by itself, and checks the whole file by a checksum at its
end, although each chunk has its own. The few records other than chunks are parsed by the stock reader's parsers.
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from typing import IO, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata, Schema

from daq.log.format.chunks import FRAME, WholeReads

_FIRST_PIECE, _PIECE = 1 << 14, 1 << 20  # bytes read at once; often only the attachments are wanted
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
_CHUNK = struct.Struct("<QQQII")  # first and last time, uncompressed size, its checksum, length of a name
_LENGTH = struct.Struct("<Q")
_END, _CHUNK_CODE, _INDEX_CODE = int(Opcode.DATA_END), int(Opcode.CHUNK), int(Opcode.MESSAGE_INDEX)
_PARSERS: Mapping[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
}


class RecordStream:
    """Records of a file up to its summary, without message indexes.

    Parameters
    ----------
    file : behind its magic
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._whole = file, WholeReads(file)
        self._buffer, self._at = b"", 0  # what was read, and the place in it
        self._piece = _FIRST_PIECE
        self.position = file.tell()  #: place behind the record read last [bytes]

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield records.

        Raises
        ------
        EndOfFile
            If the file ends before its data do.
        McapError, struct.error, ValueError
            If a record is damaged.
        """
        while True:
            self._need(FRAME)
            opcode, length = _HEAD.unpack_from(self._buffer, self._at)
            while opcode == _INDEX_CODE and self._at + length + 2 * FRAME <= len(self._buffer):  # behind chunks
                self._at += FRAME + length
                self.position += FRAME + length
                opcode, length = _HEAD.unpack_from(self._buffer, self._at)
            if opcode == _END:
                return
            self._need(FRAME + length)
            begin = self._at + FRAME
            self._at = begin + length
            self.position += FRAME + length
            if opcode == _CHUNK_CODE:
                yield _chunk(self._buffer, begin, self._at)
            elif opcode in _PARSERS or opcode == Opcode.MESSAGE:
                yield _parsed(opcode, self._buffer[begin : self._at])

    def _need(self, n: int) -> None:
        """Have the next n bytes in the buffer."""
        missing = n - (len(self._buffer) - self._at)
        if missing <= 0:
            return
        if missing > _PIECE and not self._whole.holds(n):
            raise McapError(f"a length of {n} bytes is more than the file has")
        more = self._file.read(max(missing, self._piece))
        self._piece = _PIECE
        if len(more) < missing:
            raise EndOfFile
        self._buffer, self._at = self._buffer[self._at :] + more, 0


def _chunk(buffer: bytes, begin: int, end: int) -> Chunk:
    """Return the chunk whose content is at these places of a buffer."""
    name = begin + _CHUNK.size
    if name + _LENGTH.size > end:
        raise McapError("a record is longer than its length")
    first, last, size, checksum, named = _CHUNK.unpack_from(buffer, begin)
    at = name + named + _LENGTH.size
    if at > end or at + (length := _LENGTH.unpack_from(buffer, name + named)[0]) > end:
        raise McapError("a record is longer than its length")
    return Chunk(
        compression=buffer[name : name + named].decode(),
        data=buffer[at : at + length],
        message_end_time=last,
        message_start_time=first,
        uncompressed_crc=checksum,
        uncompressed_size=size,
    )


def _parsed(opcode: int, content: bytes) -> McapRecord:
    """Return a record from its content."""
    stream = ReadDataStream(cast(IO[bytes], WholeReads(BytesIO(content))))
    try:
        return Message.read(stream, len(content)) if opcode == Opcode.MESSAGE else _PARSERS[opcode](stream)
    except EndOfFile as error:  # the end of the record must not be taken for the end of the file
        raise McapError("a record is longer than its length") from error

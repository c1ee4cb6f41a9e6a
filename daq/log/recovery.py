"""Data and missing end record of a log that was cut short by a kill.

Every chunk is decompressed and compared with its checksum, and its index must match its messages. If anything else than
whole chunks and an unfinished rest is found, `daq.log.repair` copies the valid parts instead.

References
----------
MCAP file format specification, https://mcap.dev/spec
"""

import mmap
import struct
import zlib
from collections.abc import Iterable
from io import BytesIO
from typing import IO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from zstandard import ZstdDecompressor, ZstdError, frame_content_size

from daq.log.format.chunks import check_chunk_size, next_chunk
from daq.log.format.message_index import IndexedChunks, time_range
from daq.log.mcap_log import MAGIC

_FRAME = struct.Struct("<BQ")  # of a record: opcode, length
_CHUNK = struct.Struct("<QQQII")  # first and last time, size, checksum, length of the compression's name
_INDEX = struct.Struct("<BQHI")  # of an index: opcode, length, channel, length of its entries


class NotPlainError(Exception):
    """The log holds something else than whole chunks and an unfinished rest."""


class PlainLog:
    """Contents of a log without an end, up to its last whole chunk.

    Parameters
    ----------
    file : opened for reading; not empty

    Raises
    ------
    NotPlainError
        If it is not as its writer left it.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._indexed = IndexedChunks()
        self.good = len(MAGIC)  #: bytes up to the end of the last whole chunk
        self._zstd = ZstdDecompressor()
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            try:
                while self._take(data):
                    pass
                self._define_all(self._indexed.look())
            except (McapError, ZstdError, struct.error, ValueError) as error:
                raise NotPlainError(str(error)) from error

    @property
    def n_messages(self) -> int:
        """Number of messages in whole chunks."""
        return self._indexed.counts.total()

    def _take(self, data: mmap.mmap) -> bool:
        """Take the next record, a chunk with its index; False if there is no whole one."""
        start = self.good
        if start + _FRAME.size > len(data):
            return False
        opcode, length = _FRAME.unpack_from(data, start)
        end = start + _FRAME.size + length
        if opcode == Opcode.DATA_END:
            return False
        if end > len(data):
            if next_chunk(data, start) is not None:
                raise NotPlainError(f"length of the record at byte {start}")
            return False
        if opcode == 0 and not data[start:].strip(b"\0"):
            return False  # a power cut may leave room that nothing was written to
        if opcode == Opcode.CHUNK:
            end = self._chunk(data, start, end)
        elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
            self._aside(data[start + _FRAME.size : end], opcode, start)
        elif opcode != Opcode.HEADER:
            raise NotPlainError(f"record {opcode} at byte {start}")
        self.good = end
        return True

    def _aside(self, content: bytes, opcode: int, start: int) -> None:
        """Note an attachment or metadata."""
        stream, length = ReadDataStream(BytesIO(content)), _FRAME.size + len(content)
        if opcode == Opcode.METADATA:
            name = Metadata.read(stream).name
            self._metadata.append(MetadataIndex(offset=start, length=length, name=name))
            return
        if zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little"):
            raise NotPlainError(f"attachment at byte {start}")
        found = Attachment.read(stream)
        self._attachments.append(
            AttachmentIndex(
                offset=start,
                length=length,
                log_time=found.log_time,
                create_time=found.create_time,
                data_size=len(found.data),
                name=found.name,
                media_type=found.media_type,
            )
        )

    def _chunk(self, data: mmap.mmap, start: int, end: int) -> int:
        """Take a chunk that ends at `end`; return where the index behind it ends."""
        first, last, size, checksum, named = _CHUNK.unpack_from(data, start + _FRAME.size)
        at = start + _FRAME.size + _CHUNK.size + named + 8
        compressed = data[at:end]
        check_chunk_size(size)
        lengths = int.from_bytes(data[at - 8 : at], "little"), frame_content_size(compressed)
        if data[at - 8 - named : at - 8] != b"zstd" or lengths != (end - at, size):
            raise NotPlainError(f"chunk at byte {start}")
        raw = self._zstd.decompress(compressed)
        if zlib.crc32(raw) != checksum:
            raise NotPlainError(f"checksum of the chunk at byte {start}")
        entries, offsets, behind = _index(data, end)
        if (first, last) != time_range(entries):
            raise NotPlainError(f"times of the chunk at byte {start}")
        self._define_all(self._indexed.add(raw, entries))
        self._chunks.append(
            ChunkIndex(
                message_start_time=first,
                message_end_time=last,
                chunk_start_offset=start,
                chunk_length=end - start,
                message_index_offsets=offsets,
                message_index_length=behind - end,
                compression="zstd",
                compressed_size=len(compressed),
                uncompressed_size=size,
            )
        )
        return behind

    def _define_all(self, between: Iterable[bytes]) -> None:
        """Record schemas and channels between messages."""
        for content in between:
            at = 0
            while at < len(content):
                opcode, length = _FRAME.unpack_from(content, at)
                at += _FRAME.size + length
                if at > len(content):
                    raise NotPlainError("a definition is longer than its chunk")
                self._define(opcode, content[at - length : at])

    def _define(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self._channels[channel.id] = channel
        else:
            raise NotPlainError(f"record {opcode} in a chunk is in no index")

    def end(self) -> bytes:
        """Return the records after the last chunk of a finished log, as the stock writer writes them."""
        data_end = RecordBuilder()
        DataEnd(0).write(data_end)
        head = _content(data_end)
        start = self.good + len(head)
        summary, offsets = RecordBuilder(), []
        groups: tuple[tuple[Opcode, list[McapRecord]], ...] = (
            (Opcode.SCHEMA, [*self._schemas.values()]),
            (Opcode.CHANNEL, [*self._channels.values()]),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, [*self._chunks]),
            (Opcode.ATTACHMENT_INDEX, [*self._attachments]),
            (Opcode.METADATA_INDEX, [*self._metadata]),
        )
        for opcode, records in groups:
            begun = summary.count
            for record in records:
                record.write(summary)
            offsets.append(SummaryOffset(opcode, start + begun, summary.count - begun))
        offset_start = start + summary.count
        for offset in offsets:
            offset.write(summary)
        return head + _with_footer(_content(summary), start, offset_start) + MAGIC

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._indexed.counts),
            chunk_count=len(self._chunks),
            message_count=self.n_messages,
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _index(data: mmap.mmap, at: int) -> tuple[dict[int, bytes], dict[int, int], int]:
    """Return the index of a chunk that ends at `at`: channel -> entries, channel -> place, and where it ends."""
    entries, offsets = {}, {}
    while at < len(data) and data[at] == Opcode.MESSAGE_INDEX:
        _, length, channel, size = _INDEX.unpack_from(data, at)
        begin = at + _INDEX.size
        if channel in entries or size != length - 6 or size % 16 or begin + size > len(data):
            raise NotPlainError(f"index at byte {at}")
        entries[channel], offsets[channel] = data[begin : begin + size], at
        at = begin + size
    return entries, offsets, at


def _with_footer(summary: bytes, start: int, offset_start: int) -> bytes:
    """Return a summary with its footer, whose checksum covers both up to itself."""
    builder = RecordBuilder()
    Footer(start, offset_start, 0).write(builder)
    checksum = zlib.crc32(summary + _content(builder)[:-4])
    Footer(start, offset_start, checksum).write(builder)
    return summary + _content(builder)


def _content(builder: RecordBuilder) -> bytes:
    """Return the content, and start again."""
    return bytes(builder.end())  # type: ignore[no-untyped-call]

"""The index of a log's chunks: of a finished file, and of an open one as the bytes that the file will end with.

The stock writer keeps an object a chunk, a kilobyte for six devices and three for 32, until the file is finished: five
a second for as long as a file may grow.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO, cast

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, Message
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from daq.errors import LogError, reading
from daq.log.format.chunks import ChunkReader, WholeReads

_OPCODE_AND_LENGTH = 9  # bytes
_LIST = "_Writer__chunk_indices"  # name of the list in the stock writer, the only private name used


@dataclass(frozen=True, eq=False)
class FileIndex:
    """Channels and chunks of one file."""

    path: Path
    channels: tuple[Channel, ...]
    chunks: tuple[ChunkIndex, ...]  #: chunks in the order of writing

    def with_topics(self, wanted: Callable[[str], bool]) -> tuple[ChunkIndex, ...]:
        """Return the chunks that hold messages of any of these topics, in the order of writing."""
        channels = {channel.id for channel in self.channels if wanted(channel.topic)}
        return tuple(chunk for chunk in self.chunks if not channels.isdisjoint(chunk.message_index_offsets))

    def messages(self, chunk: ChunkIndex, wanted: Callable[[Channel], bool]) -> list[Message]:
        """Return the messages of wanted channels in one chunk.

        Raises
        ------
        LogError
            If the file cannot be read or the chunk is damaged.
        """
        try:
            with self.path.open("rb") as file:
                whole = WholeReads(file)
                whole.seek(chunk.chunk_start_offset + _OPCODE_AND_LENGTH)
                read = Chunk.read(ReadDataStream(cast(IO[bytes], whole)))
            reader = ChunkReader(wanted)
            for channel in self.channels:
                reader.channel(channel)
            return [record for record in reader.records(read) if isinstance(record, Message)]
        except OSError as error:
            raise LogError(self.path, f"cannot be read: {error.strerror}") from error
        except (McapError, ZstdError, struct.error, ValueError) as error:
            end = chunk.chunk_start_offset + chunk.chunk_length
            raise LogError(
                self.path, f"is damaged before byte {end} (`modalwatch repair` keeps every whole chunk): {error}"
            ) from error


def file_index(path: Path) -> FileIndex | None:
    """Return the index of a file; None if it has none, as one that was cut or is being written.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    with reading(path, LogError):
        file = path.open("rb")
    with file:
        try:
            summary = make_reader(cast(IO[bytes], WholeReads(file))).get_summary()
        except (OSError, McapError, struct.error, ValueError):  # OSError: shorter than a footer
            return None  # whoever reads the records one by one reports the damage
    if summary is None or not summary.chunk_indexes:
        return None
    chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
    if any(one.chunk_start_offset + one.chunk_length > other.chunk_start_offset for one, other in pairwise(chunks)):
        return None  # chunks do not overlap: such an index would have one read many times
    return FileIndex(path, tuple(summary.channels.values()), tuple(chunks))


class ChunkIndexes:
    """Replacement of the stock writer's list of chunk indexes, kept as packed bytes."""

    def __init__(self) -> None:
        self._built = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Take the index of one more chunk."""
        index.write(self._built)

    def __iter__(self) -> Iterator["ChunkIndexes"]:
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write all of them, and forget them."""
        summary.write(self._built.end())  # type: ignore[no-untyped-call]


class LeanWriter(Writer):
    """The stock writer with such an index."""

    def __init__(self, file: IO[bytes]) -> None:
        super().__init__(file, compression=CompressionType.ZSTD)
        setattr(self, _LIST, ChunkIndexes())

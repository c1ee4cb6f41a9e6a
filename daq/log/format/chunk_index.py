"""The index of an open log's chunks, kept as the bytes that the file will end with.

The stock writer keeps an object a chunk, a kilobyte for six devices and three for 32, until the file is finished: five
a second for as long as a file may grow.
"""

from collections.abc import Iterator
from typing import IO

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

_LIST = "_Writer__chunk_indices"  # name of the list in the stock writer, the only private name used


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

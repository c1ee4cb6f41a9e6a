"""Lines of JSON as compact bytes, packed one by one and read in pieces: neither is ever whole in memory as text."""

import io
import json
from collections.abc import Iterator
from typing import Any

import zstandard

_LEVEL = 3  # of compression


class Packer:
    """Packed lines, so far."""

    def __init__(self) -> None:
        self._packer = zstandard.ZstdCompressor(level=_LEVEL).compressobj()
        self._parts: list[bytes] = []

    def add(self, entry: dict[str, Any]) -> None:
        """Add one line."""
        self._parts.append(self._packer.compress(json.dumps(entry).encode() + b"\n"))

    def finish(self) -> bytes:
        """Return all lines; none can be added any more."""
        return b"".join([*self._parts, self._packer.flush()])


def unpack(packed: bytes) -> Iterator[dict[str, Any]]:
    """Yield the entries that a `Packer` has packed."""
    with io.TextIOWrapper(zstandard.ZstdDecompressor().stream_reader(packed), encoding="utf-8") as lines:
        for line in lines:
            yield json.loads(line)

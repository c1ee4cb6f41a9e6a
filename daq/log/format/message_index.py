"""Check of the indexes behind a log's chunks against their messages, for many chunks at once.

Each entry must point at a message of its channel and time, and everything between these messages must be definitions:
each message is then indexed exactly once.
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode

_ENTRY = np.dtype([("time", "<u8"), ("at", "<u8")])
_MESSAGE = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("time", "<u8")])
_FRAME, _MIN = 9, 22  # bytes of a record's opcode and length, and of a message behind them
_ENOUGH = 1 << 19  # bytes of chunks to be looked at together
_Places = npt.NDArray[np.int64]


class IndexedChunks:
    """Chunks with their indexes, to be looked at together."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()  #: channel -> messages
        self._begin()

    def _begin(self) -> None:
        self._chunks: list[bytes] = []
        self._entries: list[bytes] = []
        self._of_entries: list[tuple[int, int, int]] = []  # channel, where the chunk begins behind the others, number
        self._size = 0

    def add(self, records: bytes, entries: dict[int, bytes]) -> Iterator[bytes]:
        """Take the records of a chunk, and channel -> entries of its index; yield definitions as `look`, now and then.

        Raises
        ------
        ValueError
            If an index does not match the messages.
        """
        for channel, listed in entries.items():
            n = len(listed) // _ENTRY.itemsize
            self.counts[channel] += n
            self._entries.append(listed)
            self._of_entries.append((channel, self._size, n))
        self._chunks.append(records)
        self._size += len(records)
        if self._size >= _ENOUGH:
            yield from self.look()

    def look(self) -> Iterator[bytes]:
        """Check all chunks that were not checked yet; yield the records between messages. Errors as `add`."""
        raw = b"".join(self._chunks)
        entries = np.frombuffer(b"".join(self._entries), _ENTRY)
        channel, origin, n = np.array(self._of_entries, np.int64).reshape(-1, 3).T
        self._begin()
        at = entries["at"].astype(np.int64) + np.repeat(origin, n)
        order = np.argsort(at)
        at = at[order]
        if len(at) and (at[0] < 0 or at[-1] + _FRAME + _MIN > len(raw)):
            raise ValueError("an index points beyond its chunk")
        places = max(0, len(raw) - _MESSAGE.itemsize + 1)  # a message may begin at any byte
        head = np.ndarray((places,), _MESSAGE, raw, strides=(1,))[at]
        length = head["length"].astype(np.int64)
        same = (head["channel"] == np.repeat(channel, n)[order]) & (head["time"] == entries["time"][order])
        if not (same & (head["opcode"] == Opcode.MESSAGE) & (length >= _MIN)).all():
            raise ValueError("an index does not point at a message of its channel and time")
        yield from _between(raw, at, at + _FRAME + length)


def time_range(entries: dict[int, bytes]) -> tuple[int, int]:
    """Return the first and last time of a chunk's index: channel -> entries; zeros for none."""
    times = np.frombuffer(b"".join(entries.values()), _ENTRY)["time"]
    return (int(times.min()), int(times.max())) if len(times) else (0, 0)


def _between(raw: bytes, starts: _Places, stops: _Places) -> Iterator[bytes]:
    """Yield the records before, between and after messages."""
    begins, ends = np.append(0, stops), np.append(starts, len(raw))
    if (begins > ends).any():
        raise ValueError("two entries of an index point at one message")
    for k in np.flatnonzero(begins < ends).tolist():
        yield raw[begins[k] : ends[k]]

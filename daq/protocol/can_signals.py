"""Signals in the data of CAN frames: bits to numbers by the block and back, whatever their order, sign and kind.

A frame's eight bytes are one number of 64 bits, read forwards for big-endian signals and backwards for little-endian
ones; a signal is then a shift and a mask, for a million frames as for one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from daq.types import FloatArray

Bytes = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint64]
_FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}


@dataclass(frozen=True, kw_only=True)
class CanSignal:
    """Position of a number in a frame, and its meaning: physical = factor * raw + offset.

    Parameters
    ----------
    start : as in a DBC file: bit 8 k + j is bit j (0 the least) of byte k; the least bit of a little-endian signal, the
        greatest of a big-endian one
    length : bits, 1 to 64; of a float 16, 32 or 64

    Raises
    ------
    ValueError
        If it does not fit into eight bytes, or is a float of another length.
    """

    name: str
    start: int
    length: int
    big_endian: bool = False
    signed: bool = False
    is_float: bool = False
    factor: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        """Check that there is such a place."""
        if not (1 <= self.length <= 64 and 0 <= self.start < 64 and 0 <= self._shift <= 64 - self.length):
            raise ValueError(f"signal {self.name}: bit {self.start}, {self.length} long, is not inside 8 bytes")
        if self.is_float and self.length not in _FLOATS:
            raise ValueError(f"signal {self.name}: expected a float of 16, 32 or 64 bits, found {self.length}")

    @property
    def _shift(self) -> int:
        """Bits of the 64 below the signal's least one."""
        if self.big_endian:
            return 64 - (8 * (self.start // 8) + 7 - self.start % 8) - self.length
        return self.start

    @property
    def _order(self) -> str:
        return ">u8" if self.big_endian else "<u8"

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest physical value; infinite for a float."""
        if self.is_float:
            return -np.inf, np.inf
        low = -(1 << self.length - 1) if self.signed else 0
        high = low + (1 << self.length) - 1
        ends = sorted((self.factor * low + self.offset, self.factor * high + self.offset))
        return ends[0], ends[1]

    def bits(self, data: Bytes) -> Words:
        """Return the signal's bits (n,), as an unsigned number, of frames' data (n, 8)."""
        words = np.ascontiguousarray(data).view(self._order)[:, 0].astype(np.uint64)
        return np.asarray(words >> np.uint64(self._shift) & self._mask)

    def raw(self, data: Bytes) -> npt.NDArray[Any]:
        """Return the numbers as they were sent (n,): uint64, int64 or a float, of frames' data (n, 8)."""
        bits = self.bits(data)
        if self.is_float:
            unsigned, kind = _FLOATS[self.length]
            return bits.astype(unsigned).view(kind)
        if self.signed:
            free = 64 - self.length
            return (bits << np.uint64(free)).view(np.int64) >> np.int64(free)
        return bits

    def physical(self, data: Bytes) -> FloatArray:
        """Return the values (n,), in the signal's unit, of frames' data (n, 8)."""
        return np.asarray(self.raw(data).astype(float) * self.factor + self.offset)

    def put(self, data: Bytes, raw: npt.NDArray[Any]) -> None:
        """Write numbers (n,) into frames' data (n, 8), replacing its bits; surplus bits are cut off."""
        if self.is_float:
            unsigned, kind = _FLOATS[self.length]
            bits = raw.astype(kind).view(unsigned).astype(np.uint64)
        else:
            bits = raw.astype(np.uint64) if raw.dtype == np.uint64 else raw.astype(np.int64).view(np.uint64)
        shift = np.uint64(self._shift)
        words = data.view(self._order)
        words[:, 0] = words[:, 0].astype(np.uint64) & ~(self._mask << shift) | (bits & self._mask) << shift

    @property
    def _mask(self) -> np.uint64:
        return np.uint64((1 << self.length) - 1)

"""Integers in few bits: differences of the order that leaves least, Rice-coded; both directions side by side.

What a sensor measures is noise upon something that is smooth at its rate. Its differences of some order are nearly
white, and small; of white noise of a normal distribution a Rice code takes a tenth of a bit more than entropy allows.
All arithmetic is modulo 2^32, so that every int32 comes back exactly, whatever the order.

A residual r is made positive as u = 2 r, or -2 r - 1 if r < 0. Its `n_low` lower bits stand in `low`, all of one after
those of another, the greatest first; `high` has as many zeros as u / 2^n_low says, and a one. Both end in zeros.

References
----------
R. F. Rice, Some practical universal noiseless coding techniques, JPL Publication 79-22 (1979).
T. Robinson, SHORTEN: simple lossless and near-lossless waveform compression, Cambridge University CUED/F-INFENG/TR.156
(1994): differences of fixed order, the parameter from the mean.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq.recording import IntArray

ORDERS = range(4)  #: of differences that are tried
_BITS = 32
_Unsigned = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class PackedColumn:
    """Samples of one axis."""

    order: int  #: of the differences
    start: tuple[int, ...]  #: the first sample and its differences of lower order; of order 0 what was subtracted
    n_low: int  #: bits of each residual in `low`
    low: bytes
    high: bytes


def pack(counts: IntArray) -> list[PackedColumn]:
    """Return the columns of counts (n, n_axes), n > 0."""
    samples = np.ascontiguousarray(counts.T).view(np.uint32)
    middle = (counts.sum(0, dtype=np.int64) // len(counts)).astype(np.int32).view(np.uint32)
    tried = [samples - middle[:, None]]
    for order in ORDERS[1 : samples.shape[1]]:
        before = tried[-1] if order > 1 else samples
        tried.append(before[:, 1:] - before[:, :-1])
    orders = np.argmin([np.abs(d.view(np.int32), dtype=np.float32).sum(1) for d in tried], axis=0)
    first = np.stack([samples[:, 0], *(d[:, 0] for d in tried[1:])]).view(np.int32)
    columns = []
    for axis, order in enumerate(orders.tolist()):
        start = first[:order, axis] if order else middle[axis : axis + 1].view(np.int32)
        columns.append(_packed(tried[order][axis], order, tuple(start.tolist())))
    return columns


def _packed(residual: _Unsigned, order: int, start: tuple[int, ...]) -> PackedColumn:
    signed = residual.view(np.int32)
    u = (residual << np.uint32(1)) ^ (signed >> 31).view(np.uint32)
    n_low = _n_low(u)
    ends = np.cumsum((u >> np.uint32(n_low)) + np.uint32(1), dtype=np.intp) - 1
    high = np.zeros(int(ends[-1]) + 1 if len(ends) else 0, np.uint8)
    high[ends] = 1
    bits = np.unpackbits(u.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)[:, _BITS - n_low :]
    return PackedColumn(order, start, n_low, np.packbits(bits).tobytes(), np.packbits(high).tobytes())


def _n_low(u: _Unsigned) -> int:
    """Return how many lower bits to take apart, for the fewest in all: near the logarithm of the mean."""
    guess = max(1, int(u.sum(dtype=np.int64)) // max(1, len(u))).bit_length() - 1
    tried = np.arange(max(0, guess - 1), min(_BITS - 1, guess + 1) + 1, dtype=np.uint32)
    bits = (u >> tried[:, None]).sum(1, dtype=np.int64) + len(u) * tried.astype(np.int64)
    return int(tried[bits.argmin()])


def unpack(columns: list[PackedColumn], n: int) -> IntArray:
    """Return counts (n, n_axes).

    Raises
    ------
    ValueError
        If a column does not hold n samples.
    """
    return np.stack([_unpacked(column, n) for column in columns], axis=1)


def _unpacked(column: PackedColumn, n: int) -> IntArray:
    n_residuals = n - column.order
    ends = np.flatnonzero(np.unpackbits(np.frombuffer(column.high, np.uint8)))
    bits = np.unpackbits(np.frombuffer(column.low, np.uint8))
    if len(ends) != n_residuals or not 0 <= len(bits) - n_residuals * column.n_low < 8 or column.n_low > _BITS:
        raise ValueError(f"packed counts: expected {n_residuals} residuals, found {len(ends)} and {len(bits)} bits")
    whole = np.zeros((n_residuals, _BITS), np.uint8)
    whole[:, _BITS - column.n_low :] = bits[: n_residuals * column.n_low].reshape(n_residuals, column.n_low)
    u = np.packbits(whole).view(">u4").astype(np.uint32)
    u |= (np.diff(ends, prepend=-1) - 1).astype(np.uint32) << np.uint32(column.n_low)
    residual = (u >> np.uint32(1)) ^ (np.uint32(0) - (u & np.uint32(1)))
    return _summed(residual, column).view(np.int32)


def _summed(residual: _Unsigned, column: PackedColumn) -> _Unsigned:
    """Return samples from their differences."""
    start = np.array(column.start, np.int32).view(np.uint32)
    if len(start) != max(1, column.order):
        raise ValueError(f"packed counts: expected {max(1, column.order)} start values, found {len(start)}")
    if column.order == 0:
        return np.asarray(residual + start[0])
    for first in start[::-1]:
        residual = np.cumsum(np.append(first, residual), dtype=np.uint32)
    return residual

"""Integers in few bits: differences of the order that leaves least, Rice-coded; both directions side by side.

What a sensor measures is noise upon something that is smooth at its rate. Its differences of some order are nearly
white, and small; of white noise of a normal distribution a Rice code takes a tenth of a bit more than entropy allows.
All arithmetic is modulo 2^32, so that every int32 comes back exactly, whatever the order.

A residual r is made positive as u = 2 r, or -2 r - 1 if r < 0. Of each axis the `n_low` lower bits of all u stand one
after those of another, the greatest first; behind those of the last axis each u of each axis has as many zeros as
u / 2^n_low says, and a one. The bits end in zeros. In logs of before each axis had its bytes for itself.

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
class Packed:
    """Samples of all axes."""

    order: tuple[int, ...]  #: of the differences of each axis
    start: tuple[int, ...]  #: of each axis the first sample and its differences of lower order; of order 0 its mean
    n_low: tuple[int, ...]  #: bits of each residual that stand apart, of each axis
    bits: bytes


@dataclass(frozen=True)
class PackedColumn:
    """Samples of one axis, as in old logs: lower bits and the rest in bytes of their own."""

    order: int
    start: tuple[int, ...]
    n_low: int
    low: bytes
    high: bytes


def pack(counts: IntArray) -> Packed:
    """Pack counts (n, n_axes), n > 0."""
    samples = np.ascontiguousarray(counts.T).view(np.uint32)
    middle = (counts.sum(0, dtype=np.int64) // len(counts)).astype(np.int32).view(np.uint32)
    tried = [samples - middle[:, None]]
    for order in ORDERS[1 : samples.shape[1]]:
        before = tried[-1] if order > 1 else samples
        tried.append(before[:, 1:] - before[:, :-1])
    orders = np.argmin([np.abs(d.view(np.int32), dtype=np.float32).sum(1) for d in tried], axis=0).tolist()
    first = np.stack([samples[:, 0], *(d[:, 0] for d in tried[1:])]).view(np.int32)
    start: list[int] = []
    n_low: list[int] = []
    low: list[npt.NDArray[np.uint8]] = []
    high: list[_Unsigned] = []
    for axis, order in enumerate(orders):
        start += (first[:order, axis] if order else middle[axis : axis + 1].view(np.int32)).tolist()
        u = _positive(tried[order][axis])
        n_low.append(_n_low(u))
        low.append(np.unpackbits(u.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)[:, _BITS - n_low[-1] :].ravel())
        high.append(u >> np.uint32(n_low[-1]))
    ends = np.cumsum(np.concatenate(high) + np.uint32(1), dtype=np.intp) - 1
    unary = np.zeros(int(ends[-1]) + 1 if len(ends) else 0, np.uint8)
    unary[ends] = 1
    return Packed(tuple(orders), tuple(start), tuple(n_low), np.packbits(np.concatenate([*low, unary])).tobytes())


def _positive(residual: _Unsigned) -> _Unsigned:
    """Return 2 r of residuals r, or -2 r - 1 of negative ones."""
    return np.asarray((residual << np.uint32(1)) ^ (residual.view(np.int32) >> 31).view(np.uint32))


def _n_low(u: _Unsigned) -> int:
    """Return how many lower bits to take apart, for the fewest in all: near the logarithm of the mean."""
    guess = max(1, int(u.sum(dtype=np.int64)) // max(1, len(u))).bit_length() - 1
    tried = np.arange(max(0, guess - 1), min(_BITS - 1, guess + 1) + 1, dtype=np.uint32)
    bits = (u >> tried[:, None]).sum(1, dtype=np.int64) + len(u) * tried.astype(np.int64)
    return int(tried[bits.argmin()])


def unpack(packed: Packed, n: int) -> IntArray:
    """Return counts (n, n_axes).

    Raises
    ------
    ValueError
        If the axes do not hold n samples each.
    """
    if not packed.order or len(packed.order) != len(packed.n_low):
        raise ValueError(f"packed counts: expected axes, found {len(packed.order)} orders, {len(packed.n_low)} lengths")
    n_start = [max(1, order) for order in packed.order]
    if max(packed.n_low) > _BITS or max(packed.order) > n or len(packed.start) != sum(n_start):
        raise ValueError(f"packed counts: expected {sum(n_start)} start values, found {len(packed.start)}")
    n_residuals = [n - order for order in packed.order]
    low, high = np.split(
        np.unpackbits(np.frombuffer(packed.bits, np.uint8)),
        [sum(n_each * n_low for n_each, n_low in zip(n_residuals, packed.n_low, strict=True))],
    )
    rest = _rest(high, sum(n_residuals))
    columns, start = [], iter(packed.start)
    for order, n_low, n_each in zip(packed.order, packed.n_low, n_residuals, strict=True):
        residual = _joined(low[: n_each * n_low], rest[:n_each], n_low)
        low, rest = low[n_each * n_low :], rest[n_each:]
        columns.append(_summed(residual, order, [next(start) for _ in range(max(1, order))]))
    return np.stack(columns, axis=1)


def unpack_columns(columns: list[PackedColumn], n: int) -> IntArray:
    """Return counts (n, n_axes) of an old log, as `unpack`."""
    return np.stack([_column(column, n) for column in columns], axis=1)


def _column(column: PackedColumn, n: int) -> IntArray:
    n_low = max(0, n - column.order) * column.n_low
    low = np.frombuffer(column.low, np.uint8)
    if len(low) != -(-n_low // 8):
        raise ValueError(f"packed counts: expected {n_low} bits, found {len(low)} bytes")
    bits = np.packbits(np.r_[np.unpackbits(low)[:n_low], np.unpackbits(np.frombuffer(column.high, np.uint8))])
    return unpack(Packed((column.order,), column.start, (column.n_low,), bits.tobytes()), n)[:, 0]


def _rest(high: npt.NDArray[np.uint8], n: int) -> _Unsigned:
    """Return the upper part of residuals (n,) from their bits."""
    ends = np.flatnonzero(high)
    if len(ends) != n:
        raise ValueError(f"packed counts: expected {n} residuals, found {len(ends)}")
    return (np.diff(ends, prepend=-1) - 1).astype(np.uint32)


def _joined(low: npt.NDArray[np.uint8], rest: _Unsigned, n_low: int) -> _Unsigned:
    """Return residuals (n,) from both their parts; `low` has all bits of one after those of another."""
    whole = np.zeros((len(rest), _BITS), np.uint8)
    whole[:, _BITS - n_low :] = low.reshape(len(rest), n_low)
    u = np.packbits(whole).view(">u4").astype(np.uint32) | rest << np.uint32(n_low)
    return np.asarray((u >> np.uint32(1)) ^ (np.uint32(0) - (u & np.uint32(1))))


def _summed(residual: _Unsigned, order: int, start: list[int]) -> IntArray:
    """Return samples from their differences."""
    first = np.array(start, np.int32).view(np.uint32)
    if order == 0:
        return np.asarray((residual + first[0]).view(np.int32))
    for value in first[::-1]:
        residual = np.cumsum(np.append(value, residual), dtype=np.uint32)
    return residual.view(np.int32)

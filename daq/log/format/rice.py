"""Integers in few bits: differences of the order that leaves least, Rice-coded; both directions side by side.

A sensor signal is noise plus a part that is smooth at its rate. Its differences of some order are nearly white and
small. For white noise with a normal distribution, a Rice code takes a tenth of a bit more than the entropy. All
arithmetic is modulo 2^32, so that every int32 is restored exactly, for any order.

A residual r is mapped to u = 2 r, or -2 r - 1 if r < 0. For each axis, the `n_low` lower bits of all u are stored one
after another, highest bit first. After those of the last axis, each u of each axis is stored as u / 2^n_low zeros and a
one. The bits are padded with zeros.

References
----------
R. F. Rice, Some practical universal noiseless coding techniques, JPL Publication 79-22 (1979).
T. Robinson, SHORTEN: simple lossless and near-lossless waveform compression, Cambridge University CUED/F-INFENG/TR.156
(1994): differences of fixed order, the parameter from the mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from daq.types import IndexArray, IntArray

ORDERS = range(4)  #: orders of the differences tried
_BITS = 32
_NARROW = 25  # low bits of a residual that four bytes contain, wherever in a byte they begin
_NEAR = np.array([[-1], [0], [1]])
_Unsigned = npt.NDArray[np.uint32]


class Packed(NamedTuple):
    """Samples of all axes."""

    order: tuple[int, ...]  #: order of the differences of each axis
    start: tuple[int, ...]  #: per axis: first sample and its differences of lower order; for order 0 the mean
    n_low: tuple[int, ...]  #: number of low bits of each residual, per axis
    bits: bytes


def pack(counts: IntArray) -> Packed:
    """Pack counts (n, n_axes), n > 0."""
    residual, orders, start = _least(np.ascontiguousarray(counts.T))
    u = (residual << np.uint32(1)) ^ (residual.view(np.int32) >> 31).view(np.uint32)
    n_low = _n_low(u, len(counts) - orders)
    bits = np.unpackbits(u.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1).reshape(*u.shape, _BITS)
    rest = u >> n_low[:, None].astype(np.uint32)
    axes = tuple(zip(orders.tolist(), n_low.tolist(), strict=True))
    low = [axis[order:, _BITS - n :].ravel() for axis, (order, n) in zip(bits, axes, strict=True)]
    high = np.concatenate([axis[order:] for axis, (order, _) in zip(rest, axes, strict=True)])
    ends = np.cumsum(high + np.uint32(1), dtype=np.intp) - 1
    unary = np.zeros(int(ends[-1]) + 1 if len(ends) else 0, np.uint8)
    unary[ends] = 1
    packed = np.packbits(np.concatenate([*low, unary])).tobytes()
    return Packed(tuple(orders.tolist()), start, tuple(n_low.tolist()), packed)


def _least(samples: IntArray) -> tuple[_Unsigned, IndexArray, tuple[int, ...]]:
    """Return the residuals of the best differences of samples (n_axes, n), preceded by zeros; their orders; `start`.

    The powers of successive differences are moments of a spectrum, whose logarithm is convex: once they increase, they
    continue to increase.
    """
    middle = (samples.sum(1, dtype=np.int64) // samples.shape[1]).astype(np.int32)
    before = samples.view(np.uint32)
    least = before - middle.view(np.uint32)[:, None]
    size, orders, first = _size(least), np.zeros(len(samples), np.intp), []
    for order in ORDERS[1 : samples.shape[1]]:
        first.append(before[:, order - 1].view(np.int32))
        after = np.zeros_like(before)
        after[:, order:] = before[:, order:] - before[:, order - 1 : -1]
        better = (found := _size(after)) < size
        if not better.any():
            break
        least[better], size[better], orders[better] = after[better], found[better], order
        before = after
    heads = (first[:order] if order else [middle] for order in orders.tolist())
    return least, orders, tuple(int(head[axis]) for axis, taken in enumerate(heads) for head in taken)


def _size(differences: _Unsigned) -> npt.NDArray[np.float32]:
    return np.asarray(np.abs(differences.view(np.int32), dtype=np.float32).sum(1))


def _n_low(u: _Unsigned, n: IndexArray) -> IndexArray:
    """Return how many lower bits to take apart on each axis, for the fewest in all: near the logarithm of the mean.

    Parameters
    ----------
    u : (n_axes, n_samples), zeros where there is no residual
    n : (n_axes,) residuals
    """
    guess = np.log2(np.maximum(1, u.sum(1, dtype=np.int64) / np.maximum(1, n))).astype(np.intp)
    tried = np.clip(guess + _NEAR, 0, _BITS - 1)
    bits = (u >> tried[:, :, None].astype(np.uint32)).sum(2, dtype=np.int64) + n * tried
    return np.asarray(tried[bits.argmin(0), np.arange(len(u))])


def unpack(packed: Packed, n: int) -> IntArray:
    """Return counts (n, n_axes).

    Raises
    ------
    ValueError
        If the axes do not hold n samples each.
    """
    return unpack_many([packed], [n])[0]


def unpack_many(packed: Sequence[Packed], n: Sequence[int]) -> list[IntArray]:
    """Return the counts (n, n_axes) of several blocks, in one pass over all their bits.

    Raises
    ------
    ValueError
        If the axes of any do not hold n samples each.
    """
    if not packed:
        return []
    axes = _Axes.of(packed, n)
    rest, window = _rest(packed, axes), _windows(packed, int(axes.n_low.max()))
    rows = {length: np.flatnonzero(axes.samples == length) for length in set(n)}
    counts = {length: np.empty((len(chosen), length), np.uint32) for length, chosen in rows.items()}
    for length, table in counts.items():
        order = axes.order[rows[length]]
        for each in np.unique(order).tolist():
            chosen = rows[length][order == each]
            start = axes.start[axes.first_start[chosen][:, None] + np.arange(max(1, each))]
            table[order == each] = _summed(_joined(window, rest, axes, chosen, length - each), each, start)
    result, used = [], dict.fromkeys(counts, 0)
    for one, length in zip(packed, n, strict=True):
        begin = used[length]
        used[length] = end = begin + len(one.order)
        result.append(counts[length][begin:end].view(np.int32).T)
    return result


@dataclass(frozen=True, eq=False, kw_only=True)
class _Axes:
    """All axes of packed blocks, one after the other, and the places of their parts."""

    order: IndexArray  #: (n_axes,) order of the differences
    n_low: IndexArray  #: (n_axes,) low bits of each residual
    samples: IndexArray  #: (n_axes,)
    start: _Unsigned  #: start values of all axes
    first_start: IndexArray  #: (n_axes,) place of an axis's first start value
    first_low: IndexArray  #: (n_axes,) first low bit, in the bits of all blocks
    first_rest: IndexArray  #: (n_axes,) place of the first residual's upper part
    high: IndexArray  #: (n_blocks,) first bit of the upper parts, in the bits of the block
    n_residuals: IndexArray  #: (n_blocks,)

    @staticmethod
    def of(packed: Sequence[Packed], n: Sequence[int]) -> "_Axes":
        """Return the axes of blocks of n samples; ValueError if the parts of a block do not fit."""
        n_axes = np.array([len(one.order) for one in packed])
        for one in packed:
            if not one.order or len(one.order) != len(one.n_low):
                raise ValueError(
                    f"packed counts: expected axes, found {len(one.order)} orders, {len(one.n_low)} lengths"
                )
        order, n_low, start = (
            np.array(list(chain.from_iterable(parts)), np.intp)
            for parts in ((one.order for one in packed), (one.n_low for one in packed), (one.start for one in packed))
        )
        edge = np.append(0, np.cumsum(n_axes)[:-1])
        samples = np.repeat(np.array(n, np.intp), n_axes)
        n_start, found = np.maximum(order, 1), np.array([len(one.start) for one in packed])
        expected = np.add.reduceat(n_start, edge)
        unlike = np.maximum.reduceat((n_low > _BITS) | (order > samples), edge) | (found != expected)
        if unlike.any():
            wrong = int(np.argmax(unlike))
            raise ValueError(f"packed counts: expected {expected[wrong]} start values, found {found[wrong]}")
        residuals = samples - order
        low, n_bits = residuals * n_low, np.array([8 * len(one.bits) for one in packed])
        high = np.add.reduceat(low, edge)
        if (high > n_bits).any():
            wrong = int(np.argmax(high > n_bits))
            raise ValueError(f"packed counts: expected {high[wrong]} low bits, found {n_bits[wrong]}")
        before = _before(low)
        return _Axes(
            order=order,
            n_low=n_low,
            samples=samples,
            start=start.astype(np.int32).view(np.uint32),
            first_start=_before(n_start),
            first_low=before - np.repeat(before[edge] - _before(n_bits), n_axes),
            first_rest=_before(residuals),
            high=high,
            n_residuals=np.add.reduceat(residuals, edge),
        )


def _before(lengths: IndexArray) -> IndexArray:
    """Return the sum of the lengths before each."""
    return np.cumsum(lengths) - lengths


def _rest(packed: Sequence[Packed], axes: _Axes) -> _Unsigned:
    """Return the upper parts of all residuals from their bits."""
    first = axes.high // 8
    parts = [one.bits[begin:] for one, begin in zip(packed, first.tolist(), strict=True)]
    bits = np.unpackbits(np.frombuffer(b"".join(parts), np.uint8))
    lengths = np.array([8 * len(part) for part in parts])
    begins, skipped = _before(lengths), axes.high % 8
    bits[(begins[:, None] + np.arange(8))[np.arange(8) < skipped[:, None]]] = 0  # last low bits in the same byte
    ends = np.flatnonzero(bits.view(np.bool_))
    edges = np.searchsorted(ends, np.append(begins, len(bits)))
    found = np.diff(edges)
    if (found != axes.n_residuals).any():
        wrong = int(np.argmax(found != axes.n_residuals))
        raise ValueError(f"packed counts: expected {axes.n_residuals[wrong]} residuals, found {found[wrong]}")
    rest = np.diff(ends, prepend=-1) - 1
    some = found > 0
    rest[edges[:-1][some]] = ends[edges[:-1][some]] - (begins + skipped)[some]
    return rest.astype(np.uint32)


def _windows(packed: Sequence[Packed], n_low: int) -> npt.NDArray[np.uint32] | npt.NDArray[np.uint64]:
    """Return 32 bits, or 64 if more low bits need them, from each byte of all bits on, as a view."""
    size = 4 if n_low <= _NARROW else 8
    data = b"".join([*(one.bits for one in packed), bytes(8)])
    return np.ndarray((len(data) - 7,), f">u{size}", data, strides=(1,))


def _joined(
    window: npt.NDArray[np.uint32] | npt.NDArray[np.uint64],
    rest: _Unsigned,
    axes: _Axes,
    chosen: IndexArray,
    n: int,
) -> _Unsigned:
    """Return residuals (n_chosen, n) of axes from both their parts.

    Parameters
    ----------
    window : bits from each byte on
    rest : upper parts
    axes : all
    chosen : (n_chosen,) numbers of the axes, with n residuals each
    n : number of residuals
    """
    kind = window.dtype.newbyteorder("=")
    n_low = axes.n_low[chosen][:, None]
    place = axes.first_low[chosen][:, None] + n_low * np.arange(n)
    u = window[place >> 3].astype(kind)
    u <<= (place & 7).astype(kind)
    u >>= (8 * kind.itemsize - n_low).astype(kind)  # nothing is left of none
    low = u.astype(np.uint32, copy=False)
    first = axes.first_rest[chosen]
    if len(first) * n == first[-1] + n - first[0]:
        upper = rest[first[0] : first[-1] + n].reshape(len(first), n)
    else:
        upper = rest[first[:, None] + np.arange(n)]
    low |= upper << n_low.astype(np.uint32)
    sign = np.uint32(0) - (low & np.uint32(1))
    low >>= np.uint32(1)
    low ^= sign
    return np.asarray(low)


def _summed(residual: _Unsigned, order: int, start: _Unsigned) -> _Unsigned:
    """Return samples (n_axes, n) from their differences (n_axes, n - order), and their start values (n_axes, ..)."""
    if order == 0:
        return np.asarray(residual + start)
    samples = np.empty((len(residual), order + residual.shape[1]), np.uint32)
    samples[:, order:] = residual
    for k in range(order - 1, -1, -1):
        samples[:, k] = start[:, k]
        np.cumsum(samples[:, k:], axis=1, out=samples[:, k:])
    return samples

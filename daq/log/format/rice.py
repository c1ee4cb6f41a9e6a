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

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from daq.types import BoolArray, IndexArray, IntArray

ORDERS = range(4)  #: orders of the differences tried
_BITS = 32
_NARROW = 25  # low bits of a residual that four bytes contain, wherever in a byte they begin
_NEAR = np.array([[-1], [0], [1]])
_Unsigned = npt.NDArray[np.uint32]
_Windows = npt.NDArray[np.uint32] | npt.NDArray[np.uint64]


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
    if not packed.order or len(packed.order) != len(packed.n_low):
        raise ValueError(f"packed counts: expected axes, found {len(packed.order)} orders, {len(packed.n_low)} lengths")
    whole = PackedBlocks(
        order=np.array(packed.order, np.intp),
        n_low=np.array(packed.n_low, np.intp),
        start=np.array(packed.start, np.int64),
        n_axes=np.array([len(packed.order)]),
        n_start=np.array([len(packed.start)]),
        n=np.array([n]),
        bits=[packed.bits],
        used=np.ones(len(packed.order), np.bool_),
    )
    return unpack_blocks(whole)[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class PackedBlocks:
    """Samples of all axes of several blocks, one after the other."""

    order: IndexArray  #: (n_axes_of_all,) order of the differences
    n_low: IndexArray  #: (n_axes_of_all,) low bits of each residual
    start: npt.NDArray[np.int64]  #: start values of all axes
    n_axes: IndexArray  #: (n_blocks,) axes of each block, at least one
    n_start: IndexArray  #: (n_blocks,) start values of each block
    n: IndexArray  #: (n_blocks,) samples of each axis of a block
    bits: Sequence[bytes]  #: bits of each block
    used: BoolArray  #: (n_axes_of_all,) axes to be unpacked: others are 0, those behind the last used one are left out


def unpack_blocks(packed: PackedBlocks) -> list[IntArray]:
    """Return the counts (n, n_axes) of several blocks, in one pass over all their bits.

    Raises
    ------
    ValueError
        If the axes of any do not hold n samples each; not found if no axis at all is used.
    """
    if not packed.used.any():
        shapes = zip(packed.n.tolist(), packed.n_axes.tolist(), strict=True)
        return [np.zeros((n_axes, n), np.int32).T for n, n_axes in shapes]
    axes = _Axes.of(packed)
    rest, window = _rest(packed.bits, axes), _windows(packed.bits, int(axes.n_low.max()))
    counts, kept = dict[int, IntArray](), _up_to_last_used(packed)
    n_kept = np.add.reduceat(kept, _before(packed.n_axes), dtype=np.intp)
    similar = np.frexp(packed.n)[1]  # blocks that differ by less than a factor of two are unpacked to one length
    of_axes = np.repeat(similar, packed.n_axes)
    for size in np.unique(similar).tolist():
        blocks = np.flatnonzero(similar == size)
        length = int(packed.n[blocks].max())
        chosen = np.flatnonzero(kept & (of_axes == size))
        table = np.zeros((len(chosen), length), np.int32)
        used, order = packed.used[chosen], axes.order[chosen]
        for each in np.unique(order[used]).tolist():
            place = np.flatnonzero(used & (order == each))
            table[place] = _samples(window, rest, axes, chosen[place], length).view(np.int32)
        edges = itertools.pairwise([0, *np.cumsum(n_kept[blocks]).tolist()])
        parts = zip(blocks.tolist(), packed.n[blocks].tolist(), edges, strict=True)
        counts |= {block: table[begin:end, :n].T for block, n, (begin, end) in parts}
    return [counts[block] for block in range(len(packed.bits))]


def _up_to_last_used(packed: PackedBlocks) -> BoolArray:
    """Return which axes of all blocks are not behind the last used one of their block; all axes of one without any."""
    edge = _before(packed.n_axes)
    number = np.arange(len(packed.order)) - np.repeat(edge, packed.n_axes)
    last = np.maximum.reduceat(np.where(packed.used, number, -1), edge)
    last = np.where(last < 0, packed.n_axes, last)
    return np.asarray(number <= np.repeat(last, packed.n_axes))


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
    def of(packed: PackedBlocks) -> "_Axes":
        """Return the places of all parts; ValueError if the parts of a block do not fit."""
        order, n_low, edge = packed.order, packed.n_low, _before(packed.n_axes)
        samples = np.repeat(packed.n, packed.n_axes)
        n_start = np.maximum(order, 1)
        expected = np.add.reduceat(n_start, edge)
        unlike = np.maximum.reduceat((n_low > _BITS) | (order > samples), edge) | (packed.n_start != expected)
        if unlike.any():
            wrong = int(np.argmax(unlike))
            raise ValueError(f"packed counts: expected {expected[wrong]} start values, found {packed.n_start[wrong]}")
        residuals = samples - order
        low, n_bits = residuals * n_low, np.array([8 * len(bits) for bits in packed.bits])
        high = np.add.reduceat(low, edge)
        if (high > n_bits).any():
            wrong = int(np.argmax(high > n_bits))
            raise ValueError(f"packed counts: expected {high[wrong]} low bits, found {n_bits[wrong]}")
        before = _before(low)
        return _Axes(
            order=order,
            n_low=n_low,
            samples=samples,
            start=packed.start.astype(np.int32).view(np.uint32),
            first_start=_before(n_start),
            first_low=before - np.repeat(before[edge] - _before(n_bits), packed.n_axes),
            first_rest=_before(residuals),
            high=high,
            n_residuals=np.add.reduceat(residuals, edge),
        )


def _before(lengths: IndexArray) -> IndexArray:
    """Return the sum of the lengths before each."""
    return np.cumsum(lengths) - lengths


def _rest(bits: Sequence[bytes], axes: _Axes) -> _Unsigned:
    """Return the upper parts of all residuals from the bits of the blocks, and as many zeros as the longest has."""
    first = axes.high // 8
    parts = [one[begin:] for one, begin in zip(bits, first.tolist(), strict=True)]
    unary = np.unpackbits(np.frombuffer(b"".join(parts), np.uint8))
    lengths = np.array([8 * len(part) for part in parts])
    begins, skipped = _before(lengths), axes.high % 8
    unary[(begins[:, None] + np.arange(8))[np.arange(8) < skipped[:, None]]] = 0  # last low bits in the same byte
    ends = np.flatnonzero(unary.view(np.bool_))
    edges = np.searchsorted(ends, np.append(begins, len(unary)))
    found = np.diff(edges)
    if (found != axes.n_residuals).any():
        wrong = int(np.argmax(found != axes.n_residuals))
        raise ValueError(f"packed counts: expected {axes.n_residuals[wrong]} residuals, found {found[wrong]}")
    rest = np.zeros(len(ends) + int(axes.samples.max()), np.uint32)
    own = rest[: len(ends)]
    own[:1] = ends[:1]
    np.subtract(ends[1:], ends[:-1], out=own[1:], casting="unsafe")
    own[1:] -= np.uint32(1)
    some = found > 0
    rest[edges[:-1][some]] = ends[edges[:-1][some]] - (begins + skipped)[some]
    return rest


def _windows(bits: Sequence[bytes], n_low: int) -> _Windows:
    """Return 32 bits, or 64 if more low bits need them, from each byte of all bits on."""
    size = 4 if n_low <= _NARROW else 8
    data = b"".join([*bits, bytes(8)])
    windows = np.ndarray((len(data) - 7,), f">u{size}", data, strides=(1,))
    return windows.astype(windows.dtype.newbyteorder("="))  # else each access would convert all


def _samples(window: _Windows, rest: _Unsigned, axes: _Axes, chosen: IndexArray, n: int) -> _Unsigned:
    """Return samples (n_chosen, n) of axes: residuals from both their parts, then summed as often as their order says.

    Behind the samples of an axis with fewer than n, anything follows.

    Parameters
    ----------
    window : bits from each byte on
    rest : upper parts
    axes : all
    chosen : (n_chosen,) numbers of axes of one order, with up to n samples
    n : largest number of samples
    """
    order, first = int(axes.order[chosen[0]]), axes.first_start[chosen]
    residuals = _residuals(window, rest, axes, chosen, n - order)
    if not order:
        residuals += axes.start[first][:, None]
        return residuals
    samples = np.empty((len(chosen), n), np.uint32)
    samples[:, order:] = residuals
    for k in range(order):
        samples[:, k] = axes.start[first + k]
    for k in range(order - 1, -1, -1):
        np.cumsum(samples[:, k:], axis=1, out=samples[:, k:], dtype=np.uint32)
    return samples


def _residuals(window: _Windows, rest: _Unsigned, axes: _Axes, chosen: IndexArray, n: int) -> _Unsigned:
    """Return n residuals (n_chosen, n) of axes of one order; else as for `_samples`."""
    kind = window.dtype
    n_low = axes.n_low[chosen][:, None]
    place = n_low * np.arange(n)
    place += axes.first_low[chosen][:, None]
    u: npt.NDArray[np.unsignedinteger[Any]] = window.take(place >> 3, mode="clip")  # beyond the bits of the last axis
    place &= 7
    u <<= place.astype(kind)
    u >>= (8 * kind.itemsize - n_low).astype(kind)  # nothing is left of none
    low = u.astype(np.uint32, copy=False)
    upper = sliding_window_view(rest, n)[axes.first_rest[chosen]] if n else low
    upper <<= n_low.astype(np.uint32)
    low |= upper
    np.negative(low & np.uint32(1), out=upper)  # all bits of a negative one
    low >>= np.uint32(1)
    low ^= upper
    return np.asarray(low)

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

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from operator import mul

import numpy as np
import numpy.typing as npt

from daq.types import IndexArray, IntArray

ORDERS = range(4)  #: orders of the differences tried
_BITS = 32
_NEAR = np.array([[-1], [0], [1]])
_Unsigned = npt.NDArray[np.uint32]
# of an axis: first low bit, low bits of each residual, first rest, first count, start values
_Axis = tuple[int, int, int, int, tuple[int, ...]]


@dataclass(frozen=True)
class Packed:
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
    parts = [_Layout.of(one, samples) for one, samples in zip(packed, n, strict=True)]
    rest, window = _rest(packed, parts), _windows(packed)
    first_bit = [0, *accumulate(8 * len(one.bits) for one in packed)]
    first_rest = [0, *accumulate(part.n_residuals for part in parts)]
    first_out = [0, *accumulate(samples * len(one.order) for one, samples in zip(packed, n, strict=True))]
    alike = defaultdict[tuple[int, int], list[_Axis]](list)  # axes of equal length and order
    for one, part, samples, bit, residual, out in zip(packed, parts, n, first_bit, first_rest, first_out, strict=False):
        for axis, order in enumerate(one.order):
            low, earlier, start = bit + part.low[axis], residual + part.rest[axis], part.start[axis]
            alike[samples, order].append((low, one.n_low[axis], earlier, out + axis * samples, start))
    counts = np.empty(first_out[-1], np.uint32)
    for (samples, order), axes in alike.items():
        low, n_low, earlier, out, start = zip(*axes, strict=True)
        every = np.arange(samples)
        residual = _joined(window, np.array(low), np.array(n_low), rest, np.array(earlier), every[order:])
        counts[np.array(out)[:, None] + every] = _summed(residual, order, np.array(start, np.int32).view(np.uint32))
    return [
        counts[start:stop].view(np.int32).reshape(len(one.order), samples).T
        for one, samples, start, stop in zip(packed, n, first_out[:-1], first_out[1:], strict=True)
    ]


@dataclass(frozen=True)
class _Layout:
    """Places of the parts of packed counts."""

    low: tuple[int, ...]  #: per axis: its first low bit
    high: int  #: first bit of the rests
    rest: tuple[int, ...]  #: per axis: its first residual
    n_residuals: int  #: of all axes
    start: tuple[tuple[int, ...], ...]  #: per axis

    @staticmethod
    def of(packed: Packed, n: int) -> "_Layout":
        """Return the layout of counts of n samples; ValueError if there is none."""
        order, n_low = packed.order, packed.n_low
        if not order or len(order) != len(n_low):
            raise ValueError(f"packed counts: expected axes, found {len(order)} orders, {len(n_low)} lengths")
        starts = [0, *accumulate(max(1, each) for each in order)]
        if max(n_low) > _BITS or max(order) > n or len(packed.start) != starts[-1]:
            raise ValueError(f"packed counts: expected {starts[-1]} start values, found {len(packed.start)}")
        n_residuals = [n - each for each in order]
        low = [0, *accumulate(map(mul, n_residuals, n_low))]
        rest = [0, *accumulate(n_residuals)]
        if low[-1] > 8 * len(packed.bits):
            raise ValueError(f"packed counts: expected {low[-1]} low bits, found {8 * len(packed.bits)}")
        start = tuple(packed.start[a:b] for a, b in pairwise(starts))
        return _Layout(tuple(low[:-1]), low[-1], tuple(rest[:-1]), rest[-1], start)


def _rest(packed: Sequence[Packed], parts: Sequence[_Layout]) -> _Unsigned:
    """Return the upper parts of all residuals from their bits."""
    high = [one.bits[part.high // 8 :] for one, part in zip(packed, parts, strict=True)]
    bits = np.unpackbits(np.frombuffer(b"".join(high), np.uint8))
    begins = [0, *accumulate(8 * len(each) for each in high)]
    starts = [begin + part.high % 8 for begin, part in zip(begins, parts, strict=False)]
    for begin, start in zip(begins, starts, strict=False):
        bits[begin:start] = 0  # last low bits in the same byte
    ends = np.flatnonzero(bits)
    edges = np.searchsorted(ends, begins)
    found, expected = np.diff(edges), [part.n_residuals for part in parts]
    if found.tolist() != expected:
        wrong = int(np.argmax(found != expected))
        raise ValueError(f"packed counts: expected {expected[wrong]} residuals, found {found[wrong]}")
    before = np.empty_like(ends)
    before[1:] = ends[:-1] + 1
    some = found > 0
    before[edges[:-1][some]] = np.array(starts)[some]
    return (ends - before).astype(np.uint32)


def _windows(packed: Sequence[Packed]) -> npt.NDArray[np.uint64]:
    """Return the 64 bits from each byte of all bits on, as a view."""
    data = b"".join([*(one.bits for one in packed), bytes(8)])
    return np.ndarray((len(data) - 7,), ">u8", data, strides=(1,))


def _joined(
    window: npt.NDArray[np.uint64],
    low: IndexArray,
    n_low: IndexArray,
    rest: _Unsigned,
    earlier: IndexArray,
    every: IndexArray,
) -> _Unsigned:
    """Return residuals (n_axes, n) from both their parts.

    Parameters
    ----------
    window : 64 bits from each byte on
    low, n_low : (n_axes,) place of the first low bit, number of low bits of each residual
    rest, earlier : upper parts, and the place of the first one (n_axes,)
    every : (n,) numbers of the samples
    """
    number = every - every[:1].sum()
    place = low[:, None] + n_low[:, None] * number
    n_bits = n_low[:, None].astype(np.uint64)
    shift = np.uint64(64) - n_bits - (place & 7).astype(np.uint64)
    mask = (np.uint64(1) << n_bits) - np.uint64(1)
    u = ((window[place >> 3].astype(np.uint64) >> np.minimum(shift, np.uint64(63))) & mask).astype(np.uint32)
    u |= rest[earlier[:, None] + number] << n_low[:, None].astype(np.uint32)
    return np.asarray((u >> np.uint32(1)) ^ (np.uint32(0) - (u & np.uint32(1))))


def _summed(residual: _Unsigned, order: int, start: _Unsigned) -> _Unsigned:
    """Return samples (n_axes, n) from their differences (n_axes, n - order), and the start values of each."""
    if order == 0:
        return np.asarray(residual + start)
    samples = np.empty((len(residual), order + residual.shape[1]), np.uint32)
    samples[:, order:] = residual
    for k in range(order - 1, -1, -1):
        samples[:, k] = start[:, k]
        np.cumsum(samples[:, k:], axis=1, out=samples[:, k:])
    return samples

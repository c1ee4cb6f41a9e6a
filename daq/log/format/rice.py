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

from dataclasses import dataclass
from operator import mul

import numpy as np
import numpy.typing as npt

from daq.types import IndexArray, IntArray

ORDERS = range(4)  #: orders of the differences tried
_BITS = 32
_SIZES = (1, 2, 4)  # bytes of an integer
_NEAR = np.array([[-1], [0], [1]])
_Unsigned = npt.NDArray[np.uint32]


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
    if not packed.order or len(packed.order) != len(packed.n_low):
        raise ValueError(f"packed counts: expected axes, found {len(packed.order)} orders, {len(packed.n_low)} lengths")
    n_start = [max(1, order) for order in packed.order]
    if max(packed.n_low) > _BITS or max(packed.order) > n or len(packed.start) != sum(n_start):
        raise ValueError(f"packed counts: expected {sum(n_start)} start values, found {len(packed.start)}")
    n_residuals = [n - order for order in packed.order]
    low = np.unpackbits(np.frombuffer(packed.bits, np.uint8))
    rest = _rest(low[sum(map(mul, n_residuals, packed.n_low)) :], sum(n_residuals))
    columns, start = [], iter(packed.start)
    for order, n_low, n_each in zip(packed.order, packed.n_low, n_residuals, strict=True):
        residual = _joined(low[: n_each * n_low], rest[:n_each], n_low)
        low, rest = low[n_each * n_low :], rest[n_each:]
        columns.append(_summed(residual, order, [next(start) for _ in range(max(1, order))]))
    return np.array(columns).T


def _rest(high: npt.NDArray[np.uint8], n: int) -> _Unsigned:
    """Return the upper part of residuals (n,) from their bits."""
    ends = np.flatnonzero(high)
    if len(ends) != n:
        raise ValueError(f"packed counts: expected {n} residuals, found {len(ends)}")
    rest = ends.astype(np.uint32)
    rest[1:] -= rest[:-1] + np.uint32(1)
    return rest


def _joined(low: npt.NDArray[np.uint8], rest: _Unsigned, n_low: int) -> _Unsigned:
    """Return residuals (n,) from both their parts; `low` has all bits of one after those of another."""
    size = next(size for size in _SIZES if 8 * size >= n_low)
    whole = np.zeros((len(rest), 8 * size), np.uint8)
    whole[:, 8 * size - n_low :] = low.reshape(len(rest), n_low)
    u = np.packbits(whole).view(f">u{size}").astype(np.uint32)
    u |= rest << np.uint32(n_low)
    return np.asarray((u >> np.uint32(1)) ^ (np.uint32(0) - (u & np.uint32(1))))


def _summed(residual: _Unsigned, order: int, start: list[int]) -> IntArray:
    """Return samples from their differences."""
    first = np.array(start, np.int32).view(np.uint32)
    if order == 0:
        return np.asarray((residual + first[0]).view(np.int32))
    samples = np.empty(order + len(residual), np.uint32)
    samples[order:] = residual
    for k in range(order - 1, -1, -1):
        samples[k] = first[k]
        np.cumsum(samples[k:], out=samples[k:])
    return samples.view(np.int32)

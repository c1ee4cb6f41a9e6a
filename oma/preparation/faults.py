"""Channel faults, detected in the signals alone: each by a property that no vibration has.

A structure does not stand still to the last digit, does not return to exactly the same extreme value again and again,
does not move one sensor for one sample while the others rest, does not move two sensors alike to a thousandth, and does
not drift away. Limits are arguments, not fits: the noise of an accelerometer alone makes two true neighbours differ by
more than a thousandth, and the highest value of a signal occurs once, or as often as the next lower value of its
converter.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy import fft

from daq import FloatArray
from oma.types import SAME_AS

BoolArray = npt.NDArray[np.bool_]

FaultKind = Literal["no_signal", "clipped", "wandering", "copy", "spikes", "gaps"]
_MIN_CLIPPED = 1e-3  # share of samples: fewer, as of one blow, move no mode
#: share of samples: clipping takes as large a share off a channel's gain, of which replacing the samples gives at least
#: three quarters back (tests/oma/preparation/test_faults.py); the rest is less than the 0.5 % to which gains are known
MAX_CLIPPED = 0.02
_PILE = 10.0  # how many times as many samples at a limit as next to it
_SAME = 1e-6  # 1 - correlation of successive differences
_SPIKE = 8.0  # of robust standard deviations: a Gaussian signal reaches it once in 1e15 samples
_AROUND, _FEW = 16, 0.9  # samples on each side that a spike towers over, but for a tenth of them ...
_LONE = 5.0  # ... by so much: 8 standard deviations of a Gaussian, too
_REACH = 2  # samples about a spike in which others may answer, and that are taken out with it
_COMPANY = 1 / 3  # share of the other channels that jump at the same time: a blow, no spike
MAX_SPIKES = 0.05  #: share of samples: a channel that loses more is given up [-]
_ROWS = 1 << 13  # samples of all channels at a time
_PIECE = 1 << 13  # samples of one channel at a time
_LOW, _MID, _HIGH = 10, 50, 100  # periods in the window: below _HIGH no mode is sought
_COARSE = 1 << 16  # blocks, at least: 400 times as many as lines that matter
_CLEARLY = 0.1  # weaker than the band above by more than the means of blocks can err
_ROBUST = 1.4826  # standard deviation of a Gaussian over its median absolute deviation


@dataclass(frozen=True, kw_only=True)
class ChannelFault:
    """Fault of one channel's samples.

    Only `no_signal` (constant, or no sample at all) is evidence of a dead sensor; the other kinds are of a sensor that
    measures.
    """

    kind: FaultKind
    text: str  #: description, with the share of samples concerned

    def __str__(self) -> str:
        return self.text


class Limits(NamedTuple):
    """Highest and lowest values of channels, (n_channels,) each; NaN and 0 for a channel without samples."""

    top: FloatArray
    bottom: FloatArray
    highest: FloatArray  #: shares of samples that are piled up at the highest value [-]
    lowest: FloatArray  #: the same of the lowest


def without_spikes(data: FloatArray, *, in_place: bool = False) -> tuple[FloatArray, FloatArray]:
    """Take out samples that stick out of their channel while the other channels rest, neighbours included.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing.
    in_place : bool
        Write into `data`, instead of a copy.

    Returns
    -------
    data : (n_samples, n_channels) array
        NaN where spikes were.
    taken : (n_channels,) array
        Share of the samples [-].
    """
    jumps = _jumps(data)
    if jumps is None:
        return data, np.zeros(data.shape[1])
    # rows about the jumps alone, with so many between those of two jumps that these do not reach each other
    rows = np.flatnonzero(_any_near(np.asarray(jumps.any(axis=1)), 2 * _REACH))
    jumps = jumps[rows]
    near = _any_near(jumps, _REACH)
    company = near.sum(axis=1, keepdims=True) - near
    alone = jumps & (company <= _COMPANY * (data.shape[1] - 1))
    out = _any_near(alone, _REACH) & np.isfinite(data[rows])
    result, (places, columns) = data if in_place else data.copy(), np.nonzero(out)
    result[rows[places], columns] = np.nan
    return result, np.asarray(out.sum(axis=0) / len(data))


def _any_near(flags: BoolArray, reach: int) -> BoolArray:
    """Return where a flag, or one of those up to `reach` before and behind it along the first axis, is true."""
    near = flags.copy()
    for k in range(1, reach + 1):
        near[k:] |= flags[:-k]
        near[:-k] |= flags[k:]
    return near


def _jumps(data: FloatArray) -> BoolArray | None:
    """Return which samples are far from the median of their neighbours, farther than all but a few around them.

    The latter sets spikes apart from bursts: after a blow to the structure a sensor rings on. None if there are none.
    """
    if len(data) <= 2 * _AROUND:
        return None
    jumps: BoolArray | None = None
    step, padded = np.empty(len(data)), np.empty(len(data) + 4)
    for column, signal in enumerate(data.T):
        padded[:2], padded[2:-2], padded[-2:] = signal[0], signal, signal[-1]
        least_far = _off_neighbours(padded, step) / (_SPIKE * _ROBUST)
        if 2 * np.count_nonzero(step > least_far) > np.count_nonzero(step):
            continue  # the median is larger than this: nothing is far, and the median need not be known
        positive = step[step > 0]
        usual = np.median(positive) if len(positive) else np.inf
        far = np.flatnonzero(step > _SPIKE * _ROBUST * usual)
        near = np.clip(far[:, None] + np.arange(-_AROUND, _AROUND + 1), 0, len(data) - 1)
        far = far[step[far] > _LONE * np.quantile(step[near], _FEW, axis=1)]
        if len(far):
            jumps = np.zeros(data.shape[::-1], dtype=np.bool_).T if jumps is None else jumps
            jumps[far, column] = True
    return jumps


def _off_neighbours(padded: FloatArray, out: FloatArray) -> float:
    """Write the distances (n_samples,) from the median of four neighbours, 0 where missing; return the largest.

    `padded` has two more samples at each end. Of four samples the middle two are the larger of the smaller ones of two
    pairs, and the smaller of the larger ones; pieces stay in the processor's cache.
    """
    most, scratch = 0.0, np.empty((3, _PIECE))
    for start in range(0, len(out), _PIECE):
        off = out[start : start + _PIECE]
        a, b, here, c, d = (padded[start + k : start + k + len(off)] for k in range(5))
        low, high, other = scratch[:, : len(off)]
        np.maximum(np.minimum(a, b, out=low), np.minimum(c, d, out=other), out=low)
        np.minimum(np.maximum(a, b, out=high), np.maximum(c, d, out=other), out=high)
        np.add(low, high, out=off)
        off *= 0.5
        np.abs(np.subtract(here, off, out=off), out=off)
        largest = float(off.max())
        if np.isnan(largest):  # missing samples are last
            rows = np.flatnonzero(np.isnan(off))
            around = np.sort([each[rows] for each in (a, b, c, d)], axis=0)
            exact = np.abs(here[rows] - (around[1] + around[2]) / 2)
            off[rows] = np.where(np.isfinite(exact), exact, 0.0)
            largest = float(off.max())
        most = max(most, largest)
    return most


def without_clipped(data: FloatArray, limits: Limits, *, in_place: bool = False) -> tuple[FloatArray, FloatArray]:
    """Remove the samples at the limits of channels that are clipped a little.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing.
    limits : of these data
    in_place : bool
        Write into `data`, instead of a copy.

    Returns
    -------
    data : (n_samples, n_channels) array
        NaN where samples were clipped.
    removed : (n_channels,) array
        Share of the samples [-]; 0 where too few or too many are clipped.
    """
    result, removed = data, np.zeros(data.shape[1])
    top, bottom, highest, lowest = limits
    for column in np.flatnonzero((highest + lowest > _MIN_CLIPPED) & (highest + lowest <= MAX_CLIPPED)).tolist():
        signal = data[:, column]
        out = (signal == top[column]) & (highest[column] > 0) | (signal == bottom[column]) & (lowest[column] > 0)
        result = data.copy() if result is data and not in_place else result
        result[out, column], removed[column] = np.nan, out.mean()
    return result, removed


def value_limits(data: FloatArray) -> Limits:
    """Return the limits of channels, (n_samples, n_channels), NaN where a sample is missing."""
    top, bottom = data.max(axis=0), data.min(axis=0)
    if np.isnan(top).any():
        top, bottom = np.fmax.reduce(data, axis=0), np.fmin.reduce(data, axis=0)
    shares = np.zeros((2, data.shape[1]))
    for share, limit, sign in zip(shares, (top, bottom), (1, -1), strict=True):
        n_there = np.array([np.count_nonzero(signal == value) for signal, value in zip(data.T, limit, strict=True)])
        piled = n_there > _PILE  # fewer may be next to it
        for column in np.flatnonzero(piled & (top > bottom)).tolist():
            signal = data[:, column]
            share[column] = _at_limit(sign * signal[np.isfinite(signal)])
    return Limits(top, bottom, shares[0], shares[1])


def signal_faults(data: FloatArray, names: Sequence[str], limits: Limits) -> Iterator[tuple[int, ChannelFault]]:
    """Yield the faults for which channels are left out: constant, clipped, wandering, the same as another.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing, spikes still in.
    names : sequence of str
        Of the channels.
    limits : of these data

    Yields
    ------
    column, fault
    """
    top, bottom, highest, lowest = limits
    for column, share in enumerate((highest + lowest).tolist()):
        if top[column] == bottom[column]:
            yield column, ChannelFault(kind="no_signal", text="constant")
        elif share > MAX_CLIPPED:
            text = f"clipped: {share:.1%} of the samples are at a limit"
            yield column, ChannelFault(kind="clipped", text=text)
        elif _wanders(data[:, column]):
            text = "wanders: as strong below 50 periods a window as in all of the band above 100"
            yield column, ChannelFault(kind="wandering", text=text)
    for column, other in _copies(data):
        yield column, ChannelFault(kind="copy", text=SAME_AS + names[other])


def _at_limit(signal: FloatArray) -> float:
    """Return the share of samples at the highest value if they pile up there, else 0."""
    highest = np.max(signal)
    n_highest = np.count_nonzero(signal == highest)
    n_next = np.count_nonzero(signal == np.max(signal[signal < highest]))
    return n_highest / len(signal) if n_highest > _PILE * n_next else 0.0


def _wanders(signal: FloatArray) -> bool:
    """Return whether a signal drifts away.

    A random walk has a spectrum that decreases with the square of frequency. If the power from 10 to 50 periods per
    window equals that above 100, its tail is an eighth of the latter: it may hide a mode there. Slower drift, as by
    temperature, is removed by the filter.
    """
    known = np.isfinite(signal)
    signal = np.ascontiguousarray(signal) if known.all() else signal[known]
    n = len(signal)
    if n < 4 * _HIGH:
        return False
    tapered = (signal - signal.mean()) * _hann(n)
    if not _may_wander(tapered):
        return False
    low, mid, high = _band_power(tapered)
    return bool(low > mid > high)


def _may_wander(tapered: FloatArray) -> bool:
    """Return False if the means of short blocks show that the band above 100 periods is the stronger one.

    Their transform is shorter than the signal's. Of B blocks, the means keep the lines up to k periods but for a share
    of (pi k / B)^2 / 3, and add to each less than k / B of the lines folded onto it.
    """
    size = len(tapered) // _COARSE
    if size < 2:
        return True
    n = len(tapered) // size * size  # the rest is at the end of the window
    means = tapered[:n].reshape(-1, size) @ np.full(size, 1 / size)
    _, mid, high = size**2 * np.array(_band_power(means))
    within = n / 2 * (tapered @ tapered - size * (means @ means))
    return bool(mid > _CLEARLY * (high + within))


def _band_power(tapered: FloatArray) -> tuple[float, float, float]:
    """Return the power below 10, from 10 to 50, and above 100 periods of a tapered signal."""
    parts = fft.rfft(tapered).view(np.float64)  # real and imaginary ones in turn
    low, mid, high = (part @ part for part in (parts[2 : 2 * _LOW], parts[2 * _LOW : 2 * _MID], parts[2 * _HIGH :]))
    return float(low), float(mid), float(high)


@lru_cache(maxsize=2)
def _hann(n: int) -> FloatArray:
    return np.hanning(n)


def _copies(data: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield channels with identical samples, and their copies: both, because the wrong one is unknown."""
    product = np.zeros((data.shape[1], data.shape[1]))
    for start in range(0, len(data) - 1, _ROWS):
        steps = np.diff(data[start : start + _ROWS + 1], axis=0)
        moved = steps.T @ steps
        if np.isnan(moved).any():
            steps = np.nan_to_num(steps, nan=0.0)
            moved = steps.T @ steps
        product += moved
    size = np.sqrt(np.diag(product))
    alive = np.flatnonzero(size > 0)
    same = 1 - np.abs(product[np.ix_(alive, alive)] / (size[alive, None] * size[alive])) < _SAME
    np.fill_diagonal(same, val=False)
    for one, other in zip(*np.nonzero(same), strict=True):
        yield int(alive[one]), int(alive[other])

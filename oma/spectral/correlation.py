"""Correlation functions as sums over blocks: additive, masked where samples are missing, fast by FFT."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import fft
from numpy.lib.stride_tricks import sliding_window_view

from daq import FloatArray, IndexArray
from oma.errors import IdentificationError
from oma.spectral.transforms import fast_length
from oma.types import ComplexArray

_PIECE = 3  # lag spans in a piece of one FFT: the overlap costs little, the transforms stay short
_AT_ONCE, _MIN_PIECES = 1 << 16, 16  # samples transformed at once (size of the cache); but not too few pieces


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrelationSums:
    """Sums and counts of lagged products, one set per block of time."""

    sums: Sequence[FloatArray]  #: a block: (n_lags, n_channels, n_references), y_i(t) y_j(t - lag) summed over its t
    counts: FloatArray  #: (n_blocks, n_lags): number of products in each sum [-]

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        if np.any(self.counts.sum(axis=0) < 1):
            raise IdentificationError("gaps leave no two complete samples some lag apart: the correlation is unknown")

    @property
    def mean(self) -> FloatArray:
        """Correlation function of the whole, (n_lags, n_channels, n_references)."""
        total = np.zeros_like(self.sums[0])
        for block in self.sums:
            total += block
        result: FloatArray = total / self.counts.sum(axis=0)[:, None, None]
        return result

    def influences(self) -> FloatArray:
        """Return the change of the mean by each block, (n_blocks, n_lags, n_channels, n_references), of sum zero."""
        moves = np.stack(self.sums)
        moves -= self.counts[:, :, None, None] * self.mean
        moves /= self.counts.sum(axis=0)[:, None, None]
        return np.asarray(moves)


class CorrelationAccumulator:
    """Correlation sums of a stream: blocks of any length are added at one end and dropped at the other.

    Memory does not grow with the length of a block. Where one channel is missing all are left out. Sums over different
    times for different pairs would use more of the data, but such sums are not the correlation of a linear system:
    a few per cent of scatter between the pairs hid weak modes (measured).

    Parameters
    ----------
    n_channels : int
    n_lags : int
        Lags 0 to ``n_lags - 1`` [samples].
    references : sequence of int, optional
        Channels with which all are correlated. Default: all.
    """

    def __init__(self, n_channels: int, n_lags: int, references: Sequence[int] | None = None) -> None:
        self._references = np.arange(n_channels) if references is None else np.array(references, dtype=np.intp)
        self._n_lags = n_lags
        self._before = np.zeros((n_lags - 1, n_channels))
        self._known_before = np.zeros((n_lags - 1, 1))
        self.blocks: deque[tuple[FloatArray, FloatArray]] = deque()  # sums and counts

    def add(self, data: FloatArray) -> None:
        """Add a block.

        Parameters
        ----------
        data : (n_samples, n_channels) array
            The zero-mean signals that follow those of the last block, NaN where a sample is missing.
        """
        known = np.asarray(np.isfinite(data).all(axis=1, keepdims=True))
        there = np.concatenate((self._known_before, known.astype(np.float64)))
        length = _length(len(data), self._n_lags)
        chunk = max(_AT_ONCE // (length * data.shape[1]), _MIN_PIECES) * (length - self._n_lags + 1)
        spectrum = np.zeros((length // 2 + 1, data.shape[1], len(self._references)), dtype=np.complex128)
        for start in range(0, len(data), chunk):
            part, whole = data[start : start + chunk], known[start : start + chunk]
            values = np.concatenate((self._before, part if whole.all() else np.where(whole, part, 0.0)))
            spectrum += _cross_spectra(values, length, self._n_lags, self._references)
            self._before = values[len(part) :].copy()  # a view would keep the chunk
        self.blocks.append((_lags(spectrum, length, self._n_lags), _lagged_counts(there, self._n_lags)))
        self._known_before = there[len(data) :].copy()

    def drop(self, n_blocks: int = 1) -> None:
        """Remove the oldest blocks."""
        for _ in range(n_blocks):
            self.blocks.popleft()

    @property
    def n_complete(self) -> int:
        """Number of samples that all channels have."""
        return int(sum(counts[0] for _, counts in self.blocks))

    @property
    def sums(self) -> CorrelationSums:
        """Sum of the blocks."""
        sums, counts = zip(*self.blocks, strict=True)
        return CorrelationSums(sums=sums, counts=np.array(counts))


def hankel(correlation: FloatArray, first_lag: int, block_rows: int) -> FloatArray:
    """Arrange correlations as a block Hankel matrix: block (i, j) is the lag ``first_lag + i + j``.

    Parameters
    ----------
    correlation : (n_lags, n_channels, n_references) array
    first_lag : int
        [samples].
    block_rows : int

    Returns
    -------
    (block_rows * n_channels, block_rows * n_references) array
    """
    used = correlation[first_lag : first_lag + 2 * block_rows - 1]
    windows = sliding_window_view(used, block_rows, axis=0)
    _, n_channels, n_references = correlation.shape
    return windows.transpose(0, 1, 3, 2).reshape(block_rows * n_channels, block_rows * n_references)


def covariance(correlation: FloatArray, block_rows: int) -> FloatArray:
    """Return the covariance of `block_rows` successive samples: block (i, j) is the lag ``i - j``.

    Parameters
    ----------
    correlation : (n_lags, n_channels, n_channels) array
        [(m/s2)^2].
    block_rows : int

    Returns
    -------
    (block_rows * n_channels, block_rows * n_channels) array
        [(m/s2)^2].
    """
    both = np.concatenate((correlation[block_rows - 1 : 0 : -1].transpose(0, 2, 1), correlation[:block_rows]))
    lag = np.arange(block_rows)
    size = block_rows * correlation.shape[1]
    result: FloatArray = both[lag[:, None] - lag + block_rows - 1].transpose(0, 2, 1, 3).reshape(size, size)
    return result


def _lagged_counts(there: FloatArray, n_lags: int) -> FloatArray:
    """Count the products at each lag."""
    first, lag = int(np.argmax(there)), np.arange(n_lags)
    if there[first:].all():  # nothing missing since the stream began
        return np.minimum(len(there) - n_lags + 1.0, np.maximum(len(there) - first - lag, 0.0))
    length = _length(len(there) - n_lags + 1, n_lags)
    spectrum = _cross_spectra(there, length, n_lags, np.array([0]))
    return np.asarray(_lags(spectrum, length, n_lags)[:, 0, 0].round())


def _length(n_samples: int, n_lags: int) -> int:
    """Return the length of a transform: a piece of a few lag spans, and the lag span before it."""
    return fast_length(max(min(_PIECE * n_lags, n_samples), 1) + n_lags - 1, real=True)


def _cross_spectra(values: FloatArray, length: int, n_lags: int, references: IndexArray) -> ComplexArray:
    """Add up the cross spectra of pieces with the same pieces and the preceding values, `length` samples in all.

    The first ``n_lags - 1`` values are only preceding ones.
    """
    piece = length - n_lags + 1
    n_pieces = max(-(-(len(values) - n_lags + 1) // piece), 1)
    short = n_pieces * piece + n_lags - 1 - len(values)
    whole = np.concatenate((values, np.zeros((short, values.shape[1])))) if short else values
    # (time, channel, piece)
    both = sliding_window_view(whole, length, axis=0)[::piece].transpose(2, 1, 0) if n_pieces > 1 else whole[..., None]
    now = fft.rfft(both[n_lags - 1 :], length, axis=0)
    every = np.array_equal(references, range(both.shape[1]))
    earlier = fft.rfft(both if every else both[:, references], length, axis=0)
    return np.asarray(np.matmul(now, np.conjugate(earlier, out=earlier).transpose(0, 2, 1)))


def _lags(spectrum: ComplexArray, length: int, n_lags: int) -> FloatArray:
    """Return sums at lags: a piece starts n_lags - 1 samples after its history, which is lag zero."""
    sums = fft.irfft(spectrum, length, axis=0)
    return np.concatenate((sums[length - n_lags + 1 :], sums[:1]))

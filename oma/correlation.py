"""Correlation functions as sums over blocks: additive, masked where samples are missing, fast by FFT."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import fft

from daq import FloatArray
from oma.errors import IdentificationError


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrelationSums:
    """Sums and counts of lagged products, one set a block of time."""

    sums: FloatArray  #: (n_blocks, n_lags, n_channels, n_channels): y_i(t + lag) y_j(t) summed over the t of the block
    counts: FloatArray  #: (n_blocks, n_lags, 1, 1): number of products in each sum [-]

    @property
    def mean(self) -> FloatArray:
        """Correlation function of the whole, (n_lags, n_channels, n_channels)."""
        result: FloatArray = self.sums.sum(axis=0) / self.counts.sum(axis=0)
        return result

    @property
    def influence(self) -> FloatArray:
        """What each block moves the mean by, (n_blocks, n_lags, n_channels, n_channels); the blocks sum to zero."""
        result: FloatArray = (self.sums - self.counts * self.mean) / self.counts.sum(axis=0)
        return result


def correlation_sums(data: FloatArray, n_lags: int, n_blocks: int) -> CorrelationSums:
    """Sum lagged products of all channel pairs, block by block.

    Where one channel is missing all are left out. Sums over different times for different pairs would use more of the
    data, but they see different amplitudes: a few per cent of scatter between the pairs, which no longer is the
    correlation of any linear system, hid weak modes (measured).

    Parameters
    ----------
    data : (n_samples, n_channels) array
        Zero-mean signals, NaN where a sample is missing.
    n_lags : int
        Lags 0 to ``n_lags - 1`` [samples].
    n_blocks : int

    Returns
    -------
    CorrelationSums

    Raises
    ------
    IdentificationError
        If no two complete samples lie a lag apart.
    """
    complete = np.isfinite(data).all(axis=1, keepdims=True)
    counts = _lagged_sums(np.asarray(complete, dtype=np.float64), n_lags, n_blocks).round()
    if np.any(counts.sum(axis=0) < 1):
        raise IdentificationError("gaps leave no two complete samples some lag apart: the correlation is unknown")
    return CorrelationSums(sums=_lagged_sums(np.where(complete, data, 0.0), n_lags, n_blocks), counts=counts)


def _lagged_sums(data: FloatArray, n_lags: int, n_blocks: int) -> FloatArray:
    """Sum products by FFT: each block in pieces of about three lag spans, added up as spectra."""
    n_samples, n_channels = data.shape
    block = -(-n_samples // n_blocks)
    n_pieces = max(block // (3 * n_lags), 1)
    piece = -(-block // n_pieces)
    length = fft.next_fast_len(piece + n_lags - 1, real=True)
    sums = np.empty((n_blocks, n_lags, n_channels, n_channels))
    for b in range(n_blocks):
        now, later = _pieces(data, b * block, min((b + 1) * block, n_samples), piece, n_pieces, n_lags)
        spectrum = np.matmul(fft.rfft(later, length, axis=0), fft.rfft(now, length, axis=0).conj().transpose(0, 2, 1))
        sums[b] = fft.irfft(spectrum, length, axis=0)[:n_lags]
    return sums


def _pieces(
    data: FloatArray, start: int, stop: int, piece: int, n_pieces: int, n_lags: int
) -> tuple[FloatArray, FloatArray]:
    """Cut a block into pieces, and the same pieces with the lags that follow: (time, channel, piece) each."""
    now = np.zeros((n_pieces * piece, data.shape[1]))
    now[: max(stop - start, 0)] = data[start:stop]
    later = np.zeros((n_pieces * piece + n_lags - 1, data.shape[1]))
    follows = data[start : start + len(later)]
    later[: len(follows)] = follows
    windows = sliding_window_view(later, piece + n_lags - 1, axis=0)[::piece]
    return now.reshape(n_pieces, piece, -1).transpose(1, 2, 0), windows.transpose(2, 1, 0)

"""Spectral matrices as sums over blocks: additive, masked where samples are missing, of bounded memory.

References
----------
Welch, P. D. (1967). The use of fast Fourier transform for the estimation of power spectra. IEEE Transactions on Audio
and Electroacoustics 15(2), 70-73.
Brincker, R., Zhang, L., Andersen, P. (2001). Modal identification of output-only systems using frequency domain
decomposition. Smart Materials and Structures 10(3), 441-445.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy import fft
from numpy.lib.stride_tricks import sliding_window_view

from daq import FloatArray, Recording
from oma.errors import IdentificationError, TooShort
from oma.preparation import detrended_pieces, usable
from oma.types import ComplexArray

PackedArray = npt.NDArray[np.complex64]

_AT_ONCE = 1 << 17  # samples transformed at once, which bounds the memory
_SEGMENTS_AT_ONCE = 24  # but not fewer segments, whose products are sums of as many terms
_LINES_AT_ONCE = 64


@dataclass(frozen=True, eq=False, kw_only=True)
class SpectralSums:
    """Sums of cross periodograms and of the windows' power, one set per block of time.

    The expectation of a sum is the Fourier transform of the correlation function times `windows`: a spectrum that is
    divided by ``windows[0]`` is a density, and a model that is to be compared with it can be given the same window
    exactly, gaps included.
    """

    rate: float  #: [Hz]
    n_fft: int  #: samples per segment
    first: int  #: number of the first line kept
    n_channels: int
    sums: Sequence[
        PackedArray
    ]  #: a block: (n_lines, n_channels (n_channels + 1) / 2), lower triangle of line(s) x line*
    windows: FloatArray  #: (n_blocks, n_fft): autocorrelation of the windows, from lag 0 on

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        if not self.windows[:, 0].sum() > 0:
            raise IdentificationError("gaps leave no complete sample: the spectrum is unknown")

    @property
    def frequency(self) -> FloatArray:
        """Frequencies of the lines, (n_lines,) [Hz]."""
        result: FloatArray = (self.first + np.arange(len(self.sums[0]))) * self.rate / self.n_fft
        return result

    @property
    def window(self) -> FloatArray:
        """Autocorrelation of all windows, (n_fft,), 1 at lag 0."""
        result: FloatArray = self.windows.sum(axis=0) / self.windows[:, 0].sum()
        return result

    def mean(self, lines: slice = slice(None)) -> ComplexArray:
        """Return the two-sided spectral density of some lines, (n_lines, n_channels, n_channels) [per Hz]."""
        total = np.zeros(self.sums[0][lines].shape, dtype=np.complex128)
        for block in self.sums:
            total += block[lines]
        return unpacked(total / (self.windows[:, 0].sum() * self.rate), self.n_channels)

    def influences(self, lines: slice = slice(None)) -> Iterator[ComplexArray]:
        """Yield the change of the mean by each block, (n_lines, n_channels, n_channels); the changes add up to zero."""
        mean, total = self.mean(lines), self.windows[:, 0].sum()
        for block, weight in zip(self.sums, self.windows[:, 0], strict=True):
            yield (
                unpacked(block[lines].astype(np.complex128) / (total * self.rate), self.n_channels)
                - weight / total * mean
            )


class SpectrumAccumulator:
    """Spectral sums of a stream: blocks of any length are added at one end and dropped at the other.

    Welch's method: Hann windows, half overlap. A segment belongs to the block that its last sample lies in. Where one
    channel is missing all are left out. Memory does not grow with the length of a block.

    Parameters
    ----------
    n_channels : int
    rate : float
        [Hz].
    n_fft : int
        Samples per segment.
    band : (float, float), optional
        Frequencies of the lines that are kept [Hz]. Default: all.
    single : bool, optional
        Transforms in single precision, twice as fast; 140 dB below the strongest line is rounding error.
    """

    def __init__(
        self,
        n_channels: int,
        rate: float,
        n_fft: int,
        band: tuple[float, float] | None = None,
        *,
        single: bool = False,
    ) -> None:
        lines = fft.rfftfreq(n_fft, 1 / rate)
        kept = np.flatnonzero((lines >= band[0]) & (lines <= band[1])) if band else np.arange(len(lines))
        self._lines = slice(int(kept[0]), int(kept[-1]) + 1)
        self.n_fft = n_fft
        self._rate, self._hop = rate, n_fft // 2
        taper = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_fft) / n_fft)
        self._whole = _autocorrelation(taper[None])[0]
        self._taper: npt.NDArray[np.floating[Any]] = taper.astype(np.float32 if single else np.float64)
        self.at_once = max(_AT_ONCE // n_channels, _SEGMENTS_AT_ONCE // 2 * n_fft)  #: samples transformed at once
        self._before = np.empty((n_channels, 0))
        self._shape = (self._lines.stop - self._lines.start, n_channels, n_channels)  # of a sum
        self._sums: deque[PackedArray] = deque()
        self._windows: deque[FloatArray] = deque()
        self._complete: deque[int] = deque()

    def add(self, data: FloatArray) -> None:
        """Add a block.

        Parameters
        ----------
        data : (n_samples, n_channels) array
            The zero-mean signals that follow those of the last block, NaN where a sample is missing.
        """
        self.add_pieces([data])

    def add_pieces(self, pieces: Iterable[FloatArray]) -> None:
        """Add a block that comes in pieces, each a multiple of `at_once` long but for the last one."""
        total, window, n_complete = np.zeros(self._shape, dtype=np.complex128), np.zeros(self.n_fft), 0
        for piece in pieces:
            more, more_window = self.total(piece)
            total += more
            window += more_window
            n_complete += int(np.count_nonzero(np.isfinite(piece).all(axis=1)))
        self._sums.append(packed(total))
        self._windows.append(window)
        self._complete.append(n_complete)

    def total(self, data: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return the sums of a block, (n_lines, n_channels, n_channels) and (n_fft,); they are not kept."""
        total, window = np.zeros(self._shape, dtype=np.complex128), np.zeros(self.n_fft)
        for start in range(0, len(data), self.at_once):
            values = np.concatenate((self._before, data[start : start + self.at_once].T), axis=1)
            n_segments = max(values.shape[1] - self.n_fft + self._hop, 0) // self._hop
            if n_segments:
                window += self._add_segments(values[:, : (n_segments - 1) * self._hop + self.n_fft], total)
            self._before = values[:, n_segments * self._hop :].copy()  # a view would keep the block
        return total, window

    def _add_segments(self, values: FloatArray, total: ComplexArray) -> FloatArray:
        """Add the spectra of whole segments of signals (n_channels, n) to `total`.

        Return the autocorrelation of their windows.
        """
        known = np.asarray(np.isfinite(values).all(axis=0))
        signals = (values if known.all() else np.where(known, values, 0.0)).astype(self._taper.dtype, copy=False)
        segments = sliding_window_view(signals, self.n_fft, axis=1)[:, :: self._hop] * self._taper
        lines = fft.rfft(segments, axis=-1)[:, :, self._lines].transpose(2, 0, 1)
        for start in range(0, len(lines), _LINES_AT_ONCE):
            some = np.ascontiguousarray(lines[start : start + _LINES_AT_ONCE])
            total[start : start + _LINES_AT_ONCE] += np.matmul(some, some.conj().transpose(0, 2, 1))
        if known.all():
            return np.asarray(segments.shape[1] * self._whole)
        there = sliding_window_view(known.astype(np.float64), self.n_fft)[:: self._hop] * self._taper
        return np.asarray(_autocorrelation(there).sum(axis=0))

    def drop(self, n_blocks: int = 1) -> None:
        """Remove the oldest blocks."""
        for _ in range(n_blocks):
            self._sums.popleft()
            self._windows.popleft()
            self._complete.popleft()

    @property
    def n_complete(self) -> int:
        """Number of samples in the blocks held that all channels have."""
        return sum(self._complete)

    @property
    def sums(self) -> SpectralSums:
        """Sum of the blocks."""
        return SpectralSums(
            rate=self._rate,
            n_fft=self.n_fft,
            first=self._lines.start,
            n_channels=len(self._before),
            sums=tuple(self._sums),
            windows=np.array(self._windows),
        )


def spectral_sums(
    data: FloatArray, rate: float, n_fft: int, n_blocks: int, band: tuple[float, float] | None = None
) -> SpectralSums:
    """Sum cross periodograms block by block.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        Zero-mean signals, NaN where a sample is missing.
    rate, n_fft, band : as for `SpectrumAccumulator`
    n_blocks : int

    Raises
    ------
    IdentificationError
        If no sample is complete.
    """
    accumulator = SpectrumAccumulator(data.shape[1], rate, n_fft, band)
    for block in np.array_split(data, n_blocks):
        accumulator.add(block)
    return accumulator.sums


def _autocorrelation(windows: FloatArray) -> FloatArray:
    """Return the autocorrelation of each window (n, n_fft) from lag 0 on."""
    n = windows.shape[-1]
    return np.asarray(fft.irfft(np.abs(fft.rfft(windows, 2 * n)) ** 2, 2 * n)[..., :n])


def packed(matrices: ComplexArray) -> PackedArray:
    """Return the lower triangles of Hermitian matrices (n_lines, n, n) in single precision."""
    rows, columns = np.tril_indices(matrices.shape[-1])
    result = np.empty((len(matrices), len(rows)), dtype=np.complex64)
    for start in range(0, len(matrices), _LINES_AT_ONCE):  # no second copy of all
        result[start : start + _LINES_AT_ONCE] = matrices[start : start + _LINES_AT_ONCE, rows, columns]
    return result


def unpacked(triangles: ComplexArray, n: int) -> ComplexArray:
    """Return the Hermitian matrices (..., n, n) of lower triangles (..., n (n + 1) / 2)."""
    rows, columns = np.tril_indices(n)
    result = np.empty((*triangles.shape[:-1], n, n), dtype=np.complex128)
    result[..., columns, rows] = triangles.conj()
    result[..., rows, columns] = triangles
    return result


def singular_values(recording: Recording, n_fft: int = 4096) -> tuple[FloatArray, FloatArray]:
    """Return the singular values of the one-sided spectral density matrix.

    Parameters
    ----------
    recording : Recording
    n_fft : int
        Samples per segment (Welch's method, Hann windows, half overlap).

    Returns
    -------
    frequency : (n_fft // 2 + 1,) array
        [Hz].
    values : (n_fft // 2 + 1, n_channels) array
        Of the usable channels, falling at each frequency [(m/s2)^2/Hz].

    Raises
    ------
    TooShort
        If the recording has fewer than `n_fft` samples.
    TooFewChannels
        If fewer than two channels carry a signal.
    """
    return singular_values_of_clean(usable(recording), n_fft)


def singular_values_of_clean(recording: Recording, n_fft: int = 4096) -> tuple[FloatArray, FloatArray]:
    """Return frequencies [Hz] and values [(m/s2)^2/Hz] of `singular_values` for a recording without a silent channel.

    Raises
    ------
    TooShort
        If the recording has fewer than `n_fft` samples.
    """
    data = recording.data
    if len(data) < n_fft:
        raise TooShort(recording.duration, n_fft / recording.rate)
    accumulator = SpectrumAccumulator(data.shape[1], recording.rate, n_fft)
    accumulator.add_pieces(detrended_pieces(data, accumulator.at_once))
    values = np.linalg.eigvalsh(_one_sided(accumulator.sums))[:, ::-1]
    return np.asarray(fft.rfftfreq(n_fft, 1 / recording.rate), np.float64), np.maximum(values, 0).astype(np.float64)


def spectral_matrix(data: FloatArray, rate: float, n_fft: int) -> ComplexArray:
    """Return the one-sided spectral density matrix (n_frequencies, n_channels, n_channels) [unit of the data^2/Hz].

    Parameters
    ----------
    data : (n_samples, n_channels), such as accelerations [m/s2]
    rate : samples per second [Hz]
    n_fft : samples of a segment (Welch's method, Hann windows, half overlap)
    """
    return _one_sided(spectral_sums(data, rate, n_fft, 1))


def _one_sided(sums: SpectralSums) -> ComplexArray:
    """Return the one-sided spectral density matrix of sums of all lines, (n_frequencies, n_channels, n_channels)."""
    density, n_fft = 2 * sums.mean(), sums.n_fft
    density[0] /= 2
    if n_fft % 2 == 0:
        density[-1] /= 2
    return density

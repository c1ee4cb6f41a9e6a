"""One stream at falling rates: each rate serves the upper part of its spectrum.

So a fixed number of lags always spans a few periods of the lowest mode in question; at one rate for all, the lags would
span too little of a low mode or cost too much.

A recording without visible filter slope is analysed up to 0.48 of its rate. A digital or analogue anti-alias filter
that cuts in earlier leaves a slope towards half the rate; poles fitted to a slope are no modes, and the band then ends
at 0.40 of the rate.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy import fft
from numpy.lib.stride_tricks import sliding_window_view

from daq import FloatArray
from oma.preparation.gaps import bridged

PASS = 0.40  #: upper end of the band kept at each lower rate, as a share of that rate [-]
ALIAS_FREE = 0.45  #: share of the rate up to which converters have no aliases of frequencies above half their rate [-]
TOP = 0.48  #: the same of the recording's own rate, unless an anti-alias filter shows (`usable_share`) [-]
HALF_LENGTH = 12  #: half length of the decimating filter [samples of the new rate]
NOISE_LAGS = 4  #: left out after decimation: 3 % of white sensor noise is left beyond; 24 cost close modes [samples]
OVERLAP = 0.9  #: a band begins at this share of the end of the next lower one [-]
_BETA = 7.5  # of the decimating filter's Kaiser window
_AT_ONCE = 16  # new samples of one product of matrices: the fewest operations that the processor does at full speed
_ROWS = 128  # of the matrix with the samples, per channel: it stays in the processor's cache
_MAX_EXPONENT = 200.0  # of the weights of the drift filter: far from overflow
_MAX_MISSING = 0.25  # share of the filter's absolute weight that may rest on missing samples
_N_FFT = 256  # samples per segment: lines at 0.004 of the rate
_MAX_SEGMENTS = 128  # spread evenly over the recording, so that long recordings cost no more
_MIN_SEGMENTS = 6
_REFERENCES = ((0.28, 0.34), (0.34, PASS))  # bands that the end is compared with, as shares of the rate [-]
_END = (0.45, 0.485)  # end of the spectrum [-]
_SLOPE_DB = 6.0  # fall of the spectrum's floor from the reference to the end that is taken for a filter [dB]


@dataclass(frozen=True, kw_only=True)
class Level:
    """One rate, and the band that is analysed at this rate."""

    rate: float  #: [Hz]
    band: tuple[float, float]  #: [Hz]
    noise_lags: int  #: lags up to this one hold white sensor noise, spread by the decimating filter


def levels(rate: float, band: tuple[float, float], factor: int) -> list[Level | None]:
    """Return the rates down to the one that holds the lower end of the band.

    Parameters
    ----------
    rate : float
        [Hz].
    band : (float, float)
        [Hz].
    factor : int
        Ratio of one rate to the next.

    Returns
    -------
    list of Level or None
        Of falling rate; None where the band has no part at that rate.
    """
    result: list[Level | None] = []
    noise_lags = 0
    while True:
        top = PASS if result else TOP  # the decimating filter is flat up to PASS of each lower rate
        low, high = max(band[0], PASS * OVERLAP * rate / factor), min(band[1], top * rate)
        result.append(Level(rate=rate, band=(low, high), noise_lags=noise_lags) if high > low else None)
        if low <= band[0]:
            return result
        rate, noise_lags = rate / factor, NOISE_LAGS


class Decimator:
    """Low-pass a stream and keep every `factor`-th sample.

    The filter is a Kaiser-windowed sinc: flat up to 0.40 of the new rate and 75 dB down from 0.60 on, so that not even
    the image of a sharp resonance folds into the band kept. Gaps are bridged by straight lines; a new sample is missing
    if too much of the filter's weight rests on such a line.

    Parameters
    ----------
    factor : int
    """

    def __init__(self, factor: int) -> None:
        self._factor = factor
        k = np.arange(-HALF_LENGTH * factor, HALF_LENGTH * factor + 1)
        taps = np.sinc(k / factor) * np.kaiser(len(k), _BETA)
        self._taps = np.asarray(taps / taps.sum())
        self._rest: FloatArray | None = None

    def add(self, data: FloatArray) -> FloatArray:
        """Take a block of any length, and return the new samples that it completes.

        Parameters
        ----------
        data : (n_samples, n_channels) array
            NaN where a sample is missing.

        Returns
        -------
        (about n_samples / factor, n_channels) array
        """
        buffer = data.T if self._rest is None else np.concatenate((self._rest, data.T), axis=1)
        n = max(-(-(buffer.shape[1] - len(self._taps) + 1) // self._factor), 0)
        self._rest = buffer[:, n * self._factor :].copy()
        return self._filtered(buffer, n).T if n else data[:0]

    def _filtered(self, buffer: FloatArray, n: int) -> FloatArray:
        """Return the first n new samples (n_channels, n) of a buffer (n_channels, n_samples)."""
        missing = np.isnan(buffer)
        if not missing.any():
            return _kept(buffer, self._taps, self._factor, n)
        smooth = _kept(bridged(buffer.T, missing.T).T, self._taps, self._factor, n)
        weight = np.abs(self._taps) / np.sum(np.abs(self._taps))
        smooth[_kept(missing.astype(np.float64), weight, self._factor, n) > _MAX_MISSING] = np.nan
        return smooth


def _kept(signals: FloatArray, taps: FloatArray, factor: int, n: int) -> FloatArray:
    """Return every `factor`-th of the filtered samples, (n_channels, n): products of matrices, some samples at once.

    Parameters
    ----------
    signals : (n_channels, n_samples) array
    taps : symmetric
    """
    bank = _bank(taps.tobytes(), factor)
    span = len(bank)
    n_rows, hop = -(-n // _AT_ONCE), _AT_ONCE * factor
    short = max((n_rows - 1) * hop + span - signals.shape[1], 0)
    whole = np.concatenate((signals, np.zeros((len(signals), short))), axis=1) if short else signals
    pieces = sliding_window_view(whole, span, axis=1)[:, ::hop]
    result = np.empty((len(signals), n_rows, _AT_ONCE))
    for start in range(0, n_rows, _ROWS):
        rows = np.ascontiguousarray(pieces[:, start : min(start + _ROWS, n_rows)])
        result[:, start : start + _ROWS] = rows @ bank
    return result.reshape(len(signals), -1)[:, :n]


@lru_cache(maxsize=8)
def _bank(taps: bytes, factor: int) -> FloatArray:
    """Return the matrix (n_samples, _AT_ONCE) from samples to every `factor`-th of the filtered ones."""
    weights = np.frombuffer(taps)
    bank = np.zeros(((_AT_ONCE - 1) * factor + len(weights), _AT_ONCE))
    for k in range(_AT_ONCE):
        bank[k * factor : k * factor + len(weights), k] = weights
    return bank


class HighPass:
    """Filter of first order that removes mean and drift of a stream, the same for all channels: no mode is shifted.

    Parameters
    ----------
    corner : float
        Frequency of half power, as a share of the rate [-].
    """

    def __init__(self, corner: float) -> None:
        self._pole = float(np.exp(-2 * np.pi * corner))
        self._gain = (1 + self._pole) / 2
        self._longest = max(int(-_MAX_EXPONENT / np.log(self._pole)), 1) if self._pole < 1 else 1 << 30
        self._state: FloatArray | None = None

    def add(self, data: FloatArray) -> FloatArray:
        """Return a block of any length, (n_samples, n_channels), NaN where a sample is missing, without drift."""
        missing = np.isnan(data)
        gaps = bool(missing.any())
        whole = (bridged(data, missing) if gaps else data).T
        result = np.empty(whole.shape)
        if self._state is None:
            self._state = -self._gain * whole.mean(axis=1)
        for start in range(0, whole.shape[1], self._longest):
            self._filter(whole[:, start : start + self._longest], result[:, start : start + self._longest])
        if gaps:
            result[missing.T] = np.nan
        return result.T

    def _filter(self, signals: FloatArray, out: FloatArray) -> None:
        """Filter signals (n_channels, n): the solution of the recursion, as a sum with growing weights."""
        assert self._state is not None
        rising, falling = _weights(self._pole, self._gain, signals.shape[1])
        np.subtract(signals[:, 1:], signals[:, :-1], out=out[:, 1:])
        out[:, 0] = signals[:, 0] + self._state / self._gain
        out *= rising
        np.cumsum(out, axis=1, out=out)
        out *= falling
        self._state = self._pole * out[:, -1] - self._gain * signals[:, -1]


@lru_cache(maxsize=4)
def _weights(pole: float, gain: float, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the weights (n,) of the differences of a signal, times the gain, and those of their sum."""
    falling = np.asarray(pole ** np.arange(n), np.float64)
    return gain / falling, falling


def usable_share(data: FloatArray) -> float:
    """Return the upper end of the usable band as a share of the rate.

    The floor of the spectrum (lower quartile over the lines, so that modes and tones do not count) between 0.45 and
    0.485 of the rate is compared with the lower one of those from 0.28 to 0.34 and from 0.34 to 0.40 (the flanks of
    a strong mode raise one of them), channel by channel; the median channel decides. A spectrum that falls as an
    integrated signal's does, 12 dB per octave, is not taken for filtered.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing; segments with missing samples are not used.

    Returns
    -------
    float
        `TOP` without a filter slope or if the recording is too short to show one, else `PASS`.
    """
    return PASS if _fall(data) > _SLOPE_DB else TOP


def _fall(data: FloatArray) -> float:
    """Return the drop of the floor at the end of the spectrum [dB], median of the channels."""
    power = _periodogram(data)
    if power is None:
        return 0.0
    lines = np.arange(len(power)) / _N_FFT
    *before, end = (
        10 * np.log10(np.quantile(power[(lines >= low) & (lines < high)], 0.25, axis=0) + np.finfo(float).tiny)
        for low, high in (*_REFERENCES, _END)
    )
    return float(np.median(np.min(before, axis=0) - end))


def _periodogram(data: FloatArray) -> FloatArray | None:
    """Return mean periodograms (n_lines, n_channels) of complete segments; None if there are too few."""
    n = len(data) // _N_FFT
    chosen = np.unique(np.linspace(0, n - 1, min(n, _MAX_SEGMENTS)).astype(int)) if n else np.empty(0, int)
    segments = data[: n * _N_FFT].T.reshape(-1, n, _N_FFT)[:, chosen]
    segments = segments[:, np.isfinite(segments).all(axis=(0, 2))]
    if segments.shape[1] < _MIN_SEGMENTS:
        return None
    segments -= segments.mean(axis=2, keepdims=True)
    segments *= _blackman_harris(_N_FFT)  # 92 dB down: low modes do not leak to the end
    lines = fft.rfft(segments, axis=2)
    return np.asarray(np.mean(lines.real**2 + lines.imag**2, axis=1).T)


def _blackman_harris(n: int) -> FloatArray:
    """Return the window of four terms (n,)."""
    turns = np.linspace(0, 2 * np.pi, n)
    return np.asarray(np.cos(np.arange(4)[:, None] * turns).T @ np.array([0.35875, -0.48829, 0.14128, -0.01168]))

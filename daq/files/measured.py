"""Contents of files of measurements: derivatives, high-pass filter and resampling of records without a pause."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.options import DataOptions
from daq.types import FloatArray, IndexArray, Recording, find_gaps

HALF_LENGTH = 32  #: samples at each end and around each gap that a derivative lacks
_BETA = 8.0  # of the Kaiser window


def differentiated(recording: Recording, channels: Collection[str]) -> Recording:
    """Return a recording with some channels replaced by their derivatives.

    The ideal differentiator, whose samples alternate as (-1)^n / n, truncated by a Kaiser window. It has linear phase,
    so that signals are not shifted in time. Its error is 1.2e-3 up to 0.45 of the rate, and 1e-4 from 0.05 of it on.

    Parameters
    ----------
    recording : Recording
        At least 65 samples.
    channels : names of those that hold velocities [m/s]

    Returns
    -------
    Recording
        All accelerations [m/s2]; NaN within 32 samples of the ends and of gaps of these channels.

    Raises
    ------
    ValueError
        If a channel does not exist or the recording is shorter than the filter.
    """
    names = [channel.name for channel in recording.channels]
    unknown = [name for name in channels if name not in names]
    if unknown:
        raise ValueError(f"channels: expected some of {', '.join(names)}, found {unknown[0]!r}")
    data = recording.data.copy()
    for name in channels:
        k = names.index(name)
        data[:, k] = derivative(recording.data[:, k], recording.rate)
    return replace(recording, data=data, gaps=find_gaps(recording.channels, data))


def derivative(column: FloatArray, rate: float) -> FloatArray:
    """Return the derivative of one signal (n_samples,) [1/s]; as `differentiated`."""
    taps = _taps() * rate
    if len(column) < len(taps):
        raise ValueError(f"recording: expected at least {len(taps)} samples to differentiate, found {len(column)}")
    missing = np.isnan(column)
    spoiled = np.convolve(missing, np.ones(len(taps)), "same") > 0.5
    spoiled[:HALF_LENGTH] = spoiled[-HALF_LENGTH:] = True
    return np.where(spoiled, np.nan, _convolved(np.where(missing, 0.0, column), taps))


def _convolved(column: FloatArray, taps: FloatArray) -> FloatArray:
    """Return a signal after a filter of odd length, moved nowhere (scipy.signal's way, without the 80 MB it takes)."""
    n = 1 << (len(column) + len(taps) - 1).bit_length()
    both = np.fft.irfft(np.fft.rfft(column, n) * np.fft.rfft(taps, n), n)
    half = len(taps) // 2
    return np.asarray(both[half : half + len(column)])


def _taps() -> FloatArray:
    """Return the filter for one sample a second."""
    n = np.arange(-HALF_LENGTH, HALF_LENGTH + 1)
    ideal = np.where(n == 0, 0.0, -((-1.0) ** n) / np.where(n == 0, 1, n))
    return np.asarray(-ideal * np.kaiser(len(n), _BETA))


_MIN_PERIODS = 2.0  # of the cut-off frequency in a stretch without gaps; shorter ones are left out
_ORDER = 4  # of the Butterworth filter, which is applied forwards and backwards
_MAX_RATIO = 1000  # numerator and denominator of a ratio of rates
_HALF_LENGTH = 10  # of the filter of scipy's resample_poly, in samples of the slower rate


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """Contents of a file of measurements."""

    recording: Recording  #: its temperature is the mean
    temperature: FloatArray  #: (n_samples,) mean of all columns of temperatures [degC], NaN where unknown
    remarks: tuple[str, ...]  #: interpretation of the names of columns
    dated: bool = False  #: whether the start time is in the file
    derivatives: tuple[int, ...] = ()  #: of each channel, still to be taken

    def only(self, places: Sequence[int]) -> "Measured":
        """Return some of the channels."""
        channels, data = tuple(self.recording.channels[k] for k in places), self.recording.data[:, list(places)]
        return replace(
            self,
            recording=replace(self.recording, channels=channels, data=data, gaps=find_gaps(channels, data)),
            derivatives=tuple(self.derivatives[k] for k in places) if self.derivatives else (),
        )


def processed(path: Path, run: Sequence[Measured], options: DataOptions) -> tuple[Measured, ...]:
    """Return parts that follow each other without a pause, as accelerations, filtered and resampled as requested.

    A derivative lacks both ends of a record, but not of each of its parts. Resampled parts become one.

    Raises
    ------
    DataError
        Naming `path`, if the record is shorter than the filter of a derivative.
    """
    first = run[0]
    if not (any(first.derivatives) or options.high_pass or options.resample):
        return tuple(run)
    data = np.concatenate([part.recording.data for part in run])
    rate = first.recording.rate
    for column, times in enumerate(first.derivatives):
        for _ in range(times):
            try:
                data[:, column] = derivative(data[:, column], rate)
            except ValueError as error:
                raise DataError(path, str(error)) from error
    if options.high_pass is not None:
        data = high_passed(data, rate, options.high_pass)
    if options.resample is not None:
        return (_resampled(run, data, options.resample),)
    ends = np.cumsum([len(part.recording.data) for part in run])
    return tuple(_with_data(part, piece) for part, piece in zip(run, np.split(data, ends[:-1]), strict=True))


def _with_data(part: Measured, data: FloatArray) -> Measured:
    recording = replace(part.recording, data=data, gaps=find_gaps(part.recording.channels, data))
    return replace(part, recording=recording, derivatives=())


def high_passed(data: FloatArray, rate: float, cutoff: float) -> FloatArray:
    """Return signals (n_samples, n_channels) after a high-pass filter without a phase shift.

    A Butterworth filter of order 4, forwards and backwards: -6 dB at the cut-off frequency. Stretches between gaps that
    are shorter than two periods of it are left out (NaN).

    Parameters
    ----------
    data : (n_samples, n_channels), NaN where missing
    rate : [Hz]
    cutoff : [Hz], less than half the rate
    """
    from scipy.signal import butter, sosfiltfilt

    sos = butter(_ORDER, cutoff, "highpass", fs=rate, output="sos")
    period = rate / cutoff
    result = np.full_like(data, np.nan)
    for column, out in zip(data.T, result.T, strict=True):
        for start, stop in _stretches(column):
            if stop - start >= max(_MIN_PERIODS * period, 2.0):
                pad = min(stop - start - 1, round(period))
                out[start:stop] = sosfiltfilt(sos, column[start:stop], padlen=pad)
    return result


def _stretches(column: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield the begin and end of each stretch without a missing sample."""
    edges = np.flatnonzero(np.diff(np.r_[False, np.isfinite(column), False].astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _resampled(run: Sequence[Measured], data: FloatArray, wanted: float) -> Measured:
    first = run[0]
    ratio = Fraction(wanted / first.recording.rate).limit_denominator(_MAX_RATIO)
    resampled = resample(data, ratio)
    at: IndexArray = np.minimum(np.arange(len(resampled)) * ratio.denominator // ratio.numerator, len(data) - 1)
    recording = replace(
        first.recording,
        data=resampled,
        rate=first.recording.rate * float(ratio),
        gaps=find_gaps(first.recording.channels, resampled),
    )
    temperature = np.concatenate([part.temperature for part in run])[at]
    return replace(first, recording=recording, temperature=temperature, derivatives=())


def resample(data: FloatArray, ratio: Fraction) -> FloatArray:
    """Return signals (n_samples, n_channels) at another rate, through an anti-alias filter of linear phase.

    Parameters
    ----------
    data : (n_samples, n_channels), NaN where missing
    ratio : new rate over that of `data`, at most 1

    Returns
    -------
    (n_resampled, n_channels)
        NaN where the filter lacks samples: about ten new ones at the ends and around gaps.
    """
    from scipy.signal import resample_poly

    up, down = ratio.numerator, ratio.denominator
    if up == down:
        return data
    columns = []
    for column in data.T:
        missing = np.isnan(column)
        mean = 0.0 if missing.all() else float(np.nanmean(column))
        filtered = resample_poly(np.where(missing, 0.0, column - mean), up, down) + mean
        gaps = np.concatenate([[0], np.cumsum(missing)])
        centre = np.arange(len(filtered)) * down / up
        half = _HALF_LENGTH * max(up, down) / up  # samples of `data`
        low = np.ceil(centre - half).astype(np.intp)
        high = np.floor(centre + half).astype(np.intp) + 1
        whole = (low >= 0) & (high <= len(column))
        low, high = np.clip(low, 0, len(column)), np.clip(high, 0, len(column))
        columns.append(np.where(whole & (gaps[high] == gaps[low]), filtered, np.nan))
    return np.column_stack(columns)

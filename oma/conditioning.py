"""From a recording to clean channels, and down a pyramid of rates."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import signal

from daq import FloatArray, Recording
from oma.errors import TooFewChannels

BoolArray = npt.NDArray[np.bool_]

PASS = 0.40  #: upper end of the band kept at each rate, as a share of that rate [-]
HALF_LENGTH = 12  #: of the decimating filter [samples of the new rate]
NOISE_LAGS = 4  #: left out after decimation: 3 % of white sensor noise is left beyond; 24 cost close modes [samples]
OVERLAP = 0.9  #: a band begins at this share of the end of the next lower one [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class Level:
    """The recording at one rate, and the band that is analysed at this rate."""

    data: FloatArray  #: (n_samples, n_channels), NaN where a gap is
    rate: float  #: [Hz]
    band: tuple[float, float]  #: [Hz]
    noise_lags: int  #: lags up to this one hold white sensor noise, spread by the decimating filter


def channel_faults(recording: Recording, min_complete: float = 0.5) -> dict[str, str]:
    """Name the channels that identification has to do without, and say why.

    Only samples that all channels have are analysed, so that the channels with most gaps are given up until enough
    of the recording is complete.

    Parameters
    ----------
    recording : Recording
    min_complete : float
        Smallest share of samples that the channels kept have in common [-].

    Returns
    -------
    dict
        Channel name to reason.
    """
    valid = np.isfinite(recording.data)
    faults = {}
    for channel, column, there in zip(recording.channels, recording.data.T, valid.T, strict=True):
        if np.any(there) and np.ptp(column[there]) == 0:
            faults[channel.name] = "constant"
    kept = [i for i, channel in enumerate(recording.channels) if channel.name not in faults]
    while kept and np.count_nonzero(valid[:, kept].all(axis=1)) < min_complete * len(valid):
        share = valid[:, kept].mean(axis=0)
        worst = kept.pop(int(np.argmin(share)))
        faults[recording.channels[worst].name] = f"{share.min():.0%} of the samples are there"
    return {c.name: faults[c.name] for c in recording.channels if c.name in faults}


def usable(recording: Recording) -> tuple[tuple[str, ...], FloatArray]:
    """Leave out the channels that carry no signal.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    names : tuple of str
    data : (n_samples, n_names) array

    Raises
    ------
    TooFewChannels
        If fewer than two are left.
    """
    faults = channel_faults(recording)
    names = tuple(c.name for c in recording.channels if c.name not in faults)
    if len(names) < 2:
        raise TooFewChannels(names, 2, faults)
    return names, recording.data[:, [c.name not in faults for c in recording.channels]]


def detrended(data: FloatArray) -> FloatArray:
    """Remove mean and slope of each channel, NaN left out.

    Parameters
    ----------
    data : (n_samples, n_channels) array

    Returns
    -------
    (n_samples, n_channels) array
    """
    result = np.where(np.isfinite(data), data, np.nan)
    time = np.linspace(-1.0, 1.0, len(data))
    for column in result.T:
        valid = np.isfinite(column)
        basis = np.column_stack((np.ones(valid.sum()), time[valid]))
        column[valid] -= basis @ np.linalg.lstsq(basis, column[valid], rcond=None)[0]
    return result


def decimated(data: FloatArray, factor: int, half_length: int = HALF_LENGTH, max_missing: float = 0.25) -> FloatArray:
    """Low-pass and keep every `factor`-th sample.

    The filter is a Kaiser-windowed sinc: flat up to 0.40 of the new rate and 75 dB down from 0.60 on, so that not even
    the image of a sharp resonance folds into the band kept. Gaps are bridged by straight lines; a new sample is missing
    if too much of its weight rests on such a line.

    Parameters
    ----------
    data : (n_samples, n_channels) array
        NaN where a sample is missing.
    factor : int
    half_length : int
        Of the filter, in samples of the new rate.
    max_missing : float
        Share of the filter's absolute weight that may be missing [-].

    Returns
    -------
    (about n_samples / factor, n_channels) array
    """
    taps = signal.firwin(2 * half_length * factor + 1, 1.0 / factor, window=("kaiser", 7.5))
    weight = np.abs(taps) / np.sum(np.abs(taps))
    missing = np.isnan(data)
    smooth = signal.upfirdn(taps, bridged(data, missing), down=factor, axis=0)
    if missing.any():
        smooth[signal.upfirdn(weight, missing.astype(np.float64), down=factor, axis=0) > max_missing] = np.nan
    result: FloatArray = smooth[2 * half_length : len(smooth) - 2 * half_length]
    return result


def bridged(data: FloatArray, missing: BoolArray) -> FloatArray:
    """Fill gaps with straight lines."""
    result = data.copy()
    time = np.arange(len(data))
    for column, gap in zip(result.T, missing.T, strict=True):
        if gap.any():
            column[gap] = np.interp(time[gap], time[~gap], column[~gap]) if not gap.all() else 0.0
    return result


def pyramid(data: FloatArray, rate: float, band: tuple[float, float], factor: int) -> Iterator[Level]:
    """Yield the data at falling rates until the lower end of the band is reached.

    At each rate only the upper part of the spectrum is analysed, so that a fixed number of lags always spans a few
    periods of the lowest mode in question; at one rate for all, the lags would span too little of a low mode or cost
    too much.

    Parameters
    ----------
    data : (n_samples, n_channels) array
    rate : float
        [Hz].
    band : (float, float)
        [Hz].
    factor : int
        Ratio of one rate to the next.

    Yields
    ------
    Level
    """
    noise_lags, low, high = 0, max(band[0], PASS * OVERLAP * rate / factor), min(band[1], PASS * rate)
    while True:
        if high > low:
            yield Level(data=data, rate=rate, band=(low, high), noise_lags=noise_lags)
        if low <= band[0]:
            return
        data, rate, noise_lags = decimated(data, factor), rate / factor, NOISE_LAGS
        low, high = max(band[0], PASS * OVERLAP * rate / factor), min(band[1], PASS * rate)

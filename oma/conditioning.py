"""From a recording to clean channels, and down a pyramid of rates."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import signal

from daq import FloatArray, Recording
from oma.errors import TooFewChannels

BoolArray = npt.NDArray[np.bool_]

PASS = 0.42  #: upper end of the band kept at each rate, as a share of that rate [-]
OVERLAP = 0.9  #: a band begins at this share of the end of the next lower one [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class Level:
    """The recording at one rate, and the band that is analysed at this rate."""

    data: FloatArray  #: (n_samples, n_channels), NaN where a gap is
    rate: float  #: [Hz]
    band: tuple[float, float]  #: [Hz]
    noise_lags: int  #: lags up to this one hold white sensor noise, spread by the decimating filter [samples]


def channel_faults(recording: Recording, min_valid: float = 0.25) -> dict[str, str]:
    """Name the channels that carry no signal, and say why.

    Parameters
    ----------
    recording : Recording
    min_valid : float
        Smallest share of samples that must be there [-].

    Returns
    -------
    dict
        Channel name to reason.
    """
    faults = {}
    for channel, column in zip(recording.channels, recording.data.T, strict=True):
        finite = column[np.isfinite(column)]
        if len(finite) < max(min_valid * len(column), 2):
            faults[channel.name] = f"{len(finite) / max(len(column), 1):.0%} of the samples are there"
        elif np.ptp(finite) == 0:
            faults[channel.name] = "constant"
    return faults


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


def decimated(data: FloatArray, factor: int, half_length: int = 8) -> FloatArray:
    """Low-pass and keep every `factor`-th sample; what a gap touches becomes NaN.

    The filter is a Kaiser-windowed sinc: flat up to 0.42 of the new rate, 60 dB down from 0.58 on, so that nothing
    folds into the band kept.

    Parameters
    ----------
    data : (n_samples, n_channels) array
    factor : int
    half_length : int
        Of the filter, in samples of the new rate.

    Returns
    -------
    (about n_samples / factor, n_channels) array
    """
    taps = signal.firwin(2 * half_length * factor + 1, 1.0 / factor, window=("kaiser", 5.65))
    skip = half_length
    valid = np.isfinite(data)
    smooth = signal.upfirdn(taps, np.where(valid, data, 0.0), down=factor, axis=0)
    touched = signal.upfirdn(np.ones_like(taps), (~valid).astype(np.float64), down=factor, axis=0) > 0.5
    smooth[touched] = np.nan
    result: FloatArray = smooth[2 * skip : len(smooth) - 2 * skip]
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
    half_length = 8
    noise_lags, low, high = 0, max(band[0], PASS * OVERLAP * rate / factor), min(band[1], PASS * rate)
    while True:
        if high > low:
            yield Level(data=data, rate=rate, band=(low, high), noise_lags=noise_lags)
        if low <= band[0]:
            return
        data, rate, noise_lags = decimated(data, factor, half_length), rate / factor, 2 * half_length
        low, high = max(band[0], PASS * OVERLAP * rate / factor), min(band[1], PASS * rate)

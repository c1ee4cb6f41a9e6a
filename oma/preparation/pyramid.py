"""One stream at falling rates: each rate serves the upper part of its spectrum.

So a fixed number of lags always spans a few periods of the lowest mode in question; at one rate for all, the lags would
span too little of a low mode or cost too much.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from daq import FloatArray
from oma.preparation.gaps import bridged

PASS = 0.40  #: upper end of the band kept at each lower rate, as a share of that rate [-]
ALIAS_FREE = 0.45  #: share of the rate up to which converters have no aliases of frequencies above half their rate [-]
TOP = 0.48  #: the same of the recording's own rate, unless an anti-alias filter shows (`oma.preparation.bandwidth`) [-]
HALF_LENGTH = 12  #: half length of the decimating filter [samples of the new rate]
NOISE_LAGS = 4  #: left out after decimation: 3 % of white sensor noise is left beyond; 24 cost close modes [samples]
OVERLAP = 0.9  #: a band begins at this share of the end of the next lower one [-]
_MAX_MISSING = 0.25  # share of the filter's absolute weight that may rest on missing samples


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
        self._taps = signal.firwin(2 * HALF_LENGTH * factor + 1, 1.0 / factor, window=("kaiser", 7.5))
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
        buffer = data if self._rest is None else np.concatenate((self._rest, data))
        n = max(-(-(len(buffer) - len(self._taps) + 1) // self._factor), 0)
        self._rest = buffer[n * self._factor :].copy()
        return self._filtered(buffer)[2 * HALF_LENGTH : 2 * HALF_LENGTH + n] if n else buffer[:0]

    def _filtered(self, buffer: FloatArray) -> FloatArray:
        missing = np.isnan(buffer)
        if not missing.any():
            return np.asarray(signal.upfirdn(self._taps, buffer, down=self._factor, axis=0))
        smooth = np.asarray(signal.upfirdn(self._taps, bridged(buffer, missing), down=self._factor, axis=0))
        weight = np.abs(self._taps) / np.sum(np.abs(self._taps))
        share = signal.upfirdn(weight, missing.astype(np.float64), down=self._factor, axis=0)
        smooth[share > _MAX_MISSING] = np.nan
        return smooth


class HighPass:
    """Take mean and drift out of a stream: first order, the same for all channels, so that no mode moves.

    Parameters
    ----------
    corner : float
        Frequency of half power, as a share of the rate [-].
    """

    def __init__(self, corner: float) -> None:
        pole = np.exp(-2 * np.pi * corner)
        self._numerator, self._denominator = np.array([1.0, -1.0]) * (1 + pole) / 2, np.array([1.0, -pole])
        self._state: FloatArray | None = None

    def add(self, data: FloatArray) -> FloatArray:
        """Return a block of any length, (n_samples, n_channels), NaN where a sample is missing, without drift."""
        missing = np.isnan(data)
        gaps = bool(missing.any())
        whole = bridged(data, missing) if gaps else data
        if self._state is None:
            self._state = -self._numerator[0] * whole.mean(axis=0, keepdims=True)
        result, self._state = signal.lfilter(self._numerator, self._denominator, whole, axis=0, zi=self._state)
        if gaps:
            result[missing] = np.nan
        return np.asarray(result)

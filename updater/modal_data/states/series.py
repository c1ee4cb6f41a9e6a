"""Log frequencies of successive windows, with the deviations that errors, temperature and amplitude give them."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray
from updater.modal_data.tracked import COMMON_STD, TrackedModes

_WILD = 4.5  # standard deviations from the running median beyond which a single value is an error of identification
_STATED_WORTH = 8.0  # degrees of freedom that the stated deviations are worth
_EFFICIENCY = 0.37  # degrees of freedom per difference, of a deviation taken from the median of differences
_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable
_SLOPE_STD, _OWN_SLOPE_STD = 1e-3, 3e-4  # 1/K of ln f, common to all modes and of each: bridges on bearings have 2e-3
_UNMEASURED_STD = 3e-4  # of ln f: sun, moisture and load where temperature is measured
_SOFTENING_STD = 0.03  # of ln f over the rms to its mean: buildings in earthquakes
_SMOOTH_SECONDS = 6 * 3600.0  # time constant of a temperature that is not measured


@dataclass(frozen=True, eq=False, kw_only=True)
class WindowSeries:
    """Windows, or means of as many successive ones each, in units of a window's error."""

    y: FloatArray  #: (n, p) log frequencies about their mean
    noise: FloatArray  #: (p,) standard deviation of a window's log frequency
    error: float  #: variance of the error, below one where windows are averaged
    seconds: FloatArray  #: (n,) [s]
    temperature: FloatArray  #: (n,) [degC], NaN where not known
    rms: FloatArray  #: (n,) [m/s2], likewise
    freedom: float  #: degrees of freedom of `noise`, pooled

    @classmethod
    def of(
        cls,
        modes: TrackedModes,
        seconds: FloatArray,
        temperature: FloatArray,
        rms: FloatArray,
        groups: list[IndexArray],
    ) -> Self:
        """Return the series of tracked modes, averaged over groups of windows.

        Parameters
        ----------
        modes : (n_windows, n_tracks), each of them seen in some window
        seconds, temperature, rms : (n_windows,) [s], [degC], [m/s2]
        groups : indices of the windows of each
        """
        cleaned, noise, freedom = _cleaned(
            modes.log_frequency, np.sqrt(np.nanmedian(modes.log_frequency_std**2, axis=0))
        )
        mean = [
            np.array([values[group].mean(0) for group in groups]) for values in (cleaned, seconds, temperature, rms)
        ]
        return cls(
            y=(mean[0] - mean[0].mean(0)) / noise,
            noise=noise,
            error=len(groups) / len(seconds),
            seconds=mean[1],
            temperature=mean[2],
            rms=mean[3],
            freedom=freedom,
        )

    def without(self, mode: int) -> Self:
        """Return the series of the other modes."""
        return replace(
            self,
            y=np.delete(self.y, mode, axis=1),
            noise=np.delete(self.noise, mode),
            freedom=self.freedom * (1 - 1 / len(self.noise)),
        )

    def chance(self, ratio: float) -> float:
        """Return the probability of so large a sum over the modes of twice the log likelihood ratio."""
        p = self.y.shape[1]
        return float(scipy.special.fdtrc(p, self.freedom, ratio / p))

    def environment(self, axis: FloatArray) -> FloatArray:
        """Return the prior covariance (n, n) of temperature and weather along a unit vector (p,)."""
        relative = axis / self.noise
        common, own = relative.sum() ** 2, (relative**2).sum()
        lag = np.sqrt(3) * np.abs(np.subtract.outer(self.seconds, self.seconds)) / _SMOOTH_SECONDS
        smooth = (1 + lag) * np.exp(-lag)  # once differentiable
        if np.isfinite(self.temperature).all():
            warmer = self.temperature - self.temperature.mean()
            slope = _SLOPE_STD**2 * common + _OWN_SLOPE_STD**2 * own
            weather = slope * np.outer(warmer, warmer) + _UNMEASURED_STD**2 * (common + own) * smooth
        else:
            weather = COMMON_STD**2 * (common + own / 9) * smooth
        if np.isfinite(self.rms).all() and self.rms.all():
            louder = self.rms / self.rms.mean() - 1
            weather += _SOFTENING_STD**2 * own * np.outer(louder, louder)
        return np.asarray(weather)


def _cleaned(value: FloatArray, stated: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return values (n, p) without gaps and single errors, the deviation of each mode (p,), its degrees of freedom.

    Deviations are estimated from successive differences, which hardly contain a step, and shrunk towards the stated
    ones.
    """
    n, p = value.shape
    window = np.arange(n)
    seen = np.isfinite(value)
    filled = np.column_stack([np.interp(window, window[s], v[s]) for v, s in zip(value.T, seen.T, strict=True)])
    differences = np.median(np.abs(np.diff(filled, axis=0)), axis=0) / (_NORMAL_MEDIAN * 2**0.5)
    worth = _EFFICIENCY * (n - 1)
    usual = np.median(differences / stated) * stated
    noise = np.sqrt((_STATED_WORTH * usual**2 + worth * differences**2) / (_STATED_WORTH + worth))
    padded = np.pad(filled, ((2, 2), (0, 0)), mode="edge")
    median = np.median([padded[k : k + n] for k in range(5)], axis=0)
    wild = np.abs(filled - median) > _WILD * noise
    return np.where(wild, median, filled), noise, _STATED_WORTH + worth * p

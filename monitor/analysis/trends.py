"""Dependence of frequencies on temperature and on vibration amplitude, from window to window."""

import numpy as np

from daq import FloatArray
from monitor.analysis.observation import Observation
from monitor.results.comparison import FrequencyTrend
from updater import TrackedModes

_MIN_WINDOWS = 4
_MIN_KELVIN = 1.0  # between the coldest and the warmest window
_MIN_SPREAD = 0.1  # of amplitudes, standard deviation over mean


def trends_beside(observation: Observation) -> tuple[FrequencyTrend, ...]:
    """Return one straight line per mode over temperature and over amplitude; none over hardly varying ones.

    A line's deviation is that of the windows' stated ones, or of their scatter about it where that is larger.
    """
    modes, temperature, rms = observation.modes, observation.temperature, observation.rms
    found: list[FrequencyTrend] = []
    if np.isfinite(temperature).sum() >= _MIN_WINDOWS and np.nanmax(temperature) - np.nanmin(temperature) > _MIN_KELVIN:
        found += _lines(modes, temperature, "temperature", "K")
    if len(rms) >= _MIN_WINDOWS and np.std(rms) > _MIN_SPREAD * np.mean(rms):
        large = float(rms.max()) >= 0.1
        found += _lines(modes, rms if large else 1000 * rms, "amplitude", "m/s²" if large else "mm/s²")
    return tuple(found)


def _lines(modes: TrackedModes, at: FloatArray, over: str, unit: str) -> list[FrequencyTrend]:
    lines = []
    for track in range(modes.log_frequency.shape[1]):
        known = np.isfinite(modes.log_frequency[:, track]) & np.isfinite(at)
        if known.sum() >= _MIN_WINDOWS:
            values, std = modes.log_frequency[known, track], modes.log_frequency_std[known, track]
            lines.append(_line(values, std, at[known], over, unit))
    return lines


def _line(value: FloatArray, std: FloatArray, at: FloatArray, over: str, unit: str) -> FrequencyTrend:
    """Return the weighted least-squares line through log frequencies (n,) over their circumstance (n,)."""
    weight = std**-2 / (std**-2).sum()
    off, change = at - weight @ at, value - weight @ value
    inertia = float(weight @ off**2)
    slope = float(weight @ (off * change)) / inertia
    scatter = max(1.0, float((((change - slope * off) / std) ** 2).sum()) / (len(at) - 2)) ** 0.5
    return FrequencyTrend(
        mode=float(np.exp(weight @ value)),
        over=over,
        unit=unit,
        at=tuple(at.tolist()),
        change_percent=tuple((100 * change).tolist()),
        std_percent=tuple((100 * std).tolist()),
        slope=100 * slope,
        slope_std=100 * scatter / float(np.sqrt((std**-2).sum() * inertia)),
    )

"""Effect of temperature on natural frequencies: a linear law in the air temperature, its past, and hinges.

References
----------
Peeters, B., De Roeck, G. (2001). One-year monitoring of the Z24-bridge: environmental effects versus damage events.
Earthquake Engineering and Structural Dynamics 30, 149-171: frequencies follow the temperature of hours ago, and their
slope changes where asphalt and ground freeze.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq import FloatArray

_INERTIA = np.array([1.0, 2.5, 6.0, 15.0, 36.0]) * 3600  # s, with which a structure may follow the air ...
_REGRESSED = slice(None, None, 2)  # ... and those of these in the law
_N_MEMORIES = len(_INERTIA[_REGRESSED])
_FREEZING = np.array([-5.0, -2.5, 0.0, 2.0])  # degC, at which the slope may change much ...
_FREEZING_LATE = np.array([-5.0, 0.0])  # ... and those of them in the longer memories
KNOTS = np.union1d(np.arange(-20.0, 36.0, 5.0), _FREEZING)  #: temperatures at which the slope may change [degC]
_MIDDLE = 15.0  # degC, where the law is centred
_CONSTANT = 100.0  # standard deviations of a window: nothing is known of the constant before the baseline
_SLOPE, _OWN_SLOPE = 1e-3, 3e-4  # 1/K, of all modes together and of each: steel has -2e-4, concrete -2e-4 to -4e-4,
# bridges on bearings, arches and whatever is held at both ends up to -2e-3, each mode another
_KINK, _OWN_KINK = 5e-5, 2e-5  # 1/K, changes of slope at a knot ...
_ICE, _OWN_ICE = 6e-3, 3e-3  # 1/K, ... and where it freezes: the Z24 bridge's modes had up to -1e-2, each another
_N_LATE = (_N_MEMORIES - 1) * len(_FREEZING_LATE)
N_TERMS = 2 + _N_MEMORIES + len(KNOTS) + _N_LATE
_OF_FROST = np.concatenate([np.zeros(1 + _N_MEMORIES), np.isin(KNOTS, _FREEZING), np.ones(_N_LATE)])
THERMOMETER_STD = 1.0  #: deviation of the devices' temperature from the structure's, before any is measured [K]
_RATE, _SWING = 1 / 3600, 4.0  # K/s, K: rms rate and distance from the mean of days, before any is measured ...
_CLIMATE_WORTH = 86400.0  # s of readings that this is worth
_FRONT = 3.0  # K per day by which weather varies in addition to the daily cycle


@dataclass(frozen=True, eq=False, kw_only=True)
class Climate:
    """Temperatures up to the last reading, and how fast and how far the site's temperature moves."""

    air: FloatArray  #: (...,) last reading [degC], NaN if there was none
    silent: FloatArray  #: (...,) time since that reading [s]
    lagged: FloatArray  #: (..., 5) temperatures of structures of five inertias at that reading [degC]
    lagged_std: FloatArray  #: (..., 5) their standard deviations due to gaps between readings [K]
    observed: FloatArray  #: (...,) time that the two means below are taken over [s]
    squared_rate: FloatArray  #: (...,) mean squared rate of change over an hour [K2/s2]
    squared_swing: FloatArray  #: (...,) mean squared distance from the temperature of the last days [K2]

    def change_std(self, seconds: FloatArray) -> FloatArray:
        """Return the standard deviation of the change of the air's temperature within a time [K].

        It grows in proportion to time at first, is bounded by a day's cycle, and wanders with the weather beyond.
        """
        straight = self.squared_rate * seconds**2
        bounded = straight / (1 + straight / (4 * self.squared_swing))
        return np.asarray(np.sqrt(bounded + _FRONT**2 * seconds / 86400))

    def chord_std(self, seconds: FloatArray) -> FloatArray:
        """Return the standard deviation of the mean temperature between two readings about their straight line [K].

        The chord of a curve of rate r and curvature r omega (omega: of a day) is off by r omega t^2 / 12 in the mean.
        """
        curved = self.squared_rate * (2 * np.pi / 86400 * seconds**2 / 12) ** 2
        return np.asarray(np.sqrt(curved / (1 + curved / self.squared_swing)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Temperatures:
    """Temperatures by which windows are judged; leading dimensions (..., n_windows)."""

    air: FloatArray  #: reading, or the last one before [degC]; NaN if there was none
    air_std: FloatArray  #: deviation of the last reading as the present temperature [K]; zero with a reading
    lagged: FloatArray  #: (..., 5) temperatures of structures of five inertias [degC]
    lagged_std: FloatArray  #: (..., 5) [K]

    @property
    def carried(self) -> npt.NDArray[np.bool_]:
        """Return where missing readings make temperatures less certain than a thermometer is."""
        return np.asarray(np.maximum(self.air_std, self.lagged_std.max(-1)) > THERMOMETER_STD)


def first_climate(temperature: FloatArray) -> Climate:
    """Return the climate before any of the readings (..., n_windows) [degC]; the structure is as warm as the first."""
    known = np.isfinite(temperature)
    first = np.take_along_axis(temperature, known.argmax(-1)[..., None], axis=-1)
    lead = np.zeros(temperature.shape[:-1])
    return Climate(
        air=first[..., 0],
        silent=lead,
        lagged=np.repeat(first, len(_INERTIA), axis=-1),
        lagged_std=np.zeros((*lead.shape, len(_INERTIA))),
        observed=lead + _CLIMATE_WORTH,
        squared_rate=lead + _RATE**2,
        squared_swing=lead + _SWING**2,
    )


def follow(climate: Climate, temperature: FloatArray, seconds: FloatArray) -> tuple[Temperatures, Climate]:
    """Return the temperatures of windows, and the climate after them.

    Between two readings the air's temperature is interpolated linearly. After the last one it is constant, with a
    standard deviation that grows as the site's temperature usually changes.

    Parameters
    ----------
    climate : after the window before
    temperature : (..., n_windows) of the air [degC], NaN where not known
    seconds : (n_windows,) since the window before [s]
    """
    rows = []
    for window in range(temperature.shape[-1]):
        climate = _next(climate, temperature[..., window], float(seconds[window]))
        rows.append(_now(climate))
    air, air_std, lagged, lagged_std = (np.stack(row, axis=temperature.ndim - 1) for row in zip(*rows, strict=True))
    return Temperatures(air=air, air_std=air_std, lagged=lagged, lagged_std=lagged_std), climate


def _next(climate: Climate, reading: FloatArray, seconds: float) -> Climate:
    """Return the climate after one window, whose reading may be missing."""
    passed = (climate.silent + seconds)[..., None]
    known, ever = np.isfinite(reading), np.isfinite(climate.air)
    air = np.where(ever, climate.air, reading)[..., None]
    lagged = np.where(np.isfinite(climate.lagged), climate.lagged, air)
    share, ramp = -np.expm1(-passed / _INERTIA), _ramp(passed)
    there = lagged + share * (air - lagged) + ramp * (reading[..., None] - air)
    unsure = np.hypot((1 - share) * climate.lagged_std, share * climate.chord_std(passed[..., 0])[..., None])
    step = np.minimum(passed[..., 0], 3600.0)  # longer gaps show no rate of an hour
    observed = climate.observed + step
    rate, swing = (reading - there[..., 0]) / _INERTIA[0], reading - there[..., -1]
    weight = step / observed

    def taken(new: FloatArray, old: FloatArray) -> FloatArray:
        return np.where(known.reshape(known.shape + (1,) * (new.ndim - known.ndim)), new, old)

    return Climate(
        air=taken(reading, climate.air),
        silent=taken(np.zeros_like(climate.silent), passed[..., 0]),
        lagged=taken(there, lagged),
        lagged_std=taken(unsure, climate.lagged_std),
        observed=taken(observed, climate.observed),
        squared_rate=taken(climate.squared_rate + weight * (rate**2 - climate.squared_rate), climate.squared_rate),
        squared_swing=taken(climate.squared_swing + weight * (swing**2 - climate.squared_swing), climate.squared_swing),
    )


def _now(climate: Climate) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the present temperatures and their deviations: those of the last reading, carried on."""
    passed, lost = climate.silent[..., None], (climate.silent > 0) & np.isfinite(climate.air)
    share, std = -np.expm1(-passed / _INERTIA), np.where(lost, climate.change_std(climate.silent), 0.0)
    lagged = climate.lagged + share * (climate.air[..., None] - climate.lagged)
    return climate.air, std, lagged, np.hypot((1 - share) * climate.lagged_std, _ramp(passed) * std[..., None])


def _ramp(passed: FloatArray) -> FloatArray:
    """Return how far structures of the five inertias have followed an air that rose evenly by one, from zero on."""
    ratio = passed / _INERTIA
    return np.asarray(1 + np.expm1(-ratio) / np.maximum(ratio, 1e-9))


def terms(temperatures: Temperatures) -> FloatArray:
    """Return the regressors and four deviations of them (..., 5, N_TERMS).

    Regressors are constant, temperature, difference of past temperatures from it, hinges in the shortest memory, and
    the difference of the hinges at freezing in the longer ones. Without any reading, the constant alone. Deviations are
    those by a kelvin, by missing readings, by freezing of unknown inertia, and by a kelvin at freezing.
    """
    air, lagged = temperatures.air, temperatures.lagged
    known = np.isfinite(air)[..., None]
    value = _varying(air, lagged)
    kelvin = _varying(air + 0.5, lagged + 0.5) - _varying(air - 0.5, lagged - 0.5)
    up = _varying(air + temperatures.air_std, lagged + temperatures.lagged_std)
    down = _varying(air - temperatures.air_std, lagged - temperatures.lagged_std)
    ice = kelvin * _OF_FROST
    rows = [np.where(known, row, 0.0) for row in (value, kelvin - ice, (up - down) / 2, _frost(air, lagged), ice)]
    constant = np.zeros((*air.shape, len(rows), 1))
    constant[..., 0, :] = 1.0
    return np.concatenate([constant, np.stack(rows, axis=-2)], axis=-1)


def _frost(air: FloatArray, lagged: FloatArray) -> FloatArray:
    """Return the standard deviation of the regressors without the constant (..., N_TERMS - 1) due to freezing.

    Inside a structure temperatures lie anywhere between those of the air and of its past, also because latent heat
    holds parts at the freezing point. Below it, where the slope may be large, the law's value is taken as uniform
    between those of a structure as cold as the coldest and as warm as the warmest of them.
    """
    here = np.minimum(np.concatenate([air[..., None], lagged], axis=-1), _FREEZING[-1])
    ends = (np.repeat(end[..., None], len(_INERTIA), axis=-1) for end in (here.min(-1), here.max(-1)))
    coldest, warmest = (_varying(end[..., 0], end) for end in ends)
    return np.asarray((coldest - warmest) / np.sqrt(12))


def _varying(air: FloatArray, lagged: FloatArray) -> FloatArray:
    """Return the regressors without the constant (..., N_TERMS - 1)."""
    lagged = lagged[..., _REGRESSED]
    hinges = np.asarray(np.minimum(lagged[..., 0][..., None] - KNOTS, 0.0) - np.minimum(_MIDDLE - KNOTS, 0.0))
    colder = np.minimum(lagged[..., None] - _FREEZING_LATE, 0.0)  # (..., memory, knot)
    late = (colder[..., 1:, :] - colder[..., :1, :]).reshape(*air.shape, -1)
    return np.concatenate([air[..., None] - _MIDDLE, lagged - air[..., None], hinges, late], axis=-1)


def prior_std(scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviations (..., N_TERMS) of the law's coefficients before anything is measured.

    Parameters
    ----------
    scale : (..., n_tracks) standard deviation of a window's log frequencies

    Returns
    -------
    common : of the common part of all modes, along the whitened common direction
    own : of each mode without it; both in the whitened frequencies' units
    """
    size = np.sqrt((1 / scale**2).sum(-1))[..., None]
    frozen = np.isin(KNOTS, _FREEZING)
    common = np.concatenate([np.full(4, _SLOPE), np.where(frozen, _ICE, _KINK), np.full(_N_LATE, _ICE)])
    own = np.concatenate([np.full(4, _OWN_SLOPE), np.where(frozen, _OWN_ICE, _OWN_KINK), np.full(_N_LATE, _OWN_ICE)])
    first = np.full_like(size, _CONSTANT)
    rooted = size / np.sqrt(scale.shape[-1])
    return np.concatenate([first, common * size], -1), np.concatenate([first, own * rooted], -1)

"""What temperature may do to natural frequencies: a linear law in the air's temperature, its past, and hinges.

References
----------
Peeters, B., De Roeck, G. (2001). One-year monitoring of the Z24-bridge: environmental effects versus damage events.
Earthquake Engineering and Structural Dynamics 30, 149-171: frequencies follow the temperature of hours ago, and their
slope changes where asphalt and ground freeze.
"""

import numpy as np

from daq import FloatArray

MEMORY = np.array([1.0, 6.0, 36.0]) * 3600  #: time constants with which a structure may follow the air [s]
KNOTS = np.arange(-20.0, 36.0, 5.0)  #: temperatures at which the slope may change [degC]
_MIDDLE = 15.0  # degC, where the law is centred
_FREEZING = np.array([-5.0, 0.0, 5.0])  # degC, knots at which the slope may change much
_CONSTANT = 100.0  # standard deviations of a window: nothing is known of the constant before the baseline
_SLOPE, _OWN_SLOPE = 1e-3, 3e-4  # 1/K, of all modes together and of each: steel has -2e-4, concrete -2e-4 to -4e-4,
# bridges on bearings, arches and whatever is held at both ends up to -2e-3, each mode another
_KINK, _OWN_KINK = 5e-5, 2e-5  # 1/K, changes of slope at a knot ...
_ICE, _OWN_ICE = 3e-3, 1e-3  # 1/K, ... and where it freezes: the Z24 bridge's modes had up to -1e-2
_N_LATE = (len(MEMORY) - 1) * len(_FREEZING)
N_TERMS = 2 + len(MEMORY) + len(KNOTS) + _N_LATE
THERMOMETER_STD = 1.0  #: of the devices' temperature as the structure's [K]


def remember(memory: FloatArray, temperature: FloatArray, seconds: FloatArray) -> FloatArray:
    """Return the temperatures (..., n_windows, 3) that structures of three inertias have, window by window.

    Parameters
    ----------
    memory : (..., 3) the same after the window before [degC], NaN if never known
    temperature : (..., n_windows) of the air [degC], NaN where not known, which leaves the memory as it is
    seconds : (n_windows,) since the window before [s]
    """
    share = -np.expm1(-seconds[:, None] / MEMORY)
    out = np.empty((*temperature.shape, len(MEMORY)))
    for window in range(temperature.shape[-1]):
        air = temperature[..., window, None]
        memory = np.where(np.isnan(memory), air, memory)
        memory = memory + np.where(np.isnan(air), 0.0, share[window] * (air - memory))
        out[..., window, :] = memory
    return out


def terms(temperature: FloatArray, memory: FloatArray) -> FloatArray:
    """Return the regressors and what a kelvin makes of them (..., 2, N_TERMS).

    Constant, temperature, how far the past differs from it, hinges in the shortest memory, and what the hinges at
    freezing are in the longer ones beside that.

    Parameters
    ----------
    temperature : (...,) [degC]; NaN where no device has a sensor, which leaves the constant alone
    memory : (..., 3) from `remember`
    """
    known = np.isfinite(temperature)[..., None]
    air = temperature[..., None]
    hinges = np.minimum(memory[..., :1] - KNOTS, 0.0) - np.minimum(_MIDDLE - KNOTS, 0.0)
    colder = memory[..., None] - _FREEZING  # (..., memory, knot)
    late = np.minimum(colder[..., 1:, :], 0.0) - np.minimum(colder[..., :1, :], 0.0)
    varying = np.concatenate([air - _MIDDLE, memory - air, hinges, _flat(late)], axis=-1)
    value = np.concatenate([np.ones_like(air), np.where(known, varying, 0.0)], axis=-1)
    below = _flat((colder[..., 1:, :] < 0) * 1.0 - (colder[..., :1, :] < 0))
    kelvin = np.concatenate([np.ones_like(air), np.zeros_like(memory), memory[..., :1] < KNOTS, below], axis=-1)
    slope = np.concatenate([np.zeros_like(air), np.where(known, kelvin, 0.0)], axis=-1)
    return np.stack([value, slope], axis=-2)


def _flat(values: FloatArray) -> FloatArray:
    return values.reshape(*values.shape[:-2], -1)


def prior_std(scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviations (..., N_TERMS) of the law's coefficients before anything is measured.

    Parameters
    ----------
    scale : (..., n_tracks) standard deviation of a window's log frequencies

    Returns
    -------
    common : of what all modes have alike, along the whitened common direction
    own : of each mode beside that; both in the whitened frequencies' units
    """
    size = np.sqrt((1 / scale**2).sum(-1))[..., None]
    frozen = np.isin(KNOTS, _FREEZING)
    common = np.concatenate([np.full(4, _SLOPE), np.where(frozen, _ICE, _KINK), np.full(_N_LATE, _ICE)])
    own = np.concatenate([np.full(4, _OWN_SLOPE), np.where(frozen, _OWN_ICE, _OWN_KINK), np.full(_N_LATE, _OWN_ICE)])
    first = np.full_like(size, _CONSTANT)
    rooted = size / np.sqrt(scale.shape[-1])
    return np.concatenate([first, common * size], -1), np.concatenate([first, own * rooted], -1)

"""Sensors that contribute most to the location of a body, and the best additional sensor.

A set of sensors is as good as the places of a body are sure with it: the mean logarithm of the Cramér-Rao bound of the
place, over all places. Sensors are added or left out one at a time, which is within a few per cent of the best set
where information has diminishing returns (Nemhauser, Wolsey, Fisher 1978).

References
----------
Nemhauser, G. L., Wolsey, L. A., Fisher, M. L. (1978). An analysis of approximations for maximizing submodular set
functions I. Mathematical Programming 14, 265-294.
"""

from dataclasses import dataclass

import numpy as np

from updater.errors import ModelError
from updater.planning.detectability import DetectabilityStudy, with_sensors
from updater.structure import Sensor

_MAX_PLACES = 40  # where one more is tried
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Choice:
    """A set of sensors."""

    sensors: tuple[Sensor, ...]
    outlook: DetectabilityStudy
    changed: Sensor  #: the one added or left out last
    mean_position_std: float  #: mean over all places of the bound of the place, geometric [m]


def mean_position_std(outlook: DetectabilityStudy, mass: float) -> float:
    """Return how sure the place of a mass is (geometric mean over all places) [m].

    Where a bound is beyond all members' length nothing is known, and no sensor is rewarded for slightly less.
    """
    place, _ = outlook.bound(mass)
    share = outlook.places.weight / outlook.places.weight.sum()
    whole = sum(member.length for member in outlook.reference.structure.member)
    return float(np.exp(share @ np.log(np.minimum(place, whole))))


def best_additional_sensor(outlook: DetectabilityStudy, mass: float) -> Choice:
    """Return the sensors with a further one, which reduces the deviation of a mass' place most.

    Parameters
    ----------
    outlook : study with the present sensors
    mass : to be located [kg]
    """
    sensors = outlook.reference.structure.sensor
    tried = (_judged(outlook, (*sensors, new), new, mass) for new in candidates(outlook))
    return min(tried, key=lambda choice: choice.mean_position_std)


def backward_elimination(outlook: DetectabilityStudy, mass: float) -> list[Choice]:
    """Remove sensors one by one, each time the one whose loss increases the deviation of a mass' place least.

    Parameters
    ----------
    outlook : study with all sensors
    mass : to be located [kg]

    Returns
    -------
    list of Choice
        By falling number of sensors; the last one still measures three modes with two sensors.
    """
    found: list[Choice] = []
    sensors = outlook.reference.structure.sensor
    while True:
        tried = []
        for gone in sensors:
            try:
                tried.append(_judged(outlook, tuple(s for s in sensors if s is not gone), gone, mass))
            except ModelError:
                continue
        if not tried:
            return found
        found.append(min(tried, key=lambda choice: choice.mean_position_std))
        sensors = found[-1].sensors


def _judged(outlook: DetectabilityStudy, sensors: tuple[Sensor, ...], changed: Sensor, mass: float) -> Choice:
    other = with_sensors(outlook, sensors)
    return Choice(sensors=sensors, outlook=other, changed=changed, mean_position_std=mean_position_std(other, mass))


def candidates(outlook: DetectabilityStudy) -> list[Sensor]:
    """Return a sensor along each axis at many places where there is none yet."""
    structure = outlook.reference.structure
    step = -(-len(outlook.member) // _MAX_PLACES)
    found = []
    for x, y, z in outlook.point[::step].tolist():
        there = [s for s in structure.sensor if np.linalg.norm(np.subtract(s.at, (x, y, z))) < 1e-3]
        for axis in _AXES:
            if not any(abs(np.dot(axis, s.direction)) > 0.99 * np.linalg.norm(s.direction) for s in there):
                found.append(Sensor(channel=_new_name(structure.channels), at=(x, y, z), direction=axis))
    return found


def _new_name(taken: tuple[str, ...]) -> str:
    name = "new"
    while name in taken:
        name += "_"
    return name

"""Record length and number of sensors needed to locate a body of a given mass wherever it is."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.planning.detectability import DetectabilityStudy
from updater.planning.record_length import LocalizationSimulation, Target
from updater.planning.sensor_placement import backward_elimination, best_additional_sensor

_PLACES = 25  # where the body is tried
_SETS = 5  # of fewer sensors


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorSet:
    """Some sensors, and how long they must measure."""

    channels: tuple[str, ...]
    places: IndexArray  #: (n,) of the outlook, where the body was tried
    seconds: FloatArray  #: (n,) of the record before and of that after [s]; infinite where a day's do not suffice
    length: FloatArray  #: (n,) length of members that each place represents [m]

    def share_found(self, seconds: float) -> float:
        """Return the share of the members' length on which records so long [s] find the body."""
        return float(self.length[self.seconds <= seconds * (1 + 1e-9)].sum() / self.length.sum())

    def seconds_for(self, share: float) -> float:
        """Return how long records must be to find it on a share of the members' length [s]; infinite if none is."""
        order = np.argsort(self.seconds)
        reached = np.cumsum(self.length[order]) / self.length.sum() >= share - 1e-9
        return float(self.seconds[order][np.argmax(reached)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Requirements for locating the target."""

    target: Target
    outlook: DetectabilityStudy
    records: FloatArray  #: (n,) lengths of record, each twice the one before [s]
    present: SensorSet
    fewer: tuple[SensorSet, ...]  #: ever fewer of them
    left_out: tuple[str, ...]  #: channels in the order in which they are left out
    more: SensorSet  #: set with one more sensor
    more_at: tuple[float, float, float]  #: [m]
    more_along: tuple[float, float, float]


def plan(outlook: DetectabilityStudy, target: Target) -> Plan:
    """Return how long to measure with the sensors there are, with fewer of them, and with one more."""
    sets = backward_elimination(outlook, target.mass)
    chosen = np.unique(np.linspace(0, len(sets) - 1, min(_SETS, len(sets))).round().astype(int))
    added = best_additional_sensor(outlook, target.mass)
    return Plan(
        target=target,
        outlook=outlook,
        records=LocalizationSimulation(outlook, target).records,
        present=_set(outlook, target),
        fewer=tuple(_set(sets[k].outlook, target) for k in chosen),
        left_out=tuple(choice.changed.channel for choice in sets),
        more=_set(added.outlook, target),
        more_at=added.changed.at,
        more_along=added.changed.direction,
    )


def _set(outlook: DetectabilityStudy, target: Target) -> SensorSet:
    foresight = LocalizationSimulation(outlook, target)
    step = -(-len(foresight.places) // _PLACES)
    places = foresight.places[step // 2 :: step]
    return SensorSet(
        channels=outlook.reference.baseline.channels,
        places=places,
        seconds=foresight.seconds_needed(places),
        length=_lengths(outlook, places),
    )


def _lengths(outlook: DetectabilityStudy, places: IndexArray) -> FloatArray:
    """Return the length of members nearest to each of some places (n,) [m]."""
    away = np.linalg.norm(outlook.point[:, None] - outlook.point[places], axis=2)
    return np.asarray(np.bincount(np.argmin(away, axis=1), outlook.places.weight, minlength=len(places)), float)

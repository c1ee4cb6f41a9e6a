"""Common part of faults of the measuring chain: channels as places, corrections in the structure file."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from updater.causes.base import BoolArray, Cause, Discrete
from updater.inference import Comparison, Fit
from updater.quantities import Where
from updater.reference import Reference
from updater.structure import Correction, Structure

_SAME_PLACE = 1e-3  # m
_LEAST_SHARE = 1e-4  # of a fitted variance: more of it is not taken off


@dataclass(frozen=True, eq=False, kw_only=True)
class Chain(Discrete):
    """Alternatives that are channels, pairs of them, or all of a device."""

    channels: tuple[tuple[str, ...], ...]  #: channels of each alternative
    place_free: bool = False

    def repeats(self, other: Self, row: int) -> BoolArray:
        """Return the alternatives of the same channels."""
        return np.array([channels == other.channels[row] for channels in self.channels])

    def whole_variance(self, variance: float, usual_std: float) -> float:
        """Return the variance of a whole error, the usual one of a file included.

        The data determine the sum of the two. What exceeds the usual error is known less well, by the variance of this.

        Parameters
        ----------
        variance : of what exceeds the usual error, as fitted
        usual_std : standard deviation of the usual error, which a file has and a measured baseline has not
        """
        usual = usual_std**2 if self.comparison.sensor_errors.size else 0.0
        return max(variance - usual, _LEAST_SHARE * variance)

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the channels."""
        return Where(channels=self.channels[fit.best])


def groups_of(reference: Reference, comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the channels that a fault may befall together: every one alone, and those of a device.

    Devices are known from the log; otherwise channels at one position count as one device. A change common to all
    channels is not a fault, because it has no effect.
    """
    devices, place = comparison.circumstances.devices, _places(reference)
    together = _alike(comparison.channels, {c: (devices.get(c, place[c]),) for c in comparison.channels})
    alone = [(c,) for c in comparison.channels]
    return alone + [group for group in together if 1 < len(group) < len(comparison.channels)]


def mounted_together(reference: Reference, comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the channels of each housing: those of one device that are at one place."""
    devices, place = comparison.circumstances.devices, _places(reference)
    return _alike(comparison.channels, {c: (devices.get(c, place[c]), place[c]) for c in comparison.channels})


def _places(reference: Reference) -> dict[str, str]:
    sensors = reference.structure.corrected_sensors
    return {s.channel: f"at {np.round(np.divide(s.at, _SAME_PLACE)).tolist()}" for s in sensors}


def _alike(channels: Sequence[str], owner: Mapping[str, tuple[str, ...]]) -> list[tuple[str, ...]]:
    found: dict[tuple[str, ...], list[str]] = {}
    for channel in channels:
        found.setdefault(owner[channel], []).append(channel)
    return [tuple(group) for group in found.values()]


def corrected(
    structure: Structure,
    channels: Sequence[str],
    *,
    gain: float = 1.0,
    sign: Literal[1, -1] = 1,
    delay: float = 0.0,
) -> Structure:
    """Return a structure with further corrections of its sensors, named as in logs."""
    found = dict(structure.sensors)
    for sensor, corrected in zip(structure.sensor, structure.corrected_sensors, strict=True):
        if corrected.channel in channels:
            old = found.get(sensor.channel, Correction())
            more = {"gain": old.gain * gain, "sign": old.sign * sign, "delay": old.delay + delay}
            found[sensor.channel] = old.model_copy(update=more)
    return _with(structure, found)


def exchanged(structure: Structure, first: str, second: str) -> Structure:
    """Return a structure with two sensors on each other's channels; corrections stay with the channels."""
    known = [structure.sensors.get(s.channel, Correction()) for s in structure.sensor]
    at = {h.channel: i for i, h in enumerate(structure.corrected_sensors)}
    found = dict(structure.sensors)
    for here, there in itertools.permutations((first, second)):
        name = structure.sensor[at[here]].channel
        found[name] = known[at[there]].model_copy(update={"channel": None if there == name else there})
    return _with(structure, found)


def _with(structure: Structure, corrections: dict[str, Correction]) -> Structure:
    """Return the structure with corrections, without neutral ones."""
    kept = {name: c for name, c in corrections.items() if c != Correction()}
    return structure.model_copy(update={"sensors": kept})

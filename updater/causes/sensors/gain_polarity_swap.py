"""Gain, polarity and exchange of channels: faults visible in shapes, not in frequencies."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.sensors.channel_fault import Chain, corrected, exchanged, groups_of
from updater.inference import Comparison, Effect, Fit, no_effect
from updater.quantities import GAIN_STD, Quantity
from updater.reference import Reference
from updater.structure import Structure

_GAIN_STD = 0.3  # of a gain's logarithm
_LATE_STD = 1e-4  # s, of one device relative to another


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorGain(Chain):
    """A channel with a changed gain; the parameter is its logarithm."""

    name: str = "sensor_gain"
    advice: str = "Turn the sensor by 180 degrees about a horizontal axis: gravity calibrates it."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the channels' gains."""
        return _with_gain(self.comparison, rows, np.exp(theta[:, 0]))

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the gain relative to the previous one."""
        gain = float(np.exp(fit.theta[fit.best, 0]))
        variance = self.whole_variance(float(fit.covariance[fit.best, 0, 0]), GAIN_STD)
        return {"gain": Quantity(value=gain, std=gain * variance**0.5, unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the gain at the sensor."""
        return corrected(structure, self.channels[row], gain=float(np.exp(theta[0])))


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorPolarity(Chain):
    """A channel with its sign turned; it has no parameter."""

    name: str = "sensor_polarity"
    advice: str = "Look which way the sensor's axis points."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the channels' signs."""
        return _with_gain(self.comparison, rows, -1.0)

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Turn the sensor's sign."""
        del theta
        return corrected(structure, self.channels[row], sign=-1)


def _with_gain(comparison: Comparison, rows: IndexArray, gain: FloatArray | float) -> Effect:
    """Return the effect of a gain of one channel in each alternative (len(rows),)."""
    none = no_effect(len(rows), comparison)
    chain = np.repeat(none.chain, len(rows), axis=0)
    chain[np.arange(len(rows)), rows, rows] = gain
    return replace(none, chain=chain)


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorSwap(Chain):
    """Two channels that have taken each other's place, or two devices with all their channels.

    The parameters are by how much either is later than its namesake was: devices have delays of their own.
    """

    order: IndexArray  #: (n, n_channels) which channel each one really is
    side: FloatArray  #: (n, 2, n_channels) 1 for the channels of either
    pairs: tuple[tuple[tuple[str, str], ...], ...]  #: channels exchanged by each
    name: str = "sensor_swap"
    advice: str = "Follow the two cables. Tap next to each sensor and check which channel responds."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return permutations, with their delays."""
        n = self.order.shape[1]
        imaginary = np.einsum("pk,pkc->pc", theta, self.side[rows])
        chain = np.eye(n, 3 * n)[self.order[rows]]
        return replace(no_effect(len(rows), self.comparison), chain=chain, imaginary=imaginary)

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Exchange the channels that carry the two sensors."""
        for first, second in self.pairs[row]:
            structure = exchanged(structure, first, second)
        for channels, seconds in zip(zip(*self.pairs[row], strict=True), theta, strict=True):
            structure = corrected(structure, channels, delay=float(seconds))
        return structure


def propose_sensor_gain(reference: Reference, comparison: Comparison) -> SensorGain:
    """Return every channel."""
    del reference
    names = tuple((c,) for c in comparison.channels)
    return SensorGain(
        prior_std=np.array([_GAIN_STD]),
        lower=np.full((len(names), 1), -np.inf),
        comparison=comparison,
        channels=names,
    )


def propose_sensor_polarity(reference: Reference, comparison: Comparison) -> SensorPolarity:
    """Return every channel."""
    del reference
    names = tuple((c,) for c in comparison.channels)
    return SensorPolarity(lower=np.zeros((len(names), 0)), comparison=comparison, channels=names)


def propose_sensor_swap(reference: Reference, comparison: Comparison) -> SensorSwap | None:
    """Return every pair of channels, and every pair of devices with channels along the same axes."""
    channels = comparison.channels
    pairs = [((a, b),) for a, b in itertools.combinations(channels, 2)] + _devices(reference, comparison)
    if not pairs:
        return None
    order, side = np.tile(np.arange(len(channels)), (len(pairs), 1)), np.zeros((len(pairs), 2, len(channels)))
    for row, pair in enumerate(pairs):
        one, other = ([channels.index(c) for c in each] for each in zip(*pair, strict=True))
        order[row, one], order[row, other] = other, one
        side[row, 0, one] = side[row, 1, other] = 1.0
    return SensorSwap(
        prior_std=np.full(2, _LATE_STD),
        lower=np.full((len(pairs), 2), -np.inf),
        comparison=comparison,
        channels=tuple(tuple(itertools.chain(*zip(*pair, strict=True))) for pair in pairs),
        order=order,
        side=side,
        pairs=tuple(pairs),
    )


def _devices(reference: Reference, comparison: Comparison) -> list[tuple[tuple[str, str], ...]]:
    """Return the channels exchanged with each pair of devices of several channels."""
    way = {s.channel: s.direction for s in reference.structure.corrected_sensors}
    groups = [sorted(g, key=way.__getitem__, reverse=True) for g in groups_of(reference, comparison) if len(g) > 1]
    return [
        tuple(zip(one, other, strict=True))
        for one, other in itertools.combinations(groups, 2)
        if [way[c] for c in one] == [way[c] for c in other]
    ]

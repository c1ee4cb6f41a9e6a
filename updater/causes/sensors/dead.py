"""Dead channels or devices: no part of the structure's motion in their samples.

A channel that is still among the shapes has zero components in all of them. A channel that identification left out
because it has no signal (constant, or no samples) is missing there, which is the evidence. Channels that were left out
for another reason - clipped, wandering, copied, spikes, gaps - do measure: they are reported, and are no cause.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.sensors.channel_fault import Chain, corrected, groups_of
from updater.inference import Comparison, Effect, no_effect
from updater.reference import Reference
from updater.structure import Structure

_LOG_ODDS = float(np.log(1e6))  # that a channel which works has a signal in some window of an event


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorDead(Chain):
    """Channels without a signal, jointly; there is no parameter."""

    hears: FloatArray  #: (n_alternatives, n_channels) 0 for the channels of each that are compared
    without_signal: bool  #: whether they were left out by identification for lack of a signal
    name: str = "sensor_dead"
    advice: str = "Tap next to the sensor. If its channel does not respond, check the cable, then replace the sensor."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return channels that read nothing."""
        del theta
        none = no_effect(len(rows), self.comparison)
        return replace(none, chain=none.chain * self.hears[rows][:, :, None])

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the evidence of channels that have no signal."""
        del covariance, rows
        return np.full(len(theta), _LOG_ODDS if self.without_signal else 0.0)

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Take the gain away."""
        del theta
        return corrected(structure, self.channels[row], gain=0.0)


def propose_sensor_dead(reference: Reference, comparison: Comparison) -> SensorDead:
    """Return the channels that have no signal; where all have one, every channel and every device."""
    faults, known = comparison.circumstances.faults, reference.structure.active_channels
    silent = {channel for channel, fault in faults.items() if fault.kind == "no_signal"}
    missing = tuple(c for c in known if c in silent and c not in comparison.channels)
    groups = [missing] if missing else groups_of(reference, comparison)
    return SensorDead(
        lower=np.zeros((len(groups), 0)),
        comparison=comparison,
        channels=tuple(groups),
        hears=np.array([[float(c not in group) for c in comparison.channels] for group in groups]),
        without_signal=bool(missing),
    )

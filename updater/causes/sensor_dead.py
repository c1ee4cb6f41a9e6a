"""A channel, or a device, that says nothing of the structure: noise, or no more than identification could give up.

Of a channel that is still among the shapes, all components are zero. One that identification gave up is missing there;
that it was given up, and why, is the evidence.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.chain import Chain, corrected, groups_of
from updater.comparison import Comparison
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.structure import Structure

_LOG_ODDS = float(np.log(1e6))  # that a channel which works is not given up in most windows of an event


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorDead(Chain):
    """Channels that say nothing, together; there is no parameter."""

    hears: FloatArray  #: (n_alternatives, n_channels) 0 for the channels of each that are compared
    given_up: bool  #: whether they are those that identification gave up
    name: str = "sensor_dead"
    advice: str = "Tap beside the sensor: if its channel does not answer, look at the cable, then change the sensor."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return channels that read nothing."""
        del theta
        none = no_effect(len(rows), self.comparison)
        return replace(none, chain=none.chain * self.hears[rows][:, :, None])

    def log_ratio(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return what it says that identification gave channels up."""
        del covariance
        return np.full(len(theta), _LOG_ODDS if self.given_up else 0.0)

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Take the gain away."""
        del theta
        return corrected(structure, self.channels[row], gain=0.0)


def propose_sensor_dead(reference: Reference, comparison: Comparison) -> SensorDead:
    """Return the channels that identification gave up; if it gave up none, every channel and every device."""
    faults, known = comparison.circumstances.faults, reference.calibration.structure.speaking
    missing = tuple(c for c in known if c in faults and c not in comparison.channels)
    groups = [missing] if missing else groups_of(reference, comparison)
    return SensorDead(
        prior_std=np.zeros(0),
        lower=np.zeros((len(groups), 0)),
        drifting=False,
        comparison=comparison,
        channels=tuple(groups),
        hears=np.array([[float(c not in group) for c in comparison.channels] for group in groups]),
        given_up=bool(missing),
    )

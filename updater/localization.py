"""Where a mass was added, and how much: the posterior over all positions of one added mass."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.causes.added_mass import FINE, AddedMass, credible, propose_added_mass
from updater.comparison import compare
from updater.fit import Fit, fit
from updater.reference import Reference
from updater.statistics import ModalMean


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of a member."""

    member: str
    start: float  #: distance from the member's start [m]
    stop: float  #: [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class MassChange:
    """A located mass; negative if it was removed."""

    member: str
    distance: float  #: posterior mean, from the member's start [m]
    distance_std: float  #: [m]
    mass: float  #: [kg]
    mass_std: float  #: [kg]
    region: tuple[Stretch, ...]  #: 95 % credible
    member_probability: float  #: that it is on this member [-]
    p_value: float  #: chance of a worse fit if one added mass is the cause [-]
    members: tuple[str, ...]  #: (n_positions,) of the profile
    position: FloatArray  #: (n_positions,) distance from the member's start [m]
    density: FloatArray  #: (n_positions,) posterior [1/m]
    profile_mass: FloatArray  #: (n_positions,) best mass at each position [kg]


def locate_mass(reference: Reference, event: ModalMean) -> MassChange:
    """Locate one added or removed mass.

    Parameters
    ----------
    reference : learnt before the change
    event : (n_tracks,) mean of the windows since the change

    Raises
    ------
    ValueError
        If fewer than three modes can be compared.
    """
    data = compare(reference, event)
    return mass_change(fit(data, propose_added_mass(reference, data)))


def mass_change(found: Fit[AddedMass]) -> MassChange:
    """Return a fitted mass with its profile."""
    cause, probability = found.hypotheses, found.probability
    names = [member.name for member in cause.reference.calibration.structure.member]
    share = np.bincount(cause.member, probability, minlength=len(names))
    chosen = int(np.argmax(share))
    here = np.where(cause.member == chosen, probability, 0) / share[chosen]
    distance = float(here @ cause.position)
    mass, mass_std = cause.mass(found)
    density = probability / cause.weight
    return MassChange(
        member=names[chosen],
        distance=distance,
        distance_std=float(np.sqrt(here @ (cause.position - distance) ** 2 + FINE**2 / 12)),
        mass=mass,
        mass_std=mass_std,
        region=tuple(
            Stretch(member=names[m], start=a, stop=b)
            for m, a, b in credible(cause.member, cause.position, density, probability)
        ),
        member_probability=float(share[chosen]),
        p_value=found.p_value,
        members=tuple(names[m] for m in cause.member),
        position=cause.position,
        density=density,
        profile_mass=found.theta[:, 0],
    )

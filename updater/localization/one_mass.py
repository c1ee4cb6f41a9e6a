"""Place and size of one added mass: the posterior over all positions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import AddedMass, propose_added_mass
from updater.inference import Fit, Place, PositionPosterior, compare, fit
from updater.modal_data import ModalMean
from updater.reference import Reference

MODEL_ERRORS = (0.01, 0.03)  # relative to a mode's typical displacement: error of the reference, at best and at worst
FITS = 0.05  # of chi-square, under which the larger one is tried
_WORTH_SAYING = 0.05  # probability of a second place that must not be kept back
_LEARNT = 0.7  # times the prior's deviation: a larger posterior deviation means that the data have no information


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of a member."""

    member: str
    start: float  #: distance from the member's start [m]
    stop: float  #: [m]


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """One possible place of the mass, and the mass there.

    Near a joint the places on the members that meet there are one place: figures are those of the most probable of
    them, the probability is that of all.
    """

    member: str
    members: tuple[str, ...]  #: members that it may be on, `member` first: more than one near a joint
    distance: float  #: distance from the member's start [m]
    distance_std: float  #: [m]
    mass: float  #: [kg]
    mass_std: float  #: [kg]
    probability: float  #: probability of the place [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyShape:
    """Properties of the located body other than its mass; those that the data do not determine stay at their prior."""

    offset: FloatArray  #: (3,) of its centre from the member's axis, global axes [m]
    offset_std: FloatArray  #: (3,) [m], 0 along the member
    offset_known: bool  #: whether the data have more information about it than the prior
    inertia: float  #: about its own centre, alike about all axes [kg m2]
    inertia_known: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class MassChange:
    """A located mass; negative if it was removed.

    `member`, `distance` and `mass` are those of the most probable place; `alternatives` holds all places that the data
    leave open, that one first.
    """

    member: str
    distance: float  #: posterior mean, from the member's start [m]
    distance_std: float  #: [m]
    mass: float  #: [kg]
    mass_std: float  #: [kg]
    body: BodyShape
    alternatives: tuple[Alternative, ...]
    region: tuple[Stretch, ...]  #: 95 % credible
    member_probability: float  #: probability that it is on this member, or at the joint of several [-]
    p_value: float  #: chance of a worse fit if one added mass is the cause [-]
    model_error: float  #: model error that was used, relative to a mode's typical displacement [-]
    tracks: IndexArray  #: (n,) modes of the baseline that entered
    members: tuple[str, ...]  #: (n_positions,) of the profile
    position: FloatArray  #: (n_positions,) distance from the member's start [m]
    density: FloatArray  #: (n_positions,) posterior [1/m]
    profile_mass: FloatArray  #: (n_positions,) best mass at each position [kg]

    @property
    def is_unique(self) -> bool:
        """True if the data leave one place only."""
        return len(self.alternatives) == 1


def locate_mass(reference: Reference, event: ModalMean) -> MassChange:
    """Locate one added or removed mass.

    Modes without a known shape (NaN) count by their frequencies; with none at all (`ModalMean.without_shapes`) a
    symmetric structure has two possible places, and `alternatives` holds both.

    Parameters
    ----------
    reference : learned before the change
    event : (n_tracks,) mean of the windows since the change

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared, or the input is invalid.
    """
    return mass_change(*fit_mass(reference, event))


def fit_mass(reference: Reference, event: ModalMean) -> tuple[Fit[AddedMass], float]:
    """Return one mass fitted at all positions, and the least of `MODEL_ERRORS` with which it fits."""
    for error in MODEL_ERRORS:
        data = compare(reference, event, model_error=error)
        found = fit(data, propose_added_mass(reference, data))
        if found.p_value >= FITS:
            break
    return found, error


def mass_change(found: Fit[AddedMass], model_error: float) -> MassChange:
    """Return a fitted mass with its profile."""
    cause, probability = found.hypotheses, found.probability
    names = [member.name for member in cause.reference.structure.member]
    posterior = cause.posterior(found)
    separate = posterior.separate_places
    alternatives = tuple(
        _alternative(found, posterior, places)
        for places in separate
        if places is separate[0] or _probability(places) >= _WORTH_SAYING
    )
    first, likeliest = alternatives[0], separate[0][0]
    return MassChange(
        member=first.member,
        distance=first.distance,
        distance_std=first.distance_std,
        mass=first.mass,
        mass_std=first.mass_std,
        body=_shape(found, likeliest),
        alternatives=alternatives,
        region=tuple(Stretch(member=names[m], start=a, stop=b) for m, a, b in posterior.intervals),
        member_probability=min(posterior.member_probability, 1.0),
        p_value=found.p_value,
        model_error=model_error,
        tracks=cause.comparison.tracks,
        members=tuple(names[m] for m in cause.member),
        position=cause.position,
        density=probability / cause.weight,
        profile_mass=found.theta[:, 0],
    )


def _probability(places: Sequence[Place]) -> float:
    return sum(place.probability for place in places)


def _alternative(found: Fit[AddedMass], posterior: PositionPosterior, places: Sequence[Place]) -> Alternative:
    """Return places next to one another as one, the most probable first."""
    place, members = places[0], [posterior.members[place.member].name for place in places]
    distance, distance_std = posterior.distance(place)
    mass, mass_std = found.hypotheses.mass(found, place)
    return Alternative(
        member=members[0],
        members=tuple(dict.fromkeys(members)),
        distance=distance,
        distance_std=distance_std,
        mass=mass,
        mass_std=mass_std,
        probability=_probability(places),
    )


def _shape(found: Fit[AddedMass], place: Place) -> BodyShape:
    cause = found.hypotheses
    average = np.array([cause.averaged(found, place, parameter) for parameter in range(4)])
    known = average[:, 1] < _LEARNT * cause.prior_std
    member = cause.reference.structure.member[place.member]
    cross = member.axes[1:]
    return BodyShape(
        offset=average[1:3, 0] @ cross,
        offset_std=np.sqrt(average[1:3, 1] ** 2 @ cross**2),
        offset_known=bool(known[1:3].any()),
        inertia=float(average[0, 0] * average[3, 0]),
        inertia_known=bool(known[3]),
    )

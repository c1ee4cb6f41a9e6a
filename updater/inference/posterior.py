"""A posterior over positions along members: its 95 % region, and the separate places that it leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from daq import FloatArray, IndexArray
from updater.quantities import Vector, Where, vector
from updater.structure import Member

HELD = 0.95  # of the posterior, by the region
_APART = 0.02  # m on a structure of 1.5 m: stretches of the region nearer than this are one place


@dataclass(frozen=True, eq=False, kw_only=True)
class Place:
    """One place of the posterior: a stretch of a member and the nearest positions."""

    member: int
    start: float  #: start of the stretch, from the member's start [m]
    stop: float  #: [m]
    probability: float  #: probability of the place [-]
    share: FloatArray  #: (n,) probability of each position, given the place; sums to one


@dataclass(frozen=True, eq=False, kw_only=True)
class PositionPosterior:
    """Posterior of a cause over positions along members."""

    members: Sequence[Member]
    member: IndexArray  #: (n,) number of the member of each position
    position: FloatArray  #: (n,) distance from the member's start, ascending on each member [m]
    probability: FloatArray  #: (n,) summing to one
    length: FloatArray  #: (n,) that each position represents, or their ratios [m]
    scale: float = 1.0  #: size of the structure over the usual one
    resolution: float = 0.0  #: distance between positions where they are closest [m]

    @property
    def apart(self) -> float:
        """Distance below which two places are one [m]."""
        return self.scale * _APART

    @cached_property
    def intervals(self) -> list[tuple[int, float, float]]:
        """Stretches (member, from, to) of highest density that hold 95 % [m]."""
        return credible(self.member, self.position, self.probability / self.length, self.probability)

    @cached_property
    def places(self) -> list[Place]:
        """Separate places, the most probable first.

        A mean over two places would be neither: if the data cannot distinguish left from right it lies in the middle.
        Each position therefore counts for the nearest stretch of the region on its member, and every place has its own
        figures. Probability on members outside the region belongs to no place.
        """
        stretches = _merged(self.intervals, self.apart)
        owner = _nearest(stretches, self.member, self.position)
        found = []
        for number, (m, a, b) in enumerate(stretches):
            own = np.where(owner == number, self.probability, 0.0)
            found.append(Place(member=m, start=a, stop=b, probability=float(own.sum()), share=own / own.sum()))
        return sorted(found, key=lambda place: -place.probability)

    @property
    def separate_places(self) -> list[list[Place]]:
        """Places by their position in space, the most probable first: near a joint those on its members are one.

        Each is a list, the most probable place first.
        """
        separate: list[list[Place]] = []
        for place in self.places:
            at = self.point(place)
            near = (places for places in separate if np.linalg.norm(self.point(places[0]) - at) < self.apart)
            if (there := next(near, None)) is None:
                separate.append([place])
            else:
                there.append(place)
        return sorted(separate, key=lambda places: -sum(place.probability for place in places))

    def distance(self, place: Place) -> tuple[float, float]:
        """Return mean and standard deviation of the distance from the member's start at a place [m]."""
        mean = float(place.share @ self.position)
        return mean, float(np.sqrt(place.share @ (self.position - mean) ** 2 + self.resolution**2 / 12))

    def point(self, place: Place) -> FloatArray:
        """Return the mean of a place in space (3,) [m]."""
        return self.members[place.member].point(self.distance(place)[0])

    def region(self, half: FloatArray | None = None) -> tuple[tuple[Vector, Vector], ...]:
        """Return the ends of the intervals in space [m].

        Parameters
        ----------
        half : (n_members,) by which intervals extend beyond their first and last positions [m]
        """
        more = np.zeros(len(self.members)) if half is None else half
        return tuple(
            (vector(self.members[m].point(a - more[m])), vector(self.members[m].point(b + more[m])))
            for m, a, b in self.intervals
        )

    @property
    def member_probability(self) -> float:
        """Probability that it is on the member of the most probable place; near a joint, that it is at that place."""
        first = self.separate_places[0]
        if len({place.member for place in first}) > 1:
            return sum(place.probability for place in first)
        return float(self.probability[self.member == first[0].member].sum())

    @property
    def where(self) -> Where:
        """Mean of the most probable place, and the region."""
        place = self.places[0]
        _, std = self.distance(place)
        member = self.members[place.member]
        return Where(member=member.name, position=vector(self.point(place)), position_std=std, region=self.region())


def credible(
    member: IndexArray, position: FloatArray, density: FloatArray, probability: FloatArray
) -> list[tuple[int, float, float]]:
    """Return the stretches (member, from, to) of highest density that hold 95 %.

    Parameters
    ----------
    member, position : (n,) member and distance from its start [m], ascending on each member
    density : (n,) posterior [1/m]
    probability : (n,) posterior, summing to one
    """
    order = np.argsort(-density, kind="stable")
    inside = np.zeros(len(density), bool)
    inside[order[: int(np.searchsorted(np.cumsum(probability[order]), HELD)) + 1]] = True
    starts = np.flatnonzero(inside & ~np.r_[False, inside[:-1] & (member[1:] == member[:-1])])
    stops = np.flatnonzero(inside & ~np.r_[inside[1:] & (member[1:] == member[:-1]), False])
    return [(int(member[a]), float(position[a]), float(position[b])) for a, b in zip(starts, stops, strict=True)]


def _merged(stretches: list[tuple[int, float, float]], apart: float) -> list[tuple[int, float, float]]:
    """Return the stretches with those of one member that all but touch as one."""
    merged = stretches[:1]
    for m, a, b in stretches[1:]:
        last = merged[-1]
        if last[0] == m and a - last[2] < apart:
            merged[-1] = (m, last[1], b)
        else:
            merged.append((m, a, b))
    return merged


def _nearest(stretches: list[tuple[int, float, float]], member: IndexArray, position: FloatArray) -> IndexArray:
    """Return for each position (n,) the nearest stretch of its member, -1 where the member has none."""
    away = np.full((len(stretches) + 1, len(position)), np.inf)
    for number, (m, a, b) in enumerate(stretches):
        off = np.maximum(np.maximum(a - position, position - b), 0.0)
        away[number] = np.where(member == m, off, np.inf)
    nearest = np.argmin(away, axis=0)
    return np.where(np.isfinite(away[nearest, np.arange(len(position))]), nearest, -1)


def likeliest_place(member: IndexArray, probability: FloatArray) -> FloatArray:
    """Return the posterior within the most probable stretch of the 95 % region, for many posteriors at once.

    Parameters
    ----------
    member : (n,) number of the member of each of equally spaced positions
    probability : (n_draws, n) posteriors [-]

    Returns
    -------
    (n_draws, n)
        Zero outside the stretch, summing to one.
    """
    falling = np.argsort(-probability, axis=1)
    before = np.cumsum(np.take_along_axis(probability, falling, 1), axis=1) - np.take_along_axis(
        probability, falling, 1
    )
    inside = np.zeros(probability.shape, bool)
    np.put_along_axis(inside, falling, before < HELD, axis=1)
    edge = np.r_[True, member[1:] != member[:-1]]
    starts = inside & (edge | ~np.pad(inside, ((0, 0), (1, 0)))[:, :-1])
    stretch = np.where(inside, np.cumsum(starts, axis=1), 0)
    n_draws, most = len(probability), int(stretch.max()) + 1
    flat = (stretch + most * np.arange(n_draws)[:, None]).ravel()
    held = np.bincount(flat, np.where(inside, probability, 0).ravel(), minlength=n_draws * most).reshape(n_draws, most)
    own = np.where(inside & (stretch == np.argmax(held, axis=1)[:, None]), probability, 0)
    return np.asarray(own / own.sum(axis=1, keepdims=True))

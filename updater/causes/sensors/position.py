"""A sensor that is elsewhere along its member than the structure file states, with all channels of its housing.

Its channels read the modes at the other place, through the shape functions of the elements. Without a baseline its
place in the file is wrong, and frequencies are unchanged. Compared with a baseline it was moved since, together with
its mass.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.sensors.channel_fault import Chain, mounted_together
from updater.inference import Comparison, Effect, Fit, evaluate, no_effect
from updater.quantities import ASKEW_STD, PLACE_STD, Quantity, Where, vector
from updater.reference import Reference
from updater.structure import Body, Member, Structure, size

_STD = 0.15  # m on a frame of 1.5 m: a distance read wrongly, or measured from another edge
_REACH, _TRIED = 3.0, 61  # prior standard deviations to either side, shifts there from which a fit may start
_POINTS = 150  # along a member, between which its modes are interpolated
_MASS_STD = 3e-3  # of the structure's mass: that of a housing, and of the cable that is moved with it
_LEAST_MASS = 1e-3  # of that: less is not written
_HALF_REGION = 1.96  # standard deviations: 95 %


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorPosition(Chain):
    """A housing at another place of a member.

    Parameters are the distance along the member, towards its farther end [m], and, compared with a baseline, the mass
    that was moved with it [kg], how far the first place was from the stated one [m], and about which axes the housing
    is askew [rad]. Its channels then read a share of the motion across them, in the baseline that of the first place.
    """

    members: tuple[Member, ...]  #: member of each alternative
    stated: FloatArray  #: (n_alternatives,) distance of the stated place from the member's start [m]
    sense: FloatArray  #: (n_alternatives,) 1 where the end of the member is farther than its start, else -1
    own: tuple[IndexArray, ...]  #: channels of each
    directions: tuple[FloatArray, ...]  #: (n_own, 3) of the channels of each, times their gains
    translation: tuple[CubicSpline, ...]  #: (3, n_modes) of the reference by that distance
    usual_offset: float  #: standard deviation of a place from the stated one [m]
    name: str = "sensor_position"
    advice: str = "Measure the distance of the sensor from the end of its member."

    @property
    def _most(self) -> FloatArray:
        """Distance to the farther end (n_alternatives,) [m]."""
        length = np.array([member.length for member in self.members])
        return np.maximum(self.stated, length - self.stated)

    @cached_property
    def start(self) -> FloatArray:
        """The shift on the member that fits best: a wave repeats, so that a fit from none may end a wave away."""
        n, step = len(self.lower), np.linspace(-_REACH, _REACH, _TRIED) * self.prior_std[0]
        tried = np.clip(step, self.lower[:, :1], self._most[:, None])  # (n, _TRIED)
        rows = np.repeat(np.arange(n), _TRIED)
        of_shift = replace(self, prior_std=self.prior_std[:1], lower=self.lower[:, :1])
        cost = evaluate(self.comparison, of_shift, tried.reshape(-1, 1), rows).cost.reshape(n, _TRIED)
        start = self.neutral_start
        start[:, 0] = tried[np.arange(n), np.argmin(cost, axis=1)]
        return start

    @property
    def neutral_start(self) -> FloatArray:
        """Start of a fit in addition to other causes: the stated place."""
        return np.zeros(self.lower.shape)

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the modes at the other place, no farther than the end of the member, and the moved mass."""
        n_channels, n_modes = self.comparison.at_channels.shape
        none, moved = no_effect(len(rows), self.comparison), np.zeros((len(rows), n_channels, n_modes))
        mass = np.zeros((len(rows), n_modes, n_modes)) if theta.shape[1] > 1 else none.mass
        for row in np.unique(rows):
            here = np.flatnonzero(rows == row)
            length, along = self.members[row].length, self.sense[row] * theta[here]
            before = np.clip(self.stated[row] + along[:, 2:3].sum(1), 0.0, length)
            now = np.clip(before + along[:, 0], 0.0, length)
            there, gone = (self.translation[row](at) for at in (now, before))
            way = self.directions[row] + self._askew(row, theta[here])
            moved[np.ix_(here, self.own[row])] = way @ (there - gone)
            if theta[here, 1:3].any():
                more = there.transpose(0, 2, 1) @ there - gone.transpose(0, 2, 1) @ gone
                mass[here] = theta[here, 1, None, None] * more
        return replace(none, moved=moved, mass=mass)

    def _askew(self, row: int, theta: FloatArray) -> FloatArray:
        """Return by how much the directions of the channels (len(theta), n_own, 3) of an alternative are off."""
        if theta.shape[1] == 1:
            return np.zeros((len(theta), 1, 3))
        return np.cross(theta[:, None, 3:], self.directions[row])

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction for the moved mass, which is not negative."""
        del rows
        mass, variance = theta[:, 1:2], np.einsum("pkk->pk", covariance)[:, 1:2]
        return np.asarray(np.log(2 * ndtr(mass / np.sqrt(variance))).sum(1))

    def where(self, fit: Fit[Cause]) -> Where:
        """Return the place at which the sensor is, and its channels."""
        row = fit.best
        member, place = self.members[row], self._place(fit.best, fit.theta[fit.best])
        of_place = float(fit.covariance[row][np.ix_(self._of_place, self._of_place)].sum())
        std = self.whole_variance(of_place, self.usual_offset) ** 0.5
        ends = np.clip(place + _HALF_REGION * std * np.array([-1.0, 1.0]), 0.0, member.length)
        return Where(
            member=member.name,
            position=vector(member.point(place)),
            position_std=std,
            region=((vector(member.point(ends[0])), vector(member.point(ends[1]))),),
            channels=self.channels[row],
        )

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return how far the sensor is from its first place, positive towards the end of the member."""
        row, theta, variance = fit.best, fit.theta[fit.best], np.diag(fit.covariance[fit.best])
        of_shift = self.whole_variance(float(variance[0]), self.usual_offset)
        shift = float(self.sense[row] * min(theta[0], self._most[row]))
        found = {"shift": Quantity(value=shift, std=of_shift**0.5, unit="m")}
        if len(self.prior_std) > 1:
            found["moved_mass"] = Quantity(value=float(theta[1]), std=float(np.sqrt(variance[1])), unit="kg")
        return found

    @property
    def _of_place(self) -> IndexArray:
        """Parameters whose sum is the distance from the stated place: the shift, and the error of the first place."""
        return np.array([0, 2] if len(self.prior_std) > 1 else [0])

    def _place(self, row: int, theta: FloatArray) -> float:
        """Return the distance from the member's start [m], on the member."""
        distance = self.stated[row] + self.sense[row] * theta[self._of_place].sum()
        return float(np.clip(distance, 0.0, self.members[row].length))

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the place of the sensors; their mass is one on at that place, and one off where they were."""
        places = float(self.stated[row]), self._place(row, theta)
        here, at = (vector(np.round(self.members[row].point(place), 6)) for place in places)
        if len(theta) > 1 and theta[1] > _LEAST_MASS * self.prior_std[1]:
            mass = float(np.round(theta[1], 6))
            structure = structure.with_bodies([Body(at=at, mass=mass), Body(at=here, mass=-mass)])
        sensors = tuple(
            sensor.model_copy(update={"at": at}) if corrected.channel in self.channels[row] else sensor
            for sensor, corrected in zip(structure.sensor, structure.corrected_sensors, strict=True)
        )
        return structure.model_copy(update={"sensor": sensors})


def propose_sensor_position(reference: Reference, comparison: Comparison) -> SensorPosition | None:
    """Return every housing along every member that passes its place; None if no sensor is on a member."""
    sensors = {s.channel: s for s in reference.structure.corrected_sensors}
    groups = mounted_together(reference, comparison)
    pairs = [(g, m) for g in groups for m in reference.structure.member if m.passes(sensors[g[0]].at)]
    if not pairs:
        return None
    along = {m.name: _modes_along(reference, m) for m in {m.name: m for _, m in pairs}.values()}
    ways = [
        [sensors[c].gain * np.divide(sensors[c].direction, np.linalg.norm(sensors[c].direction)) for c in group]
        for group, _ in pairs
    ]
    stated = np.array([np.linalg.norm(np.subtract(sensors[g[0]].at, m.start)) for g, m in pairs])
    left = np.array([m.length for _, m in pairs]) - stated  # to the end of the member
    lower = -np.maximum(np.minimum(stated, left), 0.0)[:, None]
    if reference.measured:
        lower = np.column_stack([lower, np.zeros(len(lower)), np.full((len(lower), 4), -np.inf)])
    large = size(reference.structure)
    prior_std = np.array([_STD * large, _MASS_STD * reference.model.total_mass(), PLACE_STD * large, *3 * [ASKEW_STD]])
    return SensorPosition(
        prior_std=prior_std[: lower.shape[1]],
        lower=lower,
        comparison=comparison,
        channels=tuple(group for group, _ in pairs),
        members=tuple(member for _, member in pairs),
        stated=stated,
        sense=np.where(left >= stated, 1.0, -1.0),
        own=tuple(np.array([comparison.channels.index(c) for c in group]) for group, _ in pairs),
        directions=tuple(np.array(way) for way in ways),
        translation=tuple(along[m.name] for _, m in pairs),
        usual_offset=PLACE_STD * large,
    )


def _modes_along(reference: Reference, member: Member) -> CubicSpline:
    """Return the translations (3, n_modes) of the reference's modes by the distance along a member."""
    distance = np.linspace(0, member.length, _POINTS)
    rows = reference.model.reader(member.point(distance)) @ reference.shape
    return CubicSpline(distance, rows.reshape(_POINTS, 6, -1)[:, :3])

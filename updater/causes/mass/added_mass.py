"""A rigid body clamped on anywhere, or one taken off: modal mass I + m (Phi_s^T Phi_s + r^2 Theta_s^T Theta_s).

Phi_s are the three translations of the body's centre, which may be off the member's axis. Its two offsets are fitted
with a prior, because where two modes are close (a symmetric column's first two) even a centimetre rotates their planes.
Theta_s are the rotations there, r the body's radius of gyration, equal about all axes: 3 cm change a mode at 400 Hz by
as much as the noise.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.mass.removed_mass import mass_outside_model
from updater.inference import (
    Comparison,
    Effect,
    Fit,
    Magnitude,
    Place,
    PositionPosterior,
    first_order,
    log_uniform,
    most_likely,
    no_effect,
)
from updater.quantities import ECCENTRIC, Quantity, Vector, Where, rounded_value, vector
from updater.reference import Reference
from updater.structure import Body, Member, Structure, fineness, local_axes, size

FINE = 0.001  # m between positions where the posterior is
_COARSE = 0.01  # m between them elsewhere
_MAX = 5000  # positions that are all fitted; of more, on a structure's nodes, the most likely are
_KEPT = 100  # nodes, each of which may be on several members
_NEAR = 30.0  # of log density under the best: a centimetre may hide a posterior of a millimetre
_ARRIVED = 300.0  # log density below the best: alternatives below it may not have converged
_LEFT_OUT = 60.0  # of log density under the best: positions that are not fitted again, e^-60 times as likely
_MAX_FINE = 120  # fine positions on one member
_MAX_FINE_IN_ALL = 480
_FILED = 0.1  # m on a frame of 1.5 m: a body of the file as near as this is the one that was taken off, if as heavy
_LARGE_SHARE = 0.15  # of a mode's mass
MASS_STD = 0.2  # of the structure's mass, Gaussian prior of the body's while it is fitted
_MIN_MASS = 1e-4  # of the structure's mass, the smallest of a body's
LARGEST_REMOVED = 0.1  # share of the structure's mass: largest removed mass
_ACROSS = 1e-6  # direction cosine from which an offset has a component along a global axis
OFFSET_STD = 0.02  # m on a frame of 1.5 m, prior of the offset of a body's centre from the member's axis
_BEGUN_BESIDE = 0.1  # of that, where fits begin
GYRATION_STD = 0.03**2  # m2 on such a frame, prior of its squared radius of gyration


@dataclass(frozen=True, eq=False, kw_only=True)
class AddedMass:
    """One mass at any of many positions; parameters are mass, two offsets and the squared radius of gyration."""

    reference: Reference
    comparison: Comparison
    member: IndexArray  #: (n,) of the structure's members
    position: FloatArray  #: (n,) distance from the member's start [m]
    translation: FloatArray  #: (n, 3, n_modes) of the reference's modes there
    rotation: FloatArray  #: (n, 3, n_modes) [rad/m]
    by_offset: FloatArray  #: (2, n, 3, n_modes) more of it a metre of offset along the two cross axes
    start: FloatArray  #: (n, 4) where the fit begins
    gap: float  #: between positions where they are not finer [m]
    name: str = "added_mass"
    cannot_be_told_from: tuple[str, ...] = ()
    drifting: bool = True
    place_free: bool = False
    advice: str = "Inspect this place. A sensor there, if there is none yet, would make the estimate more precise."

    @cached_property
    def _total(self) -> float:
        return self.reference.model.total_mass()

    @property
    def _fine(self) -> float:
        return FINE * fineness(self.reference.structure)

    @cached_property
    def prior_std(self) -> FloatArray:
        """Mass [kg], offsets [m] and squared radius of gyration [m2]: large structures bear large bodies."""
        large = size(self.reference.structure)
        return np.array([MASS_STD * self._total, large * OFFSET_STD, large * OFFSET_STD, large**2 * GYRATION_STD])

    @property
    def neutral_start(self) -> FloatArray:
        """Start of a fit in addition to other causes: no mass, close to the axis of the member."""
        return self.start * [0.0, 1.0, 1.0, 1.0]

    @property
    def lower(self) -> FloatArray:
        """Lower bounds (n_alternatives, n_parameters): no more mass is removed than there is."""
        return np.tile([-LARGEST_REMOVED * self._total, -np.inf, -np.inf, 0.0], (len(self.position), 1))

    @cached_property
    def weight(self) -> FloatArray:
        """Length that each position represents (n,) [m]; positions between distant ones are improbable."""
        members = np.unique(self.member)
        return np.concatenate([_lengths(self.position[self.member == m], self.gap) for m in members])

    @cached_property
    def log_prior(self) -> FloatArray:
        """Log prior probability (n_alternatives,): uniform along all members [-]."""
        length = sum(member.length for member in self.reference.structure.member)
        return np.asarray(np.log(self.weight / max(self.weight.sum(), length)))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return modal mass changes m (Phi^T Phi + r^2 Theta^T Theta)."""
        moved = self._moved(theta, rows)
        mass = (theta[:, 0, None, None] * moved).transpose(0, 2, 1) @ moved
        return replace(no_effect(len(rows), self.comparison), mass=mass)

    def _moved(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the motion (len(rows), 6, n_modes) of 1 kg with the offsets and gyration of theta [kg^-1/2]."""
        beside = (theta[:, o, None, None] * self.by_offset[o - 1, rows] for o in (1, 2))
        at = self.translation[rows] + sum(beside)
        turn = np.sqrt(np.maximum(theta[:, 3, None, None], 0)) * self.rotation[rows]
        return np.concatenate([at, turn], axis=1)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for the mass's own prior, uniform in its logarithm."""
        del rows
        return self.magnitude(theta[:, 0], np.sqrt(covariance[:, 0, 0])).log_ratio

    def magnitude(self, mass: FloatArray, std: FloatArray) -> Magnitude:
        """Return posteriors of masses under their own prior, from those under the Gaussian one (n,), (n,) [kg]."""
        return log_uniform(
            mass,
            std,
            gaussian=MASS_STD * self._total,
            least=_MIN_MASS * self._total,
            most=self._total,
        )

    def refined(self, log_density: FloatArray, theta: FloatArray) -> "AddedMass | None":
        """Return the likely positions and, where one comes near the best, many more about it.

        They start from the fitted values of neighbouring alternatives that have converged. None if the density is near
        the best everywhere.
        """
        near, kept, arrived = (log_density > log_density.max() - less for less in (_NEAR, _LEFT_OUT, _ARRIVED))
        most = min(_MAX_FINE, _MAX_FINE_IN_ALL // max(len(np.unique(self.member[near])), 1))
        members = np.unique(self.member).tolist()
        spacing = {m: max(self._fine, 2 * self.gap * near[self.member == m].sum() / most) for m in members}
        refined = near & np.array([spacing[m] < self.gap for m in self.member.tolist()])
        if not refined.any():
            return None
        grids, starts = {}, []
        for m in np.unique(self.member[kept]).tolist():
            here, known = ((self.member == m) & which for which in (kept, arrived))
            ends = self.position[self.member == m][[0, -1]]
            grids[m] = _closer(self.position[here], refined[here], self.gap, spacing[m], ends)
            starts.append([np.interp(grids[m], self.position[known], values) for values in theta[known].T])
        return along(self.reference, self.comparison, grids, self.gap, np.concatenate(starts, axis=1).T)

    def everywhere(self, members: Collection[int], spacing: float) -> "AddedMass":
        """Return a position every `spacing` [m] of some members, by their numbers."""
        of = self.reference.structure.member
        steps = {m: max(4, round(of[m].length / spacing)) for m in members}
        grids = {m: np.linspace(0, of[m].length, n + 1) for m, n in steps.items()}
        return along(self.reference, self.comparison, grids, max(float(np.diff(grid).max()) for grid in grids.values()))

    def between(self, rows: IndexArray, parts: int) -> tuple["AddedMass", FloatArray]:
        """Return positions closer together between neighbouring ones, and by how much each is near the given ones.

        Parameters
        ----------
        rows : (n,) alternatives, ascending
        parts : into which a step is divided

        Returns
        -------
        AddedMass
            The given positions, and between those that follow each other.
        FloatArray
            (n_positions, n) weights of a linear interpolation.
        """
        grids: dict[int, list[float]] = {}
        weights = []
        for k, row in enumerate(rows.tolist()):
            member, next_row = int(self.member[row]), int(rows[k + 1]) if k + 1 < len(rows) else -1
            follows = next_row == row + 1 and self.is_on(next_row, member)
            for part in range(parts if follows else 1):
                share = np.zeros(len(rows))
                share[k] = 1 - part / parts
                if part:
                    share[k + 1] = part / parts
                weights.append(share)
                grids.setdefault(member, []).append(float(share @ self.position[rows]))
        start = np.zeros((len(weights), len(self.prior_std)))
        positions = {member: np.array(at) for member, at in grids.items()}
        return along(self.reference, self.comparison, positions, self.gap / parts, start), np.array(weights)

    def nearest(self, member: int, distance: float) -> int:
        """Return the alternative on a member that is nearest to a distance from its start [m]."""
        here = np.flatnonzero(self.member == member)
        return int(here[np.argmin(np.abs(self.position[here] - distance))])

    def is_on(self, row: int, member: int) -> bool:
        """Return whether there is an alternative `row`, and on a member."""
        return 0 <= row < len(self.member) and bool(self.member[row] == member)

    def _member(self, row: int) -> Member:
        return self._member_of(int(self.member[row]))

    def _member_of(self, number: int) -> Member:
        return self.reference.structure.member[number]

    def posterior(self, fit: Fit[Any]) -> PositionPosterior:
        """Return the posterior over positions."""
        return PositionPosterior(
            members=self.reference.structure.member,
            member=self.member,
            position=self.position,
            probability=fit.probability,
            length=self.weight,
            scale=size(self.reference.structure),
            resolution=self._fine,
        )

    def where(self, fit: Fit[Cause]) -> Where:
        """Return mean of the most probable place, and the region."""
        return self.posterior(fit).where

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the mass and the offsets of its centre along global axes, averaged over the positions of its place."""
        place = self.posterior(fit).places[0]
        value, std = self.mass(fit, place)
        offset, offset_std = self._offset(fit, place)
        across = np.abs(self._across(place.member)).max(axis=0) > _ACROSS
        offsets = {
            f"offset_{axis}": Quantity(value=float(offset[k]), std=float(offset_std[k]), unit="m")
            for k, axis in enumerate("xyz")
            if across[k]
        }
        return {"mass": Quantity(value=value, std=std, unit="kg")} | offsets

    def _across(self, member: int) -> FloatArray:
        """Return the cross axes (2, 3) of a member that offsets are along."""
        found = self._member_of(member)
        return found.axes[1:]

    def _offset(self, fit: Fit[Any], place: Place) -> tuple[FloatArray, FloatArray]:
        """Return mean and deviation (3,) of the offset of the centre at a place [m]."""
        across = self._across(place.member)
        value, std = np.array(self._local_offsets(fit, place)).T
        return value @ across, np.sqrt(std**2 @ across**2)

    def at_reported_place(self, fit: Fit[Any], theta: FloatArray) -> tuple["AddedMass", int, FloatArray]:
        """Return the one alternative at the reported place, its row and its start (4,), theta.

        The place is rounded by its deviation; offsets that are not significant are held at zero.
        """
        posterior = self.posterior(fit)
        place = posterior.places[0]
        distance = rounded_value(*posterior.distance(place))
        kept = np.array([abs(mean) > ECCENTRIC * std for mean, std in self._local_offsets(fit, place)], float)
        start = theta * [1.0, *kept, 1.0]
        grid = {place.member: np.array([distance])}
        found = along(self.reference, self.comparison, grid, self.gap, start[None])
        return replace(found, by_offset=found.by_offset * kept[:, None, None, None]), 0, start

    def reported_size(self, fit: Fit[Any], theta: FloatArray) -> FloatArray:
        """Return parameters (4,) with the reported mass and offsets, rounded by their deviations."""
        place = self.posterior(fit).places[0]
        offsets = [
            rounded_value(mean, std) if abs(mean) > ECCENTRIC * std else 0.0
            for mean, std in self._local_offsets(fit, place)
        ]
        return np.array([rounded_value(*self.mass(fit, place)), *offsets, theta[3]])

    def _local_offsets(self, fit: Fit[Any], place: Place) -> list[tuple[float, float]]:
        """Return mean and deviation of each offset along the member's cross axes [m]."""
        return [self.averaged(fit, place, k) for k in (1, 2)]

    def points(self, fit: Fit[Any]) -> FloatArray:
        """Return where each alternative is (n, 3), on its member's axis [m]."""
        del fit
        places = zip(self.member.tolist(), self.position.tolist(), strict=True)
        return np.array([self._member_of(m).point(s) for m, s in places])

    def by_place(self, fit: Fit[Any]) -> list[FloatArray]:
        """Return the probability of each alternative (n,) at each place left open, the most probable place first."""
        return [place.probability * place.share for place in self.posterior(fit).places]

    def mass(self, fit: Fit[Any], place: Place) -> tuple[float, float]:
        """Return mean and standard deviation of the mass at a place [kg]."""
        here = np.flatnonzero(place.share)
        share = place.share[here]
        magnitude = self.magnitude(fit.theta[here, 0], np.sqrt(fit.covariance[here, 0, 0]))
        mean = float(share @ magnitude.mean)
        variance = share @ (magnitude.variance + (magnitude.mean - mean) ** 2)
        std = float(np.hypot(np.sqrt(variance), scale_error(self.reference, self.comparison) * mean))
        row = int(here[np.argmax(share)])
        return self._outside_the_file(row, fit.theta[row], mean, std) if self._is_unlisted(row, mean) else (mean, std)

    def deviations(self, fit: Fit[Any]) -> float:
        """Return by how many standard deviations the mass of the best alternative differs from zero.

        With place, offsets and radius of gyration held: they are undefined without a mass.
        """
        precision = np.linalg.inv(fit.covariance[fit.best])[0, 0]
        return float(abs(fit.theta[fit.best, 0]) * np.sqrt(max(precision, 0.0)))

    def unlisted(self, row: int, theta: FloatArray) -> Body | None:
        """Return a removed body as it was if the reference's model does not have it, else None."""
        mass = float(theta[0])
        whole = self._outside_the_file(row, theta, mass, 0.0)[0] if self._is_unlisted(row, mass) else 0.0
        return self._body(row, theta, -whole) if whole else None

    def removed(self, row: int, theta: FloatArray) -> Body | None:
        """Return a removed body as it was if the reference's model has it, else None."""
        mass = float(theta[0])
        return None if mass >= 0 or self._is_unlisted(row, mass) else self._body(row, theta, -mass)

    def _body(self, row: int, theta: FloatArray, mass: float) -> Body:
        found = self.extend(self.reference.structure, row, theta).body[-1]
        inertia = vector(mass / abs(found.mass) * np.abs(found.inertia))
        return found.model_copy(update={"mass": mass, "inertia": inertia})

    def _is_unlisted(self, row: int, mass: float) -> bool:
        """Return whether a body was removed that the reference's model lacks, since a baseline was measured."""
        if mass >= 0 or not self.reference.measured:
            return False
        structure = self.reference.structure
        near = _FILED * fineness(structure)
        at = self._member(row).point(self.position[row])
        nominal = sum(max(b.mass, 0.0) for b in structure.body if np.linalg.norm(np.subtract(b.at, at)) < near)
        return nominal < -mass / 2

    def _outside_the_file(self, row: int, theta: FloatArray, mass: float, std: float) -> tuple[float, float]:
        """Return mass and deviation [kg] of a removed body that is not in the file, from those taken off the model.

        The correction is known to a third of itself, because the model was calibrated with the body on; of a body that
        is a large share of a mode's mass not even to that.
        """
        moved = self._moved(theta[None], np.array([row]))[0]
        per_kilogram = moved.T @ moved
        whitener, paired = self.comparison.drifting.matrix, self.comparison.paired
        omega = 2 * np.pi * self.reference.frequency
        body = -mass_outside_model(-mass, per_kilogram, omega, paired, whitener)
        share = -mass * float(np.diag(per_kilogram)[paired].max())
        known = 3 if share < _LARGE_SHARE else 1
        return body, float(np.hypot(std * (body / mass) ** 2, (body - mass) / known))

    def averaged(self, fit: Fit[Any], place: Place, parameter: int) -> tuple[float, float]:
        """Return mean and standard deviation of a parameter over the positions of a place."""
        value = fit.theta[:, parameter]
        mean = float(place.share @ value)
        return mean, float(np.sqrt(place.share @ (fit.covariance[:, parameter, parameter] + (value - mean) ** 2)))

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add the body."""
        member = self._member(row)
        offset = theta[1:3] @ member.axes[1:]
        at = vector(member.point(self.position[row]))
        inertia = vector(np.full(3, theta[0] * theta[3]))
        return structure.with_bodies([Body(at=at, mass=float(theta[0]), offset=vector(offset), inertia=inertia)])


def scale_error(reference: Reference, comparison: Comparison) -> float:
    """Return the relative standard deviation of all masses, by the mass of the structure and by the model's mesh."""
    return float(np.hypot(reference.calibration.mass_error, comparison.size_error))


def propose_added_mass(reference: Reference, comparison: Comparison, spacing: float | None = None) -> AddedMass:
    """Return a position every `spacing` [m] of every member; where that is very many, the most likely of the nodes.

    Default: a centimetre if the longest member is 1.5 m long, else in proportion to it.
    """
    members = reference.structure.member
    spacing = _COARSE * size(reference.structure) if spacing is None else spacing
    steps = [max(4, round(member.length / spacing)) for member in members]
    if sum(steps) > _MAX:
        return along(reference, comparison, *_likely_nodes(reference, comparison))
    grids = {i: np.linspace(0, member.length, n + 1) for i, (member, n) in enumerate(zip(members, steps, strict=True))}
    return along(reference, comparison, grids, max(float(np.diff(grid).max()) for grid in grids.values()))


def _likely_nodes(reference: Reference, comparison: Comparison) -> tuple[dict[int, FloatArray], float]:
    """Return distances of the most likely nodes from the starts of the members they are on, and how far nodes are."""
    model, members = reference.model, reference.structure.member
    spans = np.array(model.spans)
    nodes = np.unique(spans)
    moved = np.vstack([reference.shape, np.zeros(reference.shape.shape[1])])[model.dofs[nodes, :3]]  # -1 is held
    nodes = nodes[most_likely(comparison, moved, MASS_STD * model.total_mass(), _KEPT)]
    number = {member.name: i for i, member in enumerate(members)}
    kept = np.isin(spans, nodes)
    found: dict[int, list[int]] = {}
    for span in np.flatnonzero(kept.any(1)).tolist():
        found.setdefault(number[model.member_names[span]], []).extend(spans[span][kept[span]].tolist())
    apart = np.linalg.norm(np.diff(model.nodes[spans], axis=1), axis=2).max()
    return {m: _distances(members[m], model.nodes[n]) for m, n in sorted(found.items())}, float(apart)


def _distances(member: Member, points: FloatArray) -> FloatArray:
    """Return the distances (n,), ascending, of points (n, 3) on a member from its start [m]."""
    return np.unique(np.round(np.linalg.norm(points - member.start, axis=1), 6))


def along(
    reference: Reference,
    comparison: Comparison,
    grids: dict[int, FloatArray],
    gap: float,
    start: FloatArray | None = None,
) -> AddedMass:
    """Return a mass at given distances from the starts of some members, by their numbers.

    Parameters
    ----------
    grids : member -> distances (n,), ascending [m]
    gap : between positions where they are not finer [m]
    start : (n_positions, 4) where the fit begins, members in the order of `grids`; None: to first order
    """
    structure, model = reference.structure, reference.model
    points = np.concatenate([structure.member[i].point(grid) for i, grid in grids.items()])
    here = (model.reader(points) @ reference.shape).reshape(len(points), 6, -1)
    axes = [_axes_of(structure.member[i]) for i in grids]
    across = np.repeat(np.array(axes), [len(grid) for grid in grids.values()], axis=0)
    translation, rotation = here[:, :3], here[:, 3:]
    return AddedMass(
        reference=reference,
        comparison=comparison,
        member=np.concatenate([np.full(len(grid), m, np.intp) for m, grid in grids.items()]),
        position=np.concatenate(list(grids.values())),
        translation=translation,
        rotation=rotation,
        by_offset=np.array([np.cross(rotation, across[:, k, :, None], axis=1) for k in (1, 2)]),
        start=_start(reference, comparison, translation) if start is None else start,
        gap=gap,
    )


def _axes_of(member: Member) -> FloatArray:
    direction = np.subtract(member.end, member.start) / member.length
    return _axes_along(vector(np.round(direction, 12)), member.local_y)


@lru_cache(maxsize=1024)
def _axes_along(direction: Vector, local_y: Vector | None) -> FloatArray:
    """Return the local axes, for many members that point the same way once."""
    return local_axes(np.array(direction), local_y)


def _start(reference: Reference, comparison: Comparison, translation: FloatArray) -> FloatArray:
    """Return d ln f_i = -m/2 sum_a phi_ia^2, fitted to the whitened log frequencies; hardly an offset, no inertia.

    On the axis of a structure that is symmetric about it, the slope with respect to an offset is zero.
    """
    slope = -0.5 * (translation[:, :, comparison.paired] ** 2).sum(1)
    mass = first_order(comparison, slope[:, None])[0][:, 0]
    # where a mass hardly moves there is hardly an effect to divide by: start no farther than the prior reaches
    total = reference.model.total_mass()
    mass = np.clip(mass, -LARGEST_REMOVED * total, MASS_STD * total)
    beside = np.full((len(mass), 2), _BEGUN_BESIDE * size(reference.structure) * OFFSET_STD)
    return np.column_stack([mass, beside, np.zeros(len(mass))])


def _lengths(position: FloatArray, gap: float) -> FloatArray:
    return np.minimum(np.gradient(position), gap) if len(position) > 1 else np.array([gap])


def _closer(position: FloatArray, near: FloatArray, gap: float, spacing: float, ends: FloatArray) -> FloatArray:
    if not near.any():
        return position
    steps = np.arange(-gap, gap + spacing / 2, spacing)
    fine = np.clip((position[near][:, None] + steps).ravel(), *ends)
    return np.unique(np.round(np.concatenate([position, fine]), 6))

"""Several rigid bodies at once, each near a place it starts from: positions are parameters as masses are.

A grid of positions for each of k bodies has (number of positions)^k points. Here a few starting places are taken and
the rest is Gauss-Newton: modes between the grid's positions by cubic splines, so that a position has a derivative.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from scipy.interpolate import CubicSpline

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.causes.mass.added_mass import LARGEST_REMOVED, AddedMass, along
from updater.inference import Effect, no_effect
from updater.structure import fineness

_SPACING = 0.01  # m between the splines' points
_INTERVALS = (4, 2000)  # of one member, at least and at most
PER_BODY = 5  # shift from the start [m], mass [kg], two offsets [m], squared radius of gyration [m2]


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies:
    """Bodies near places; an alternative is a set of places, its parameters `PER_BODY` for each body."""

    grid: AddedMass  #: grid of one mass, with reference and data
    member: IndexArray  #: (n_alternatives, n_bodies)
    place: FloatArray  #: (n_alternatives, n_bodies) distance from the member's start [m]
    start: FloatArray  #: (n_alternatives, n_bodies * PER_BODY) where the fit begins
    drifting: bool = True

    @property
    def n_bodies(self) -> int:
        """Number of bodies."""
        return int(self.member.shape[1])

    def beside(self, free: AddedMass) -> JointHypothesis[AddedMass]:
        """Return one mass at any position with the single alternative; all parameters are fitted jointly."""
        return JointHypothesis(
            free, (SelectedCause(cast(Cause, self), 0, self.start[0]),)
        )  # a fit cannot raise more than that

    @property
    def prior_std(self) -> FloatArray:
        """Those of a shift have the density, 1 / (sqrt(2 pi) std), of a position that is anywhere alike."""
        anywhere = sum(m.length for m in self.grid.reference.structure.member)
        own = [anywhere / np.sqrt(2 * np.pi), *self.grid.prior_std]
        return np.tile(own, self.n_bodies)

    @property
    def lower(self) -> FloatArray:
        """Lower bounds: the start of a member, and no more mass removed than there is."""
        least = np.full((*self.member.shape, PER_BODY), -np.inf)
        least[..., 0] = -self.place
        least[..., 1] = -LARGEST_REMOVED * self.grid.reference.model.total_mass()
        least[..., 4] = 0.0
        return least.reshape(len(self.member), -1)

    @property
    def log_prior(self) -> FloatArray:
        """Prior of unordered bodies: each set of places represents all its orders."""
        return np.full(len(self.member), float(np.log(np.arange(1, self.n_bodies + 1)).sum()))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return modal mass changes sum m (Phi^T Phi + r^2 Theta^T Theta)."""
        found = no_effect(len(rows), self.grid.comparison)
        mass = found.mass
        for k in range(self.n_bodies):
            own = theta[:, k * PER_BODY : (k + 1) * PER_BODY]
            moved = self._moved(self.member[rows, k], self.place[rows, k] + own[:, 0], own[:, 2:])
            mass = mass + own[:, 1, None, None] * (moved.transpose(0, 2, 1) @ moved)
        return replace(found, mass=mass)

    def _moved(self, member: IndexArray, position: FloatArray, rest: FloatArray) -> FloatArray:
        """Return translations of the centres and rotations times the radius of gyration (n, 6, n_modes)."""
        moved = np.empty((len(member), 6, len(self.grid.comparison.frequency)))
        for m in np.unique(member):
            here = np.flatnonzero(member == m)
            spline, length = self._splines[int(m)]
            values = spline(np.clip(position[here], 0, length))
            turn = np.sqrt(np.maximum(rest[here, 2, None, None], 0))
            moved[here, :3] = values[:, :3] + np.einsum(
                "po,poar->par", rest[here, :2], values[:, 6:].reshape(-1, 2, 3, values.shape[2])
            )
            moved[here, 3:] = turn * values[:, 3:6]
        return moved

    @cached_property
    def _splines(self) -> dict[int, tuple[CubicSpline, float]]:
        """Translation, rotation and increments by offsets (12, n_modes) along each member with a body, and its length.

        Not at the grid's positions: of a large structure's those that are unlikely for one mass are left out.
        """
        found, structure = {}, self.grid.reference.structure
        spacing = _SPACING * fineness(structure)
        for m in np.unique(self.member).tolist():
            length = structure.member[m].length
            position = np.linspace(0, length, int(np.clip(round(length / spacing), *_INTERVALS)) + 1)
            here = along(self.grid.reference, self.grid.comparison, {m: position}, float(position[1]))
            values = np.concatenate([here.translation, here.rotation, *here.by_offset], axis=1)
            found[m] = CubicSpline(position, values), length
        return found

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for the masses' own priors, each by its own deviation."""
        del rows
        mass = theta.reshape(-1, PER_BODY)[:, 1]
        variance = np.diagonal(covariance, axis1=1, axis2=2).reshape(-1, PER_BODY)[:, 1]
        found = self.grid.magnitude(mass, np.sqrt(variance)).log_ratio
        return np.asarray(found.reshape(len(theta), self.n_bodies).sum(1))

    def refined(self, log_density: FloatArray, theta: FloatArray) -> None:
        """Positions are parameters already."""
        del log_density, theta

    def at(self, row: int, theta: FloatArray, left_out: int | None) -> "Bodies":
        """Return one alternative, of all bodies or of all but one, where a fit has brought them.

        Parameters
        ----------
        row, theta : the alternative and its parameters (n_bodies * PER_BODY,)
        left_out : the body that is left out, if any
        """
        kept = [k for k in range(self.n_bodies) if k != left_out]
        own = theta.reshape(self.n_bodies, PER_BODY)[kept].copy()
        place = self.place[row, kept] + own[:, 0]
        own[:, 0] = 0.0
        return replace(self, member=self.member[row, kept][None], place=place[None], start=own.reshape(1, -1))

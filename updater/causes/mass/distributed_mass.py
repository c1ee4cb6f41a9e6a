"""Mass distributed over a stretch of a member, or removed from it: snow, water, a cable, ice.

Modal mass I + m / e int (Phi^T Phi + g r^2 Theta^T Theta) dx over the stretch of length e: Phi the modes'
displacements, Theta their rotations in the member's axes, r the section's radii of gyration; g is 1 if it lies as the
material does, less for water in a pipe and more for ice on it.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.mass.added_mass import LARGEST_REMOVED, MASS_STD, scale_error
from updater.causes.member_grid import Cells, cut
from updater.causes.stretches import WITHIN, Kinds, Spread, begun, everywhere, may_be_cut
from updater.inference import Comparison, Effect, Fit, first_order, log_uniform, no_effect
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Segment, Structure

_MIN = 1e-4  # of the structure's mass
_GYRATION_STD = 0.7  # relative to g: the distribution of a load around the axis is unknown
_REMOVABLE = 0.9  # of a stretch's own mass
#: from a sixth of the longest member to all of it: a shorter one is a body
_LENGTHS = Kinds(
    size={70: 70, 120: 120, 220: 220},
    step={70: 20, 120: 30, 220: 40},
    about={70: (50, 60, 72, 86), 120: (104, 124, 150), 220: (180, 216, 260, 300)},
)


@dataclass(frozen=True, eq=False, kw_only=True)
class DistributedMass(Spread):
    """Stretches of all members; parameters are the mass [kg], the shift, the length and g - 1."""

    #: (2, n_edges, n_modes, n_modes) modal mass of 1 kg/m from each member's start, as it moves, and as it turns about
    #: axes as far as the material's
    mass: FloatArray
    own: FloatArray  #: (n_members,) mass of each member over its length [kg/m]
    name: str = "distributed_mass"
    advice: str = "Inspect this part of the member for loads on it or attached to it."

    @property
    def _total(self) -> float:
        return self.reference.model.total_mass()

    @property
    def prior_std(self) -> FloatArray:
        """Of the mass [kg], the shift, the length and how it lies about the axis."""
        return np.array([MASS_STD * self._total, WITHIN, WITHIN, _GYRATION_STD])

    @property
    def lower(self) -> FloatArray:
        """Not more mass can be removed than exists."""
        there = _REMOVABLE / 1.5 * self.own[self.member] * self.size * self.cells.length[self.member]
        least = np.full((len(there), 4), -np.inf)
        least[:, 0] = -np.minimum(there, LARGEST_REMOVED * self._total)
        least[:, 3] = -1.0
        return least

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return modal mass changes."""
        along = theta[:, 0] / (self.sizes(theta, rows) * self.cells.length[self.member[rows]])
        return replace(no_effect(len(rows), self.comparison), mass=along[:, None, None] * self.per_metre(theta, rows))

    def per_metre(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the modal mass (len(rows), n_modes, n_modes) of 1 kg/m over the stretches."""
        turned = np.stack([np.ones(len(theta)), 1 + theta[:, 3]], axis=1)
        return self.matrix(self.mass, turned, theta, rows)

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a mass of any order of magnitude."""
        del rows
        std, most = np.sqrt(covariance[:, 0, 0]), self._total
        return log_uniform(theta[:, 0], std, gaussian=MASS_STD * most, least=_MIN * most, most=most).log_ratio

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the mass in all and the length over which it is spread."""
        mass = self.averaged(fit, fit.theta[:, 0], np.sqrt(fit.covariance[:, 0, 0]))
        std = float(np.hypot(mass[1], scale_error(self.reference, self.comparison) * mass[0]))
        extent = self.averaged(fit, *self.extents(fit))
        return {
            "mass": Quantity(value=mass[0], std=std, unit="kg"),
            "extent": Quantity(value=extent[0], std=extent[1], unit="m"),
        }

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Add a segment of the stretch's mass; a removed mass removes at most the existing rotary inertia."""
        member, at, extent = self.stretch(row, theta)
        mass, gyration = float(theta[0]), float(1 + theta[3])
        if mass < 0:
            gyration = min(gyration, self.own[self.member[row]] * extent / -mass)
        segment = Segment(member=member, at=at, extent=extent, mass=mass, gyration=gyration)
        return structure.model_copy(update={"segment": (*structure.segment, segment)})


def propose_distributed_mass(reference: Reference, comparison: Comparison) -> DistributedMass | None:
    """Return stretches of a few lengths every few centimetres; none of very many members or of matrices."""
    structure = reference.structure
    if not may_be_cut(structure):
        return None
    cells, mass = _mass(reference)
    own = [structure.material[m.material].density * structure.section[m.section].area for m in structure.member]
    found = DistributedMass(
        reference=reference,
        comparison=comparison,
        cells=cells,
        kinds=_LENGTHS,
        mass=mass,
        own=np.array(own),
        **everywhere(cells, _LENGTHS, 4),
    )
    return begun(found, _start(found))


def _start(cause: DistributedMass) -> tuple[FloatArray, FloatArray]:
    """Return d ln f_i = -m/2 dM_ii, fitted to the log frequencies."""
    comparison = cause.comparison
    per_metre = cause.per_metre(cause.start, np.arange(len(cause.member)))
    heavier = np.diagonal(per_metre, axis1=1, axis2=2)[:, comparison.paired]
    slope = -0.5 * heavier / (cause.size * cause.cells.length[cause.member])[:, None]
    mass, explained = first_order(comparison, slope[:, None])
    return np.clip(mass[:, 0], cause.lower[:, 0] / 2, cause.prior_std[0]), explained


@lru_cache(maxsize=4)
def _mass(reference: Reference) -> tuple[Cells, FloatArray]:
    """Return the modal mass of all stretches if they weighed a kilogram a metre: as it moves, and as it turns."""
    structure, model = reference.structure, reference.model
    cells, ways, turns = cut(structure.member), [], []
    for m, member in enumerate(cells.members):
        section = structure.section[member.section]
        gyration = np.array([sum(section.second_moment), *section.second_moment]) / section.area
        axes = member.axes
        moved = (model.reader(member.point(cells.middles(m))) @ reference.shape).reshape(cells.count[m], 6, -1)
        ways.append(moved[:, :3])
        turns.append(np.sqrt(gyration)[:, None] * (axes @ moved[:, 3:]))
    return cells, np.stack([cells.summed(ways), cells.summed(turns)])

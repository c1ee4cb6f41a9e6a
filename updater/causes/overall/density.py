"""One factor on the density of all members; attached bodies keep their mass."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.overall.common_factor import CommonFactor, stiffened
from updater.inference import Comparison, Effect, Fit, no_effect
from updater.quantities import Quantity
from updater.reference import Reference, best_model
from updater.structure import Structure

_NO_MASS = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalDensity(CommonFactor):
    """All members grow heavier alike: frequencies by the root of it, but for bodies."""

    own: FloatArray  #: (n_modes, n_modes) modal mass of the members, bodies left out
    name: str = "global_density"
    advice: str = "Weigh the structure, or clamp a known mass on: it lowers the frequencies of a heavier one less."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the members' modal mass times the factor on density, less one."""
        mass = np.expm1(-2 * self.log_factor(theta))[:, None, None] * self.own
        return replace(no_effect(len(rows), self.comparison), mass=mass)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the gain of density, negative where it has fallen."""
        value, std = self.found(fit)
        factor = float(np.exp(-2 * value))
        return {"gain": Quantity(value=factor - 1, std=2 * factor * std, unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Scale all densities; matrices from elsewhere become softer instead, which gives the same frequencies."""
        del row
        factor = float(np.exp(-2 * self.log_factor(theta)))
        if structure.external is not None:
            return stiffened(structure, 1 / factor)
        material = {
            name: m.model_copy(update={"density": m.density * factor}) for name, m in structure.material.items()
        }
        return structure.model_copy(update={"material": material})


def propose_global_density(reference: Reference, comparison: Comparison) -> GlobalDensity:
    """Return the one alternative."""
    return GlobalDensity(comparison=comparison, own=_mass_of_members(reference))


@lru_cache(maxsize=4)
def _mass_of_members(reference: Reference) -> FloatArray:
    """Return the modal mass (n_modes, n_modes) without bodies, oscillators, segments' own mass and grounds."""
    structure = reference.structure
    if structure.external is not None or not (
        structure.body or structure.oscillator or structure.segment or structure.ground
    ):
        return np.eye(len(reference.frequency))
    segments = tuple(s.model_copy(update={"mass": 0.0}) for s in structure.segment)
    # grounds keep their degrees of freedom, without mass
    grounds = tuple(g.model_copy(update={"mass": _NO_MASS * g.mass}) for g in structure.ground)
    alone = structure.model_copy(update={"body": (), "oscillator": (), "segment": segments, "ground": grounds})
    bare = best_model(alone).mass
    shape = reference.shape[: bare.shape[0]]  # oscillators' own come last
    return np.asarray(shape.T @ (bare @ shape))

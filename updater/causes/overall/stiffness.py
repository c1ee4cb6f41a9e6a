"""One factor on Young's and the shear modulus of all members and on all joints; the ground keeps its own."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.causes.base import Cause
from updater.causes.overall.common_factor import OwnFactor, ground_compliance, stiffened
from updater.inference import Comparison, Fit
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Structure


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalStiffness(OwnFactor):
    """All stiffness changes alike, and frequencies by the root of it."""

    name: str = "global_stiffness"
    advice: str = (
        "Record temperature and a tone of known frequency during the next log. A known added mass distinguishes "
        "stiffness from density."
    )

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the loss of stiffness, negative where it has grown."""
        value, std = self.found(fit)
        factor = float(np.exp(2 * value))
        return {"loss": Quantity(value=1 - factor, std=2 * factor * std, unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Scale all materials and joints."""
        del row
        return stiffened(structure, float(np.exp(2 * self.log_factor(theta))), ground=False)


def propose_global_stiffness(reference: Reference, comparison: Comparison) -> GlobalStiffness:
    """Return the one alternative."""
    return GlobalStiffness(comparison=comparison, ground=ground_compliance(reference))

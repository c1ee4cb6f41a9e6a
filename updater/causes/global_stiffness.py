"""One factor on Young's and the shear modulus of all members: every frequency by its square root, shapes as before."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Discrete
from updater.comparison import Comparison
from updater.reanalysis import Effect, no_effect
from updater.reference import Reference
from updater.structure import Structure
from updater.verdict import Quantity

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

_STD = 0.05  # of the factor's logarithm


@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalStiffness(Discrete):
    """One alternative; its parameter is the factor's logarithm."""

    comparison: Comparison
    name: str = "global_stiffness"
    place_free: bool = True
    advice: str = "Record temperature, and a tone of known frequency, beside the next log: one record cannot tell."

    @property
    def cannot_be_told_from(self) -> tuple[str, ...]:
        """One factor on all frequencies has four makers that one record cannot tell apart."""
        return ("global_density", "temperature", "sampling_clock")

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the flexibility over the factor."""
        flexibility = np.diag((2 * np.pi * self.comparison.frequency) ** -2.0)
        return replace(no_effect(len(rows), self.comparison), flexibility=np.expm1(-theta[:, :, None]) * flexibility)

    def where(self, fit: "Fit[Cause]") -> None:
        """Return none: it is everywhere."""

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
        """Return the loss of stiffness, negative where it has grown."""
        factor = float(np.exp(fit.theta[0, 0]))
        return {"loss": Quantity(value=1 - factor, std=factor * float(fit.covariance[0, 0, 0] ** 0.5), unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Scale all materials and springs."""
        factor = float(np.exp(theta[0]))
        material = {
            name: m.model_copy(
                update={"youngs_modulus": m.youngs_modulus * factor, "shear_modulus": m.shear_modulus * factor}
            )
            for name, m in structure.material.items()
        }
        springs = {
            kind: tuple(
                part.model_copy(update={"stiffness": {axis: k * factor for axis, k in part.stiffness.items()}})
                for part in parts
            )
            for kind, parts in (("support", structure.support), ("joint", structure.joint))
        }
        external = structure.external
        if external is not None:
            external = external.model_copy(update={"factor": external.factor * factor})
        return structure.model_copy(update={"external": external, "material": material, **springs})


def propose_global_stiffness(reference: Reference, comparison: Comparison) -> GlobalStiffness:
    """Return the one alternative."""
    del reference
    return GlobalStiffness(
        prior_std=np.array([_STD]), lower=np.full((1, 1), -np.inf), drifting=False, comparison=comparison
    )

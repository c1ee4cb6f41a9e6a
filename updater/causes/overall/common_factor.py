"""One factor on all frequencies without a change of shapes: common part of its four causes.

Stiffness, density, temperature and the sampling clock have the same effect in one record. Each has the same wide prior,
so that none is preferred without further data. Known circumstances (a temperature, a tone) give a narrow prior for one
of them, which distinguishes it.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause, Discrete
from updater.causes.modal_loads import modal_spring_force
from updater.fe import self_stress
from updater.inference import Effect, Fit, no_effect
from updater.reference import Reference
from updater.structure import Structure

COMMON_FACTOR_STD = 0.025  # of ln f: stiffness or density known to 5 %


@dataclass(frozen=True, eq=False, kw_only=True)
class CommonFactor(Discrete):
    """One alternative; its parameter is the standard score of the logarithm of the factor on frequencies."""

    prior_std: FloatArray = field(default_factory=lambda: np.ones(1))
    lower: FloatArray = field(default_factory=lambda: np.full((1, 1), -np.inf))
    centre: float = 0.0  #: prior mean of that logarithm
    spread: float = COMMON_FACTOR_STD  #: its prior standard deviation
    place_free: bool = True
    instrument: str = ""  #: what would measure the factor during both records, if anything

    def reading(self, theta: FloatArray) -> float:
        """Return the factor of parameters (1,) that the instrument would measure, in its standard deviations."""
        del theta
        return 0.0

    @property
    def informed(self) -> bool:
        """True if data other than the modes determine the factor."""
        return self.spread < COMMON_FACTOR_STD

    def log_factor(self, theta: FloatArray) -> FloatArray:
        """Return ln of the factor on frequencies (...) of parameters (..., 1)."""
        return np.asarray(self.centre + self.spread * theta[..., 0])

    def found(self, fit: Fit[Cause]) -> tuple[float, float]:
        """Return the logarithm of the factor on frequencies, and its standard deviation."""
        return float(self.log_factor(fit.theta[0])), self.spread * float(fit.covariance[0, 0, 0] ** 0.5)

    @property
    def compliance(self) -> FloatArray:
        """Compliance (n_modes + n_stress, same) affected by the factor: Lambda^-1 in modes [s2]."""
        own = (2 * np.pi * self.comparison.frequency) ** -2.0
        return np.diag(np.concatenate([own, np.ones(self.comparison.n_stress)]))

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the compliance over the squared factor."""
        change = np.expm1(-2 * self.log_factor(theta))[:, None, None] * self.compliance
        return replace(no_effect(len(rows), self.comparison), compliance=change)


@dataclass(frozen=True, eq=False, kw_only=True)
class OwnFactor(CommonFactor):
    """Factor on the structure itself, without the ground."""

    ground: FloatArray  #: (n_modes + n_stress, same) compliance of the springs to the ground

    @property
    def compliance(self) -> FloatArray:
        """Compliance (n_modes + n_stress, same) of members and joints."""
        return super().compliance - self.ground


def ground_compliance(reference: Reference) -> FloatArray:
    """Return the compliance (n_modes + n_stress, same) of the springs to the ground.

    Of a spring k that bears f_r in a mode over omega_r^2, f_r f_s / k.
    """
    model = reference.model
    stress = self_stress(model)
    found = np.zeros(2 * (len(reference.frequency) + stress.n,))
    for support in reference.structure.support:
        for axis, stiffness in support.stiffness.items():
            force = modal_spring_force(reference, support, axis, model.support_rows(support.at, axis))
            found += np.outer(force, force) / stiffness
    return found


def stiffened(structure: Structure, factor: float, *, ground: bool = True) -> Structure:
    """Return a structure with stiffer materials and springs, those to the ground only on request."""
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
        for kind, parts in (("support", structure.support if ground else ()), ("joint", structure.joint))
        if parts
    }
    own = tuple(o.model_copy(update={"frequency": o.frequency * factor**0.5}) for o in structure.oscillator)
    external = structure.external
    if external is not None:
        external = external.with_factor("", factor)
    return structure.model_copy(update={"external": external, "material": material, "oscillator": own, **springs})

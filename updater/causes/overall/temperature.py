"""Steel grows softer as it grows warmer: -dE/E = 3 to 4 parts in 10,000 a kelvin. Joints do with it, the ground not.

Without a thermometer, any change of temperature explains one factor on all frequencies. With one, the factor follows
from it, to the accuracy of the law.

References
----------
Ledbetter, H. M. (1981). Stainless-steel elastic constants at low temperatures. J. Appl. Phys. 52, 1587-1589.
Xia, Y. et al. (2012). Temperature effect on vibration properties of civil structures: a literature review and case
studies. J. Civil Struct. Health Monit. 2, 29-46.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.overall.common_factor import (
    COMMON_FACTOR_STD,
    OwnFactor,
    ground_compliance,
    stiffened,
)
from updater.inference import Comparison, Fit
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Structure

SOFTENING = 3.5e-4  # 1/K, of Young's modulus
SOFTENING_STD = 0.5e-4  # 1/K: thermal expansion, joints, and sensors that sit elsewhere than the steel
_THERMOMETER_STD = 0.7  # K, of a difference
_USUAL, _BEYOND = 40.0, 10.0  # K of a change without a thermometer (EN 1991-1-5, 6.1.3), and how far others go beyond
_MIN_WARMER = 1.0  # K, below which no softening per kelvin is stated


@dataclass(frozen=True, eq=False, kw_only=True)
class Temperature(OwnFactor):
    """The structure is warmer or colder."""

    warmer: float  #: measured temperature rise [K], NaN if unknown
    name: str = "temperature"
    instrument: str = "A thermometer during both records"
    advice: str = "Record at another temperature, with a thermometer on the structure."

    def reading(self, theta: FloatArray) -> float:
        """Return the factor over the error of a thermometer and of the law."""
        factor = float(self.log_factor(theta))
        return factor / float(np.hypot(0.5 * SOFTENING * _THERMOMETER_STD, factor * SOFTENING_STD / SOFTENING))

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the correction of the evidence for a change of temperature that is larger than usual."""
        del covariance, rows
        if np.isfinite(self.warmer):
            return np.zeros(len(theta))
        warmer = np.abs(2 * self.log_factor(theta) / SOFTENING)
        return np.asarray(-0.5 * (np.maximum(warmer - _USUAL, 0.0) / _BEYOND) ** 2)

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the temperature rise; with a thermometer, also the loss of stiffness over mass per kelvin."""
        value, std = self.found(fit)
        warmer = -2 * value / SOFTENING
        if abs(self.warmer) > _MIN_WARMER:
            softening = Quantity(value=-2 * value / self.warmer, std=2 * std / abs(self.warmer), unit="1/K")
            measured = Quantity(value=self.warmer, std=self.comparison.circumstances.warmer_std, unit="K")
            return {"warmer": measured, "softening": softening}
        spread = float(np.hypot(2 * std / SOFTENING, warmer * SOFTENING_STD / SOFTENING))
        return {"warmer": Quantity(value=warmer, std=spread, unit="K")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Scale all materials and joints to their values at this temperature."""
        del row
        return stiffened(structure, float(np.exp(2 * self.log_factor(theta))), ground=False)


def propose_temperature(reference: Reference, comparison: Comparison) -> Temperature:
    """Return the single alternative, determined by thermometers if there are any."""
    known = comparison.circumstances
    centre, spread = 0.0, COMMON_FACTOR_STD
    if np.isfinite(known.warmer):
        centre = -0.5 * SOFTENING * known.warmer
        spread = 0.5 * float(np.hypot(SOFTENING_STD * known.warmer, SOFTENING * known.warmer_std))
    return Temperature(
        comparison=comparison,
        ground=ground_compliance(reference),
        centre=centre,
        spread=spread,
        warmer=known.warmer,
    )

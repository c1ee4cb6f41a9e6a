"""Sensitivity of natural frequencies to the model parameters that may be updated."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.reference.calibration import best_model
from updater.reference.sensitivity_method import frequency_slope
from updater.structure import (
    FACTORS,
    ModelParameter,
    Structure,
    apply_parameters,
    model_parameters_of,
    nominal_parameters,
    physical_unit,
    physical_value,
    starts_rigid,
    with_springs,
)

_FACTORS = {"stiffness", *FACTORS}  # kinds of which the logarithm is fitted
_RELATIVE_STEP = 1e-3  # of a flexibility or of ln E, in the central difference of the stiffness matrix
_WELD_STEP = 1e-3  # of the share of its flexibility that a joint zone loses
_WALL_STEP = 1e-5  # of the prior deviation of a wall's flexibility: far less than that of its segment without springs


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterSensitivity:
    """One model parameter and its effect on the natural frequencies, to first order."""

    name: str  #: name as in `Updating.fixed`, such as `steel.E` or `support 0.ry`
    unit: str  #: unit of `nominal` and `step`
    nominal: float  #: value in the structure file; infinite for a rigid connection
    step: float  #: value one prior standard deviation on the side that the slope is taken to: softer, or stiffer welds
    change: FloatArray  #: (n_modes,) relative change of each frequency by that step [-]


def parameter_sensitivities(structure: Structure, n_modes: int) -> tuple[FloatArray, list[ParameterSensitivity]]:
    """Return the model's frequencies (n_modes,) [Hz] and their sensitivity to every parameter that may be updated.

    The change of omega^2 is b^T (dK - omega^2 dM) b for mass-normalised modes b (Fox & Kapoor 1968), with dK and dM by
    central differences of the matrices. A rigid connection has a flexibility so small that it changes no frequency.
    """
    knobs = model_parameters_of(structure, of_file=True)
    sprung = with_springs(structure)
    nominal = nominal_parameters(knobs)
    welds = np.array([knob.kind == "weld" for knob in knobs], bool)
    x = np.where(welds, 2 * _WELD_STEP, nominal)
    model = best_model(apply_parameters(sprung, knobs, x))
    modes = model.modes(n_modes)
    found = []
    for i, knob in enumerate(knobs):
        h = _difference_step(knob, x[i])
        upper, lower = (best_model(apply_parameters(sprung, knobs, _moved(x, i, sign * h))) for sign in (1, -1))
        by_stiffness = (upper.stiffness - lower.stiffness) @ modes.shape
        by_mass = (upper.mass - lower.mass) @ modes.shape * modes.omega**2
        slope = frequency_slope(modes.omega, modes.shape, (by_stiffness - by_mass) / (2 * h))
        moved = -knob.prior if knob.kind in _FACTORS and knob.lower < 0 else min(knob.prior, knob.upper)
        found.append(
            ParameterSensitivity(
                name=knob.key,
                unit=physical_unit(structure, knob),
                nominal=_nominal_value(structure, knob),
                step=physical_value(structure, knob, (0.0 if starts_rigid(knob) else knob.mean) + moved),
                change=slope * moved,
            )
        )
    return modes.frequency, found


def _nominal_value(structure: Structure, knob: ModelParameter) -> float:
    """Return the value of the structure file in physical units; infinite where it has a connection rigid."""
    if starts_rigid(knob):
        return float("inf")
    return physical_value(structure, knob, knob.mean)


def _difference_step(knob: ModelParameter, value: float) -> float:
    if knob.kind == "weld":
        return _WELD_STEP
    if knob.kind == "wall":
        return _WALL_STEP * knob.prior
    return _RELATIVE_STEP if knob.kind in _FACTORS or not value else _RELATIVE_STEP * value


def _moved(x: FloatArray, i: int, by: float) -> FloatArray:
    moved = x.copy()
    moved[i] += by
    return moved

"""True structures that differ in kind from the reference model, and their measured modes."""

from functools import lru_cache

import numpy as np

from oma import ModalEstimate
from updater import Body, Model, Structure, build_model, parse_structure, t_structure_toml
from updater.fe import Modes
from updater.structure import Joint, Support


def t_frame() -> Structure:
    return parse_structure(t_structure_toml())


def true_model(random: np.random.Generator, body: Body | None = None) -> Model:
    """10 mm Timoshenko elements, consistent mass, flexible foot and joint, E and rho off."""
    structure = t_frame()
    steel = structure.material["steel"]
    stiffness, density = 1 + 0.015 * random.standard_normal(), 1 + 0.007 * random.standard_normal()
    material = steel.model_copy(
        update={
            "youngs_modulus": steel.youngs_modulus * stiffness,
            "shear_modulus": steel.shear_modulus * stiffness,
            "density": steel.density * density,
        }
    )
    unit = steel.youngs_modulus * 9.3e-8 / 1.48
    springs = {axis: unit / random.uniform(0.001, 0.01) for axis in ("rx", "ry", "rz")}
    joint = {axis: unit / random.uniform(0.001, 0.01) for axis in ("rx", "ry", "rz")}
    changed = structure.model_copy(
        update={
            "material": {"steel": material},
            "support": (Support.model_validate({"at": (0, 0, 0), "fixed": ("x", "y", "z"), "stiffness": springs}),),
            "joint": (Joint.model_validate({"member": "crossbeam", "at": (0, 0, 1.48), "stiffness": joint}),),
            "body": (body,) if body else (),
        }
    )
    return build_model(changed.with_mesh(0.01), shear_flexible=True, mass="consistent")


@lru_cache(maxsize=2)  # the windows of a state have their modes in common
def _modes(model: Model, n_modes: int) -> Modes:
    return model.modes(n_modes)


def measure(
    model: Model,
    random: np.random.Generator,
    gain: np.ndarray,
    *,
    noise: float = 1e-3,
    shape_noise: float = 3e-3,
    n_modes: int = 8,
) -> ModalEstimate:
    """Modes as identified: relative noise of frequency falls with sqrt(f), as the law states.

    Damping and the shapes' imaginary parts, which are noise alone, have draws of their own.
    """
    modes = _modes(model, n_modes)
    shape = (model.sensor_rows @ modes.shape).T * gain
    shape = shape / np.linalg.norm(shape, axis=1, keepdims=True)
    std = noise * np.sqrt(10 / modes.frequency)
    own = random.spawn(1)[0]
    return ModalEstimate(
        channels=model.structure.channels,
        frequency=modes.frequency * (1 + std * random.standard_normal(n_modes)),
        frequency_std=std * modes.frequency,
        damping=0.004 * (1 + 0.1 * own.standard_normal(n_modes)),
        damping_std=np.full(n_modes, 0.0004),
        shape=shape + shape_noise * (random.standard_normal(shape.shape) + 1j * own.standard_normal(shape.shape)),
        shape_std=np.full(shape.shape, shape_noise),
        support=np.ones(n_modes),
        law_ratio=np.ones(n_modes),
        start=0,
        end=60_000_000_000,
    )

"""Structures with known answers, and estimates of modes with known errors."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from oma import ModalEstimate
from updater import Body, Model, Structure, build_model, parse_structure, t_structure_toml
from updater.fe import Modes
from updater.structure import Joint, Support

#: crack of the T-frame that opens under half a standard deviation of the moment, on the negative side
COLUMN_CRACK = """
[[breathing_crack]]
member = "column"
at = [0.0, 0.0, 0.3]
axis = "y"
flexibility = 0.05
mean = 0.0155
moment = -0.0016
opens = "below"
"""

#: line of 1 m without mass, 1e5 N/m along
LINE = """
name = "rod"
[material.light]
youngs_modulus = 1e9
shear_modulus = 4e8
density = 1e-6
[section.s]
area = 1e-4
second_moment = [1e-7, 1e-7]
torsion_constant = 1e-7
[[member]]
name = "rod"
from = [0, 0, 0]
to = [1, 0, 0]
material = "light"
section = "s"
elements = 1
"""

#: it holds 2 kg, which move along it alone, from a clamp
ROD = f"""{LINE}
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
[[support]]
at = [1, 0, 0]
fixed = ["y", "z", "rx", "ry", "rz"]
[[body]]
at = [1, 0, 0]
mass = 2.0
"""

ALL: tuple[Literal["x", "y", "z", "rx", "ry", "rz"], ...] = ("x", "y", "z", "rx", "ry", "rz")
N_MODES = 8


def t_frame() -> Structure:
    """Return the shipped T-frame."""
    return parse_structure(t_structure_toml())


def beam(
    *,
    length: float,
    elements: int,
    support: tuple[Support, ...],
    modulus: float = 1.0,
    shear_modulus: float = 0.4,
    density: float = 1.0,
    area: float = 1.0,
    second_moment: tuple[float, float] = (1e-9, 4e-9),
    torsion_constant: float = 1e-9,
    shear_factor: float = 5 / 6,
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0),
) -> Structure:
    """Return one straight member from the origin."""
    end = np.asarray(direction) / np.linalg.norm(direction) * length
    return Structure.model_validate(
        {
            "name": "beam",
            "material": {"m": {"youngs_modulus": modulus, "shear_modulus": shear_modulus, "density": density}},
            "section": {
                "s": {
                    "area": area,
                    "second_moment": second_moment,
                    "torsion_constant": torsion_constant,
                    "shear_factor": shear_factor,
                }
            },
            "member": [
                {"name": "b", "from": (0, 0, 0), "to": end.tolist(), "material": "m", "section": "s"}
                | {"elements": elements}
            ],
            "support": support,
        }
    )


def clamped() -> tuple[Support, ...]:
    """Return a clamp at the origin."""
    return (Support(at=(0, 0, 0), fixed=ALL),)


def all_modes(model: Model) -> Modes:
    """Return every mode of a small model with a regular mass matrix, densely."""
    return model.modes(model.n_dofs)


def of_axis(model: Model, modes: Modes, axis: int) -> FloatArray:
    """Return the frequencies of the modes whose kinetic energy is in one of the six directions of the nodes."""
    dofs = model.dofs[:, axis][model.dofs[:, axis] >= 0]
    share = (modes.shape * (model.mass @ modes.shape))[dofs].sum(0)
    return np.asarray(modes.frequency[share > 0.9])


def as_estimate(
    frequency: npt.ArrayLike,
    shape: npt.ArrayLike,
    *,
    channels: tuple[str, ...],
    frequency_std: npt.ArrayLike = 1e-3,
    shape_std: float = 1e-3,
) -> ModalEstimate:
    """Return an estimate with the given modes, shapes (n_modes, n_channels) at unit norm."""
    f, s = np.asarray(frequency, float), np.asarray(shape, complex)
    return ModalEstimate(
        channels=channels,
        frequency=f,
        frequency_std=np.broadcast_to(np.asarray(frequency_std, float), f.shape),
        damping=np.full(len(f), 0.004),
        damping_std=np.full(len(f), 0.001),
        shape=s / np.linalg.norm(s, axis=1, keepdims=True),
        shape_std=np.full(s.shape, shape_std),
        support=np.ones(len(f)),
        law_ratio=np.ones(len(f)),
        start=0,
        end=60 * 10**9,
    )


def unmoved(n_windows: int, n_tracks: int = N_MODES) -> list[IndexArray]:
    """Return tracks of windows whose modes are all in order."""
    return [np.arange(n_tracks, dtype=np.intp)] * n_windows


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """A real T-frame: not the reference model, and its sensors' gains scatter."""

    seed: int
    structure: Structure
    gain: FloatArray  # (n_channels,)

    def model(self, body: Body | None = None) -> Model:
        """Return Timoshenko elements of 10 mm with consistent mass, with a body added or not."""
        structure = self.structure.with_bodies([body] if body else [])
        return build_model(structure, shear_flexible=True, mass="consistent")

    def windows(
        self, modes: Modes, sensor_rows: FloatArray, n: int, seed: int, noise: float = 1.0
    ) -> list[ModalEstimate]:
        """Return estimates with errors by the uncertainty law (0.1 % at 10 Hz) and 0.3 % of unit norm on shapes."""
        random = np.random.default_rng(seed)
        std, shape_std = noise * 1e-3 * np.sqrt(10 / modes.frequency), noise * 3e-3
        exact = (sensor_rows @ modes.shape).T * self.gain
        exact /= np.linalg.norm(exact, axis=1, keepdims=True)
        return [
            as_estimate(
                modes.frequency * (1 + std * random.standard_normal(len(std))),
                exact + shape_std * random.standard_normal(exact.shape),
                channels=self.structure.channels,
                frequency_std=std * modes.frequency,
                shape_std=shape_std,
            )
            for _ in range(n)
        ]


def t_truth(seed: int) -> Truth:
    """Return a T-frame with E and density off by per cents, a flexible foot and joint, gains off by 0.5 %."""
    random = np.random.default_rng(seed)
    plain = t_frame()
    e, rho = 1 + 0.02 * random.standard_normal(), 1 + 0.01 * random.standard_normal()
    changed = {"youngs_modulus": 210e9 * e, "shear_modulus": 80.8e9 * e, "density": 7850 * rho}

    def springs() -> dict[str, float]:
        return {axis: 210e9 * 9.3e-8 / 1.48 / random.uniform(0.002, 0.01) for axis in ("rx", "ry", "rz")}

    foot = Support.model_validate({"at": (0, 0, 0), "fixed": ("x", "y", "z"), "stiffness": springs()})
    top = Joint.model_validate({"member": "crossbeam", "at": (0, 0, 1.48), "stiffness": springs()})
    steel = plain.material["steel"].model_copy(update=changed)
    structure = plain.model_copy(update={"material": {"steel": steel}, "support": (foot,), "joint": (top,)})
    gain = 1 + 0.005 * random.standard_normal(12)
    return Truth(seed=seed, structure=structure.with_mesh(0.01), gain=gain)


def noisy_estimates(
    frequency: FloatArray,
    shape: FloatArray,
    channels: tuple[str, ...],
    n: int,
    random: np.random.Generator,
    *,
    std: float | FloatArray,
    shape_std: float,
) -> list[ModalEstimate]:
    """Return n windows of modes with Gaussian errors: `std` of a frequency, relative, `shape_std` of a component."""
    return [
        as_estimate(
            frequency * (1 + std * random.standard_normal(len(frequency))),
            shape + shape_std * random.standard_normal(shape.shape),
            channels=channels,
            frequency_std=std * frequency,
            shape_std=shape_std,
        )
        for _ in range(n)
    ]

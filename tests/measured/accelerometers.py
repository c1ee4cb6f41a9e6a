"""Records of accelerometers on a true T-frame: another model than the reference's, excited by the wind."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import resample_poly

from daq import Channel, FloatArray, Recording
from updater import Body, Structure, build_model, parse_structure, t_structure_toml
from updater.fe import Ambient, AmbientResponse
from updater.structure import Joint, Support

_TURNS = ("rx", "ry", "rz")
_OVER = 2  # simulated samples a recorded one
_QUANTUM = 9.80665 * 2.0**-20  # m/s2


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A true structure with attached parts; drawn from its seed."""

    seed: int
    body: tuple[Body, ...] = ()
    foot: tuple[float, float, float] = (1.0, 1.0, 1.0)  #: factors on the foot's stiffness about x y z
    joint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stiffness: float = 1.0

    def structure(self) -> Structure:
        """10 mm Timoshenko elements, consistent mass, flexible foot and joint, E and rho off."""
        random = np.random.default_rng((self.seed, 1))
        structure = parse_structure(t_structure_toml())
        steel = structure.material["steel"]
        stiffness = self.stiffness * (1 + 0.01 * random.standard_normal())
        density = 1 + 0.007 * random.standard_normal()
        scaled = {"youngs_modulus": stiffness, "shear_modulus": stiffness, "density": density}
        material = steel.model_copy(update={name: getattr(steel, name) * factor for name, factor in scaled.items()})
        unit = steel.youngs_modulus * 9.3e-8 / 1.48
        foot = {a: f * unit / random.uniform(0.002, 0.01) for a, f in zip(_TURNS, self.foot, strict=True)}
        joint = {a: f * unit / random.uniform(0.002, 0.01) for a, f in zip(_TURNS, self.joint, strict=True)}
        parts = {
            "material": {"steel": material},
            "support": (Support.model_validate({"at": (0, 0, 0), "fixed": ("x", "y", "z"), "stiffness": foot}),),
            "joint": (Joint.model_validate({"member": "crossbeam", "at": (0, 0, 1.48), "stiffness": joint}),),
            "body": self.body,
        }
        return structure.model_copy(update=parts).with_mesh(0.01)

    def record(self, log: int, seconds: float, *, rate: float = 1000.0) -> Recording:
        """Measure for a while; `log` numbers the realisation of forces and noise, the rig stays the same."""
        random, now = np.random.default_rng((self.seed, 2)), np.random.default_rng((self.seed, 3, log))
        structure = self.structure()
        model = build_model(structure, shear_flexible=True, mass="consistent")
        n_modes = int((model.modes(24).frequency < 0.9 * rate * _OVER / 2).sum())
        damping = random.uniform(0.002, 0.01, 24)[:n_modes]
        gain = 1 + 0.005 * random.standard_normal(len(structure.sensor))
        points, axes = _forces(structure, random)
        ambient = Ambient(points=points, axes=axes, density=5e-9)
        seed = int(now.integers(1 << 31))
        response = AmbientResponse(model, model.sensor_rows, damping, ambient, rate=rate * _OVER, seed=seed)
        response.step(round(20 * rate * _OVER))
        motion = resample_poly(response.step(round(seconds * rate * _OVER)), 1, _OVER, axis=0)
        noise = 2e-6 * np.sqrt(rate / 2) * now.standard_normal(motion.shape)
        data: FloatArray = _QUANTUM * np.round((motion * gain + noise) / _QUANTUM)
        channels = tuple(Channel(name=c, device="import", axis=i) for i, c in enumerate(structure.channels))
        return Recording(channels=channels, data=data, rate=rate, start=1_767_225_600_000_000_000)


Vector = tuple[float, float, float]


def _forces(structure: Structure, random: np.random.Generator) -> tuple[tuple[Vector, ...], tuple[int, ...]]:
    points: list[Vector] = []
    axes: list[int] = []
    for member in structure.member:
        along = int(np.argmax(np.abs(np.subtract(member.end, member.start))))
        for share in random.uniform(0.1, 1.0, 3):
            x, y, z = (float(v) for v in member.point(member.length * share))
            points += [(x, y, z)] * 2
            axes += [axis for axis in range(3) if axis != along]
    return tuple(points), tuple(axes)


def swapped(recording: Recording, first: str, second: str) -> Recording:
    """Return the recording with two channels exchanged."""
    names = [c.name for c in recording.channels]
    order = np.arange(len(names))
    i, j = names.index(first), names.index(second)
    order[[i, j]] = j, i
    return replace(recording, data=recording.data[:, order])


def write_csv(path: Path, recording: Recording) -> None:
    """Write a table as a data logger would."""
    names = ",".join(["t", *(c.name for c in recording.channels)])
    t = np.arange(len(recording.data)) / recording.rate
    np.savetxt(path, np.column_stack([t, recording.data]), delimiter=",", header=names, comments="", fmt="%.7g")

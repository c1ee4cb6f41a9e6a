"""What a virtual rig is and what will happen to it: SCENARIO.toml."""

import tomllib
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from monitor.errors import SettingsError
from updater import Body

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class RigDevice(_Section):
    """One emulated triaxial accelerometer; its axes are the structure's."""

    name: str
    at: Vector  #: [m]
    clock_error: float = 0.0  #: of its oscillator, 1e-6 = 1 ppm fast


class Truth(_Section):
    """What nobody tells the monitor about the structure itself."""

    stiffness_factor: Positive = 1.0  #: of E and G
    density_factor: Positive = 1.0
    foot_flexibility: Vector = (0.0, 0.0, 0.0)  #: about x y z, times E I / L of the longest member [-]
    joint_flexibility: Vector = (0.0, 0.0, 0.0)  #: of every joint, alike [-]
    damping: Annotated[tuple[Positive, ...], Field(min_length=8)]  #: ratio of each simulated mode [-]
    gain_scatter: Annotated[float, Field(ge=0)] = 0.005  #: standard deviation of channel gains [-]
    noise_density: Annotated[float, Field(ge=0)] = 2e-6  #: of the sensors [m/s2/sqrt(Hz)]
    force_density: Positive = 1e-8  #: of each ambient force [N2/Hz]
    forces_per_member: Annotated[int, Field(ge=1)] = 3  #: places where ambient forces act, in both cross directions


class RigEvent(_Section):
    """A body that is clamped on."""

    at: Positive  #: [s] after the last device began to sample
    body: Body


class Scenario(_Section):
    """A whole SCENARIO.toml."""

    structure: str  #: path of the structure's file
    seed: int
    rate: Positive = 1000.0  #: [Hz]
    duration: Positive  #: [s] of data after the last device began to sample
    device: Annotated[tuple[RigDevice, ...], Field(min_length=1)]
    truth: Truth
    event: tuple[RigEvent, ...] = ()


def load_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises
    ------
    SettingsError
        Naming the file and the key.
    """
    try:
        return Scenario.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingsError(path, str(error)) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise SettingsError(path, f"{place}: {first['msg']}, found {first['input']!r:.80}") from error


def dump_scenario(scenario: Scenario) -> str:
    """Return a scenario as TOML."""
    data = scenario.model_dump(mode="json")
    lines = [f"{key} = {_toml(data[key])}" for key in ("structure", "seed", "rate", "duration")]
    lines += ["", "[truth]", *(f"{key} = {_toml(value)}" for key, value in data["truth"].items())]
    for name in ("device", "event"):
        for entry in data[name]:
            lines += ["", f"[[{name}]]", *(f"{key} = {_toml(value)}" for key, value in entry.items())]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


#: where the T-frame's six accelerometers sit, and which of their axes are analysed
T_DEVICES: dict[str, tuple[Vector, str]] = {
    "col_037": ((0.0, 0.0, 0.37), "xy"),
    "col_074": ((0.0, 0.0, 0.74), "xy"),
    "col_111": ((0.0, 0.0, 1.11), "xy"),
    "beam_mid": ((0.0, 0.0, 1.48), "xy"),
    "beam_left": ((-0.40, 0.0, 1.48), "yz"),
    "beam_right": ((0.40, 0.0, 1.48), "yz"),
}
_N_MODES = 24


def draw_t_frame(
    structure: str, seed: int, *, duration: float, between: tuple[float, float] | None, rate: float = 1000.0
) -> Scenario:
    """Draw a T-frame that is never the nominal one, and a body of 150 to 300 g that is added to it.

    Parameters
    ----------
    structure : path of its file
    seed : draws everything
    duration : [s]
    between : times between which the body is added [s]; None for a rig to which nothing happens
    rate : of the devices [Hz]
    """
    random = np.random.default_rng(seed)
    truth = Truth(
        stiffness_factor=float(random.normal(1, 0.015)),
        density_factor=float(random.normal(1, 0.007)),
        foot_flexibility=_three(random.uniform(0.001, 0.01, 3)),
        joint_flexibility=_three(random.uniform(0.001, 0.01, 3)),
        damping=tuple(random.uniform(0.002, 0.01, _N_MODES).tolist()),
    )
    devices = tuple(
        RigDevice(name=name, at=at, clock_error=float(random.normal(0, 10e-6))) for name, (at, _) in T_DEVICES.items()
    )
    body, share = _draw_body(random), float(random.uniform())
    events = () if between is None else (RigEvent(at=between[0] + share * (between[1] - between[0]), body=body),)
    return Scenario(
        structure=structure, seed=seed, rate=rate, duration=duration, device=devices, truth=truth, event=events
    )


def _draw_body(random: np.random.Generator) -> Body:
    """Draw a body on the crossbeam or on the column above 0.5 m, every centimetre alike."""
    place = float(random.uniform(0, 0.80 + 0.98))
    mass = float(random.uniform(0.150, 0.300))
    side = random.uniform(-0.015, 0.015, 2)
    size = mass * 0.02**2 / 6  # of a 2 cm cube
    inertia = (size, size, size)
    if place < 0.80:
        offset = (0.0, float(side[0]), float(side[1]))
        return Body(at=(place - 0.40, 0.0, 1.48), mass=mass, offset=offset, inertia=inertia)
    offset = (float(side[0]), float(side[1]), 0.0)
    return Body(at=(0.0, 0.0, place - 0.30), mass=mass, offset=offset, inertia=inertia)


def _three(values: np.ndarray) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z

"""SCENARIO.toml: description of a virtual rig and of its events."""

import json
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from daq.bounded_text import parse_toml
from monitor.errors import SettingsError
from monitor.settings.section import Table
from updater import Body
from updater.quantities import Opens, check_opening

Vector = tuple[float, float, float]
NotNegative = Annotated[float, Field(ge=0)]
Damping = Annotated[float, Field(ge=1e-5, lt=1)]
Factor = Annotated[float, Field(ge=0.01, le=100)]
Flexibility = tuple[NotNegative, NotNegative, NotNegative]


class RigDevice(Table):
    """One emulated triaxial accelerometer; its axes are the structure's."""

    name: Annotated[str, Field(min_length=1)]
    at: Vector  #: position on a member [m]
    clock_error: Annotated[float, Field(gt=-0.01, lt=0.01)] = 0.0  #: error of its oscillator, 1e-6 = 1 ppm fast
    delay: Annotated[float, Field(ge=0, lt=0.02)] = 0.0  #: delay of its filter beyond that of all devices [s]
    node: Annotated[int, Field(ge=1, le=127)] | None = None  #: id on the rig's CAN bus; None: it has a serial port


class Truth(Table):
    """True properties of the structure, unknown to the monitor."""

    stiffness_factor: Factor = 1.0  #: factor of E and G
    density_factor: Factor = 1.0
    foot_flexibility: Flexibility = (0.0, 0.0, 0.0)  #: about x y z, times L / (E I) of the longest member [-]
    joint_flexibility: Flexibility = (0.0, 0.0, 0.0)  #: flexibility of every joint [-]
    damping: Annotated[tuple[Damping, ...], Field(min_length=8, max_length=200)] = (0.005,) * 24
    """ratio of each simulated mode; with a crack, only of those below 1.8 times `rate` [-]"""
    gain_scatter: NotNegative = 0.005  #: standard deviation of channel gains [-]
    noise_density: NotNegative = 2e-6  #: noise density of the sensors, one-sided [m/s2/sqrt(Hz)]
    force_density: NotNegative = 5e-9  #: density of each ambient force, two-sided [N2/Hz]
    forces_per_member: Annotated[int, Field(ge=1, le=100)] = 3
    """places where ambient forces act, in both cross directions"""


class RigCrack(Table):
    """A crack of a member that opens and closes under its moment; or play, open within a moment; or dry friction."""

    member: str
    distance: NotNegative  #: from the member's start [m]
    axis: Literal["y", "z"]  #: local axis that the moment acts about
    flexibility: Annotated[float, Field(gt=0)]  #: rotation per moment while it is open, over 1 / (E I) [m]
    closed: NotNegative = 0.0  #: the same while it is closed [m]
    moment: float = 0.0  #: moment at which it opens, closes, or first slips [N m]
    #: side of that moment on which it is open; within, as play, or beyond it on both sides of zero; slips: with
    #: dry friction beyond it, until it turns back
    opens: Opens = "above"

    @model_validator(mode="after")
    def _is_a_law(self) -> Self:
        if not self.closed <= self.flexibility:
            raise ValueError(f"expected closed <= flexibility, found {self.closed:g}, {self.flexibility:g}")
        check_opening(self.opens, self.moment)
        return self


class RigEvent(Table):
    """A body that is clamped on, or a crack."""

    kind: Literal["add_body", "crack"] = "add_body"
    at: Annotated[float, Field(ge=2)]  #: [s] after the last device began to sample; the rig computes ahead of this
    over: NotNegative = 0.0  #: time in which a body comes little by little, such as a tank that is filled [s]
    body: Body | None = None  #: of `add_body`
    crack: RigCrack | None = None  #: of `crack`; a later one takes the place of an earlier one

    @model_validator(mode="after")
    def _is_of_its_kind(self) -> Self:
        wanted = "body" if self.kind == "add_body" else "crack"
        given = [name for name in ("body", "crack") if getattr(self, name) is not None]
        if given != [wanted]:
            raise ValueError(f"expected {wanted} for kind {self.kind!r}, found {' and '.join(given) or 'none'}")
        if self.over and self.kind != "add_body":
            raise ValueError(f"over: expected 0 for kind {self.kind!r}, found {self.over:g}")
        return self


class Scenario(Table):
    """A whole SCENARIO.toml."""

    structure: str  #: path of the structure's file, from the scenario's; "t_structure" is the shipped one
    seed: Annotated[int, Field(ge=0, lt=1 << 63)]
    rate: Annotated[float, Field(ge=1, le=1e5)] = 1000.0  #: highest rate of devices [Hz]
    duration: NotNegative  #: [s] of data after the last device began to sample; 0 = for ever
    device: Annotated[tuple[RigDevice, ...], Field(min_length=1, max_length=200)]
    truth: Truth = Truth()
    event: tuple[RigEvent, ...] = ()
    #: answer that the demo compares with the events: the mass of one body, the causes of the last diagnosis, or the
    #: course of the change within the record that `diagnose` finds
    answer: Literal["mass", "causes", "course"] = "causes"

    @model_validator(mode="after")
    def _devices_differ(self) -> Self:
        names = [device.name for device in self.device]
        for repeated in sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"device: the name {repeated!r} is given twice")
        nodes = [device.node for device in self.device if device.node is not None]
        for node in sorted({node for node in nodes if nodes.count(node) > 1}):
            raise ValueError(f"device: the CAN node {node} is given twice")
        return self


def shipped_scenarios() -> dict[str, Path]:
    """Return the scenarios that come with the program, by name."""
    folder = Path(__file__).parent / "scenarios"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_scenario(path: Path) -> Scenario:
    """Read a scenario.

    Raises
    ------
    SettingsError
        Naming the file, the key and the found value.
    """
    try:
        return Scenario.model_validate(parse_toml(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise SettingsError(path, f"cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "scenario"
        raise SettingsError(path, f"{place}: {first['msg']}, found {first['input']!r:.80}") from error
    except ValueError as error:  # no UTF-8, no TOML
        raise SettingsError(path, str(error)) from error


def dump_scenario(scenario: Scenario) -> str:
    """Return a scenario as TOML that `load_scenario` reads back equal."""
    data = scenario.model_dump(mode="json", exclude_none=True)
    lines = [f"{key} = {_toml(data[key])}" for key in ("structure", "seed", "rate", "duration", "answer")]
    lines += ["", "[truth]", *(f"{key} = {_toml(value)}" for key, value in data["truth"].items())]
    for name in ("device", "event"):
        for entry in data[name]:
            lines += ["", f"[[{name}]]", *(f"{key} = {_toml(value)}" for key, value in entry.items())]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    return json.dumps(value, ensure_ascii=False)  # strings and numbers are written alike

"""What structure.toml says: members, supports, joints, bodies and sensors."""

import tomllib
from collections.abc import Iterable
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from daq import FloatArray
from updater.errors import StructureError

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
AXES: tuple[Axis, ...] = ("x", "y", "z", "rx", "ry", "rz")
Vector = tuple[float, float, float]
_ON_MEMBER = 1e-4  # m
Positive = Annotated[float, Field(gt=0)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)


class Material(_Entry):
    """An isotropic, linear elastic material."""

    youngs_modulus: Positive  #: E [Pa]
    shear_modulus: Positive  #: G [Pa]
    density: Positive  #: [kg/m3]


class Section(_Entry):
    """A cross-section, by its constants."""

    area: Positive  #: [m2]
    second_moment: tuple[Positive, Positive]  #: about the local y and z axes [m4]
    torsion_constant: Positive  #: [m4]
    shear_factor: Positive = 5 / 6  #: effective shear area over area [-]


class Member(_Entry):
    """A straight member of constant section."""

    name: str
    start: Vector = Field(alias="from")  #: [m]
    end: Vector = Field(alias="to")  #: [m]
    material: str
    section: str
    elements: Annotated[int, Field(ge=1)]  #: of equal length

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        if self.start == self.end:
            raise ValueError(f"member {self.name}: it ends where it begins, at {list(self.start)}")
        return self

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    def point(self, distance: FloatArray | float) -> FloatArray:
        """Return the points (..., 3) [m] at distances (...) [m] from the member's start."""
        share = np.asarray(distance, float)[..., None] / self.length
        return np.asarray(self.start) + share * np.subtract(self.end, self.start)

    def passes(self, point: Vector) -> bool:
        """Say whether a point [m] lies on the member, to 0.1 mm."""
        along = np.subtract(self.end, self.start) / self.length
        distance = float(np.clip(np.subtract(point, self.start) @ along, 0, self.length))
        return bool(np.linalg.norm(self.point(distance) - point) < _ON_MEMBER)


class Support(_Entry):
    """A node held to the ground: rigidly on the fixed axes, by a spring on those in `stiffness`."""

    at: Vector
    fixed: tuple[Axis, ...] = ()
    stiffness: dict[Axis, Positive] = {}  #: [N/m] or [N m/rad]


class Joint(_Entry):
    """Rotational springs between one member and the others that meet it; axes without one stay rigid."""

    member: str
    at: Vector
    stiffness: dict[Literal["rx", "ry", "rz"], Positive]  #: about the global axes [N m/rad]


class Body(_Entry):
    """A rigid body fixed to a member."""

    at: Vector  #: the point of the member it is fixed to [m]
    mass: float  #: [kg], negative for a body that was removed
    offset: Vector = (0.0, 0.0, 0.0)  #: from that point to the body's centre of mass [m]
    inertia: Vector = (0.0, 0.0, 0.0)  #: about its own centre, global axes [kg m2]


class Sensor(_Entry):
    """A single-axis accelerometer channel."""

    channel: str
    at: Vector  #: [m]
    direction: Vector
    gain: float = 1.0  #: what the channel says over what is true [-]

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.direction):
            raise ValueError(f"sensor {self.channel}: the direction is zero")
        return self


class Structure(_Entry):
    """A frame of straight members with everything fixed to it."""

    name: str
    material: dict[str, Material]
    section: dict[str, Section]
    member: Annotated[tuple[Member, ...], Field(min_length=1)]
    support: tuple[Support, ...] = ()
    joint: tuple[Joint, ...] = ()
    body: tuple[Body, ...] = ()
    sensor: tuple[Sensor, ...] = ()

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        for member in self.member:
            _known("member", member.name, "material", member.material, self.material)
            _known("member", member.name, "section", member.section, self.section)
        names = [member.name for member in self.member]
        for joint in self.joint:
            _known("joint at", str(list(joint.at)), "member", joint.member, names)
        channels = [sensor.channel for sensor in self.sensor]
        for repeated in {c for c in channels if channels.count(c) > 1} | {n for n in names if names.count(n) > 1}:
            raise ValueError(f"the name {repeated!r} is given twice")
        return self

    @model_validator(mode="after")
    def _lie_on_members(self) -> Self:
        places = [(f"sensor {sensor.channel}", sensor.at) for sensor in self.sensor]
        places += [("support", support.at) for support in self.support] + [("body", body.at) for body in self.body]
        for what, at in places:
            if not any(member.passes(at) for member in self.member):
                raise ValueError(f"{what}: {list(at)} lies on no member")
        for joint in self.joint:
            if not self.member_named(joint.member).passes(joint.at):
                raise ValueError(f"joint of {joint.member}: {list(joint.at)} does not lie on it")
        return self

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the sensors' channels."""
        return tuple(sensor.channel for sensor in self.sensor)

    def member_named(self, name: str) -> Member:
        """Return the member of that name."""
        return next(member for member in self.member if member.name == name)

    def with_mesh(self, element_length: float) -> "Structure":
        """Return the same structure with elements no longer than `element_length` [m]."""
        members = tuple(
            member.model_copy(update={"elements": max(1, int(np.ceil(member.length / element_length - 1e-9)))})
            for member in self.member
        )
        return self.model_copy(update={"member": members})

    def with_bodies(self, bodies: Iterable[Body]) -> "Structure":
        """Return the same structure with bodies added."""
        return self.model_copy(update={"body": (*self.body, *bodies)})


def _known(kind: str, name: str, field: str, value: str, known: Iterable[str]) -> None:
    if value not in known:
        raise ValueError(f"{kind} {name}: {field} {value!r} is not defined; there are {sorted(known)}")


def parse_structure(text: str, path: Path | str = "structure.toml") -> Structure:
    """Read a structure from TOML text.

    Raises
    ------
    StructureError
        Naming the file and the entry that is wrong.
    """
    try:
        content: dict[str, Any] = tomllib.loads(text)
        return Structure.model_validate(content)
    except tomllib.TOMLDecodeError as error:
        raise StructureError(path, str(error)) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "structure"
        raise StructureError(path, f"{place}: {first['msg']}, found {first['input']!r:.80}") from error


def load_structure(path: Path | str) -> Structure:
    """Read a structure file.

    Raises
    ------
    StructureError
        If it cannot be read or an entry is wrong.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StructureError(path, f"cannot be read: {error}") from error
    return parse_structure(text, path)


def dump_structure(structure: Structure) -> str:
    """Return a structure as TOML that `parse_structure` reads back equal."""
    content = structure.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    return tomlkit.dumps({key: value for key, value in content.items() if value})


def t_structure_toml() -> str:
    """Return the text of the shipped T-frame's structure file."""
    with as_file(files("updater") / "structures" / "t_structure.toml") as path:
        return path.read_text(encoding="utf-8")

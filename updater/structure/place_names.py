"""Names of places by the structure's own names: foot, joint, end of a member, sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from updater.structure.base import Vector
from updater.structure.structure import Structure

_NEAR = 0.027  # of the longest member: distance within which a place is the foot, joint or sensor that it is named by
_UPRIGHT = 0.7  # sine of the slope from which a member has a foot and a top

Line = tuple[Vector, Vector]  # ends [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class NamedPlaces:
    """Parts of a structure that places are named by."""

    members: Mapping[str, Line]  #: start and end by name [m]
    supports: Sequence[Vector]  #: [m]
    sensors: Mapping[str, Vector]  #: position by channel [m]

    def name(self, position: Vector) -> str:
        """Return a phrase for a position [m], such as `foot of the right post` or `beam at sensors A3y, A3z`.

        Feet and joints come first, then ends of members, then sensors, then the member alone. Empty for a position
        that is on no member.
        """
        near = _NEAR * max((_apart(*line) for line in self.members.values()), default=0.0)
        touching = {name: line for name, line in self.members.items() if _distance(line, position) < near}
        if not touching:
            return ""
        ended = {n: line for n, line in touching.items() if min(_apart(end, position) for end in line) < near}
        if any(_apart(at, position) < near for at in self.supports):
            return _support_name(list(touching), ended, position)
        if len(touching) > 1:
            return f"joint of {_listed(list(touching))}"
        ((name, _),) = touching.items()
        sensors = [channel for channel, at in self.sensors.items() if _apart(at, position) < near]
        at_sensors = f" at sensor{'s' * (len(sensors) > 1)} {', '.join(sensors)}" if sensors else ""
        return f"{_end_name(name, ended[name], position) if ended else name}{at_sensors}"


def place_name(structure: Structure, position: Vector) -> str:
    """Return the phrase of `NamedPlaces.name` for a position [m] on a structure."""
    return NamedPlaces(
        members={member.name: (member.start, member.end) for member in structure.member},
        supports=[support.at for support in structure.support],
        sensors={sensor.channel: sensor.at for sensor in structure.sensor},
    ).name(position)


def _support_name(touching: Sequence[str], ended: Mapping[str, Line], position: Vector) -> str:
    """Return the name of a support: the foot of an upright member, or the end of another."""
    feet = [name for name, line in ended.items() if _is_upright(line) and _is_lower(line, position)]
    if feet:
        return f"foot of {_listed(feet)}"
    if len(touching) == 1 and ended:
        ((name, line),) = ended.items()
        return f"support at the {_end_name(name, line, position)}"
    return f"support of {_listed(touching)}"


def _end_name(name: str, line: Line, position: Vector) -> str:
    if _is_upright(line):
        return f"{'lower' if _is_lower(line, position) else 'upper'} end of the {name}"
    return f"{'start' if _apart(line[0], position) < _apart(line[1], position) else 'end'} of the {name}"


def _listed(names: Sequence[str]) -> str:
    *others, last = [f"the {name}" for name in names]
    return f"{', '.join(others)} and {last}" if others else last


def _is_upright(line: Line) -> bool:
    return abs(line[1][2] - line[0][2]) > _UPRIGHT * _apart(*line)


def _is_lower(line: Line, position: Vector) -> bool:
    return position[2] < (line[0][2] + line[1][2]) / 2


def _distance(line: Line, position: Vector) -> float:
    """Return the distance of a position from a line [m]."""
    start, along = np.array(line[0]), np.subtract(line[1], line[0])
    share = float(np.clip(np.subtract(position, start) @ along / (along @ along), 0, 1))
    return float(np.linalg.norm(start + share * along - position))


def _apart(one: Vector, other: Vector) -> float:
    return float(np.linalg.norm(np.subtract(one, other)))

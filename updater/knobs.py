"""Physical parameters of a structure that may be fitted, with what is known of them: its knobs."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from daq import FloatArray
from updater.structure import AXES, Axis, Joint, Member, Segment, Structure, Support

_STIFFNESS_PRIOR = 0.03  # of ln E
_FLEXIBILITY_PRIOR = 0.02  # of c E I / L, c the spring's flexibility: a nominally rigid connection
_RIGID = 1e-6  # the least flexibility c E I / L
_WELD_PRIOR = 0.5  # of the share of its flexibility that a joint's zone lacks beside the members' own
_WELDED = 0.95  # the most
_THICK = 2.0  # radii of gyration that a joint reaches: as far as a member is thick
_MOST_OF_MEMBER = 0.25  # of a member's length, that it reaches at the most
TURNS = AXES[3:]


@dataclass(frozen=True)
class Knob:
    """A parameter: ln of a material's stiffness, a connection's flexibility c E I / L about one axis, or of its weld.

    Members that meet overlap and are welded: near the joint they give less than their axes, drawn to a point, do. Of
    that flexibility a weld takes a share.
    """

    name: str
    prior: float  #: standard deviation about zero
    lower: float  #: least value
    kind: Literal["stiffness", "support", "joint", "weld"]
    target: str  #: material, index of the support, or member
    axis: Axis = "x"
    upper: float = np.inf  #: greatest value


def with_springs(structure: Structure, flexibility: float = 1e-5) -> Structure:
    """Return the structure with springs where feet and joints are rigid, so stiff (c E I / L) that it shows nowhere."""
    knobs = [knob for knob in knobs_of(structure) if knob.kind in {"support", "joint"}]
    return apply_knobs(structure, knobs, np.full(len(knobs), flexibility))


def knobs_of(structure: Structure) -> list[Knob]:
    """Return the stiffness of each material and what each foot and joint may give."""
    if structure.external is not None:  # one factor is all that can be said of matrices from elsewhere
        return [Knob("stiffness", _STIFFNESS_PRIOR, -np.inf, "stiffness", "")]
    knobs = [Knob(f"stiffness of {m}", _STIFFNESS_PRIOR, -np.inf, "stiffness", m) for m in structure.material]
    for i, support in enumerate(structure.support):
        held = [a for a in TURNS if a in support.fixed]
        knobs += [Knob(f"support {i} flexibility {a}", _FLEXIBILITY_PRIOR, _RIGID, "support", str(i), a) for a in held]
    for member in meetings(structure):
        knobs += [
            Knob(f"joint of {member} flexibility {a}", _FLEXIBILITY_PRIOR, _RIGID, "joint", member, a) for a in TURNS
        ]
        knobs.append(Knob(f"weld of {member}", _WELD_PRIOR, 0.0, "weld", member, upper=_WELDED))
    return knobs


def meetings(structure: Structure) -> dict[str, tuple[float, float, float]]:
    """Members that another member's end meets rigidly -> the point; each meeting once, springs on the later member."""
    found: dict[str, tuple[float, float, float]] = {}
    if structure.external is not None:
        return found
    for i, member in enumerate(structure.member):
        for other in structure.member[:i]:
            for point in (other.start, other.end, member.start, member.end):
                if member.name not in found and _on(member, point) and _on(other, point):
                    found[member.name] = point
    given = {joint.member for joint in structure.joint}
    return {name: point for name, point in found.items() if name not in given}


def _on(member: Member, point: tuple[float, float, float]) -> bool:
    along = np.subtract(member.end, member.start) / member.length
    s = float(np.clip(np.dot(np.subtract(point, member.start), along), 0, member.length))
    return bool(np.linalg.norm(member.point(s) - np.asarray(point)) < 1e-6)


def apply_knobs(structure: Structure, knobs: list[Knob], x: FloatArray) -> Structure:
    """Return the structure with the parameters `x` written into it."""
    material = dict(structure.material)
    springs: dict[tuple[str, str], dict[str, float]] = {}
    meeting = meetings(structure)
    welds: list[Segment] = []
    external = structure.external
    for knob, value in zip(knobs, x, strict=True):
        if knob.kind == "stiffness" and external is not None:
            external = external.model_copy(update={"factor": external.factor * float(np.exp(value))})
        elif knob.kind == "stiffness":
            old, factor = material[knob.target], float(np.exp(value))
            changed = {"youngs_modulus": old.youngs_modulus * factor, "shear_modulus": old.shear_modulus * factor}
            material[knob.target] = old.model_copy(update=changed)
        elif knob.kind == "weld":
            welds += _welds(structure, meeting[knob.target], float(value))
        else:
            springs.setdefault((knob.kind, knob.target), {})[knob.axis] = bending_stiffness(structure) / float(value)
    supports = [_sprung(s, springs.get(("support", str(i)), {})) for i, s in enumerate(structure.support)]
    joints = [
        Joint.model_validate({"member": name, "at": meeting[name], "stiffness": axes})
        for (kind, name), axes in springs.items()
        if kind == "joint"
    ]
    return structure.model_copy(
        update={
            "external": external,
            "material": material,
            "support": tuple(supports),
            "joint": (*structure.joint, *joints),
            "segment": (*structure.segment, *welds),
        }
    )


def _welds(structure: Structure, point: tuple[float, float, float], less: float) -> list[Segment]:
    """Return the ends of the members that meet at a point, with so much less flexibility in bending and twist."""
    found = []
    for member, start, end in welded(structure, point):
        x, y, z = member.point((start + end) / 2).tolist()
        found.append(Segment(member=member.name, at=(x, y, z), extent=end - start, stiffness=1 / (1 - less)))
    return found


def welded(structure: Structure, point: tuple[float, float, float]) -> list[tuple[Member, float, float]]:
    """Return the members that meet at a point, and from where to where along each the joint reaches [m]."""
    found = []
    for member in structure.member:
        if _on(member, point):
            section, s = structure.section[member.section], float(np.linalg.norm(np.subtract(point, member.start)))
            reach = min(_THICK * (max(section.second_moment) / section.area) ** 0.5, _MOST_OF_MEMBER * member.length)
            found.append((member, max(s - reach, 0.0), min(s + reach, member.length)))
    return found


def _sprung(support: Support, springs: dict[str, float]) -> Support:
    fixed = [axis for axis in support.fixed if axis not in springs]
    return Support.model_validate({"at": support.at, "fixed": fixed, "stiffness": {**support.stiffness, **springs}})


def bending_stiffness(structure: Structure) -> float:
    """E I / L of the longest member: the measure of every flexibility [N m/rad]."""
    member = max(structure.member, key=lambda m: m.length)
    section = structure.section[member.section]
    return structure.material[member.material].youngs_modulus * max(section.second_moment) / member.length

"""What the entries of a structure must be to each other: names that exist, places on members, partners at joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from daq import FloatArray
    from updater.structure import Joint, Structure

ON_MEMBER = 1e-4  # m


def check_names(structure: Structure) -> None:
    """Check that names which are referred to are there, once.

    Raises
    ------
    ValueError
        Naming the entry and what is not defined or given twice.
    """
    for member in structure.member if structure.external is None else ():
        if not member.elements:
            raise ValueError(f"member {member.name}: elements is missing")
        _known("member", member.name, "material", member.material, structure.material)
        _known("member", member.name, "section", member.section, structure.section)
    names = [member.name for member in structure.member]
    for joint in structure.joint:
        _known("joint at", str(list(joint.at)), "member", joint.member, names)
    joints = [f"joint of {joint.member} at {list(joint.at)}" for joint in structure.joint]
    for known in (names, structure.channels, joints):
        repeated = [name for name, times in Counter(known).items() if times > 1]
        if repeated:
            raise ValueError(f"the name {repeated[0]!r} is given twice")


def _known(kind: str, name: str, field: str, value: str, known: Collection[str]) -> None:
    if value not in known:
        raise ValueError(f"{kind} {name}: {field} {value!r} is not defined; there are {sorted(known)}")


def check_places(structure: Structure) -> None:
    """Check that what is fixed to members lies on them, and that joints have something to join.

    Raises
    ------
    ValueError
        Naming the entry and its place.
    """
    ends = Counter(frozenset((m.start, m.end)) for m in structure.member)
    twice = [sorted(pair) for pair, times in ends.items() if times > 1]
    if twice:
        raise ValueError(f"two members lie between {list(twice[0][0])} and {list(twice[0][1])}")
    if structure.external is not None:  # the matrices' nodes decide
        if structure.joint:
            raise ValueError("joint: matrices from elsewhere have their joints in them")
        return
    places = [(f"sensor {sensor.channel}", sensor.at) for sensor in structure.sensor]
    places += [("support", s.at) for s in structure.support] + [("body", b.at) for b in structure.body]
    start = np.array([m.start for m in structure.member])
    along = np.array([m.end for m in structure.member]) - start
    for what, at in places:
        if _distance(np.asarray(at), start, along).min() >= ON_MEMBER:
            raise ValueError(f"{what}: {list(at)} lies on no member")
    for joint in structure.joint:
        _check_joint(joint, structure, _distance(np.asarray(joint.at), start, along) < ON_MEMBER)


def _distance(point: FloatArray, start: FloatArray, along: FloatArray) -> FloatArray:
    """Return the distance (n,) of a point from lines of starts (n, 3) and lengths (n, 3)."""
    away = point - start
    share = np.clip((away * along).sum(1) / (along**2).sum(1), 0, 1)
    return np.asarray(np.linalg.norm(away - share[:, None] * along, axis=1))


def _check_joint(joint: Joint, structure: Structure, passing: npt.NDArray[np.bool_]) -> None:
    there = [member.name for member, passes in zip(structure.member, passing, strict=True) if passes]
    if joint.member not in there:
        raise ValueError(f"joint of {joint.member}: {list(joint.at)} does not lie on it")
    held = any(np.linalg.norm(np.subtract(support.at, joint.at)) < ON_MEMBER for support in structure.support)
    if len(there) < 2 and not held:
        raise ValueError(f"joint of {joint.member}: no other member and no support is at {list(joint.at)}")

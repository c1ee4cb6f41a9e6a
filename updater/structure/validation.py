"""Consistency of the entries of a structure: existing names, places on members, partners at joints."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from updater.structure.base import ON_MEMBER

if TYPE_CHECKING:
    import numpy.typing as npt

    from daq import FloatArray
    from updater.structure.entries import Entries, Joint, Member

MAX_ELEMENTS = 20_000  #: elements of a structure: some 120,000 degrees of freedom
MAX_SENSORS = 1000  #: covariances of all pairs of channels are held in memory
_SHORTEST = 1e-3  # of its member's length, extent of a segment
_ROUNDING = 1e-9  # of a factor that is 0
_SLOWEST, _FASTEST = 100.0, 30_000.0  # m/s: rubber, and twice diamond
_HEAVIEST = 1e9  # kg of members: five times the steel of the Akashi Kaikyo bridge


def check_size(structure: Entries) -> None:
    """Check that a structure's matrices fit into memory.

    Raises
    ------
    ValueError
        Naming the field and the limit.
    """
    n_elements = sum(member.elements for member in structure.member)
    if n_elements > MAX_ELEMENTS:
        raise ValueError(f"member: elements: expected up to {MAX_ELEMENTS} in all members, found {n_elements}")
    if len(structure.sensor) > MAX_SENSORS:
        raise ValueError(f"sensor: expected up to {MAX_SENSORS}, found {len(structure.sensor)}")


def check_names(structure: Entries) -> None:
    """Check that names which are referred to are there, once.

    Raises
    ------
    ValueError
        Naming the entry that is not defined or given twice.
    """
    for member in structure.member if structure.external is None else ():
        if not member.elements:
            raise ValueError(f"member {member.name}: elements is missing")
        _known("member", member.name, "material", member.material, structure.material)
        _known("member", member.name, "section", member.section, structure.section)
    names = [member.name for member in structure.member]
    for segment in structure.segment:
        _known("segment at", str(list(segment.at)), "member", segment.member, names)
    supports = {support.at for support in structure.support}
    for ground in structure.ground:
        for at in ground.at:
            if at not in supports:
                raise ValueError(f"ground along {ground.axis}: there is no support at {list(at)}")
            if ground.at.count(at) > 1:
                raise ValueError(f"ground along {ground.axis}: the support at {list(at)} is given twice")
    for crack in structure.breathing_crack:
        _known("breathing_crack at", str(list(crack.at)), "member", crack.member, names)
    for joint in structure.joint:
        _known("joint at", str(list(joint.at)), "member", joint.member, names)
    joints = [f"joint of {joint.member} at {list(joint.at)}" for joint in structure.joint]
    for name in structure.sensors:
        _known("sensors", name, "sensor", name, [sensor.channel for sensor in structure.sensor])
    groups = list(structure.external.group) if structure.external else []
    for known in (names + groups, [sensor.channel for sensor in structure.sensor], structure.channels, joints):
        repeated = [name for name, times in Counter(known).items() if times > 1]
        if repeated:
            raise ValueError(f"the name {repeated[0]!r} is given twice")


def _known(kind: str, name: str, field: str, value: str, known: Collection[str]) -> None:
    if value not in known:
        raise ValueError(f"{kind} {name}: {field} {value!r} is not defined; there are {sorted(known)}")


def check_places(structure: Entries) -> None:
    """Check that parts fixed to members lie on them, and that joints connect members.

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
        if structure.segment:
            raise ValueError("segment: matrices from elsewhere have their members' stiffness and mass in them")
        if structure.ground:
            raise ValueError("ground: supports of matrices from elsewhere stand on no ground")
        if structure.breathing_crack:
            raise ValueError("breathing_crack: matrices from elsewhere have no members that it could be in")
        return
    places = [(f"sensor {sensor.channel}", sensor.at) for sensor in structure.sensor]
    places += [("support", s.at) for s in structure.support] + [("body", b.at) for b in structure.body]
    places += [("oscillator", o.at) for o in structure.oscillator]
    start = np.array([m.start for m in structure.member])
    along = np.array([m.end for m in structure.member]) - start
    for what, at in places:
        if _distance(np.asarray(at), start, along).min() >= ON_MEMBER:
            raise ValueError(f"{what}: {list(at)} lies on no member")
    for crack in structure.breathing_crack:
        if not structure.member_named(crack.member).passes(crack.at):
            raise ValueError(f"breathing_crack of {crack.member}: {list(crack.at)} does not lie on it")
    for joint in structure.joint:
        _check_joint(joint, structure, _distance(np.asarray(joint.at), start, along) < ON_MEMBER)
    _check_segments(structure)
    _check_bodies(structure)


def _masses_of_members(structure: Entries) -> list[float]:
    """Return the mass of each member, without bodies and segments [kg]; none of lines in external matrices."""
    return [
        structure.material[m.material].density * structure.section[m.section].area * m.length
        for m in structure.member
        if m.material and m.section
    ]


def _check_bodies(structure: Entries) -> None:
    """Refuse bodies of negative mass that leave the structure none."""
    own = _masses_of_members(structure)
    carried = [part.mass for part in structure.segment] + [part.mass for part in structure.oscillator]
    carried += [body.mass for body in structure.body if body.mass > 0]
    most = sum(own) + sum(carried)
    removed = sorted((body for body in structure.body if body.mass < 0), key=lambda body: body.mass)
    if removed and -sum(body.mass for body in removed) >= most:
        raise ValueError(
            f"body at {list(removed[0].at)}: mass: expected more than {-most:.4g} kg, which is all that the "
            f"structure has, found {removed[0].mass:g} kg"
        )


def _check_segments(structure: Entries) -> None:
    for segment in structure.segment:
        member = structure.member_named(segment.member)
        axis = np.subtract(member.end, member.start) / member.length
        middle = float(np.subtract(segment.at, member.start) @ axis)
        off = float(np.linalg.norm(member.point(middle) - segment.at))
        beyond = max(segment.extent / 2 - middle, middle + segment.extent / 2 - member.length)
        if max(off, beyond) >= ON_MEMBER:
            raise ValueError(
                f"segment of {segment.member}: {segment.extent:g} m about {list(segment.at)} are not all on it"
            )
        if segment.extent < _SHORTEST * member.length:
            raise ValueError(
                f"segment of {segment.member}: expected an extent of {_SHORTEST * member.length:.3g} m or more, "
                f"found {segment.extent:g} m"
            )
    for member in structure.member:
        _check_weight(structure, member)


def _check_weight(structure: Entries, member: Member) -> None:
    """Refuse segments that take off all the mass that a stretch has."""
    ends = sorted({end for start, stop, _ in structure.segments_of(member) for end in (start, stop)})
    for start, stop in pairwise(ends):
        material, _, _, rotary = structure.part_at(member, (start + stop) / 2)
        left = material.density
        if left <= 0:
            raise ValueError(
                f"segment of {member.name}: no mass is left from {start:.4g} to {stop:.4g} m of it, its density "
                f"would be {left:.4g} kg/m3"
            )
        if rotary < -_ROUNDING:
            raise ValueError(
                f"segment of {member.name}: gyration: expected less, no rotary inertia is left from {start:.4g} to "
                f"{stop:.4g} m of it"
            )


def _distance(point: FloatArray, start: FloatArray, along: FloatArray) -> FloatArray:
    """Return the distance (n,) of a point from lines of starts (n, 3) and lengths (n, 3)."""
    away = point - start
    share = np.clip((away * along).sum(1) / (along**2).sum(1), 0, 1)
    return np.asarray(np.linalg.norm(away - share[:, None] * along, axis=1))


def _check_joint(joint: Joint, structure: Entries, passing: npt.NDArray[np.bool_]) -> None:
    there = [member.name for member, passes in zip(structure.member, passing, strict=True) if passes]
    if joint.member not in there:
        raise ValueError(f"joint of {joint.member}: {list(joint.at)} does not lie on it")
    held = any(np.linalg.norm(np.subtract(support.at, joint.at)) < ON_MEMBER for support in structure.support)
    if len(there) < 2 and not held:
        raise ValueError(f"joint of {joint.member}: no other member and no support is at {list(joint.at)}")


def odd_units(structure: Entries) -> list[str]:
    """Return a line for each material and section that no structure is built of, and for an improbable mass.

    A material is judged by the speed of waves along a bar, in which megapascals and g/cm3 show; a section by how far
    from its axis it lies, over the largest extent of the structure, in which millimetres show. If all lengths are in
    millimetres, the mass is 1e9 times too large.
    """
    ends = [point for member in structure.member for point in (member.start, member.end)]
    extent = max(max(axis) - min(axis) for axis in zip(*ends, strict=True))
    notes = []
    for name, material in structure.material.items():
        speed = math.sqrt(material.youngs_modulus / material.density)
        if not _SLOWEST < speed < _FASTEST:
            notes.append(
                f"material {name}: waves would run through it at {speed:.2g} m/s (steel: 5200); "
                "is youngs_modulus in Pa, density in kg/m3?"
            )
    for name, section in structure.section.items():
        radius = math.sqrt(max(section.second_moment) / section.area)
        if radius > extent:
            notes.append(
                f"section {name}: its radius of gyration is {radius:.3g} m, the whole structure {extent:.3g} m long; "
                "is it in m, m2, m4?"
            )
    mass = sum(_masses_of_members(structure))
    if mass > _HEAVIEST:
        notes.append(f"the members weigh {mass:.2g} kg, and the structure is {extent:.3g} m long; are lengths in m?")
    return notes


def mean_flexibilities(structure: Entries) -> list[str]:
    """Return a line for each crack that opens and closes, or slips: linear analyses have its mean flexibility."""
    return [
        f"breathing_crack of {crack.member} at {list(crack.at)}: modes are those of its mean flexibility; "
        f"in `modalwatch rig` it {'sticks and slides' if crack.opens == 'slips' else 'opens and closes'}"
        for crack in structure.breathing_crack
    ]

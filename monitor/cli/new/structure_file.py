"""Structure files of common kinds of frames, with comments."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from monitor.analysis.logs import log_channels
from monitor.cli.options import DONE, KINDS
from monitor.cli.output import asked, write_new
from monitor.cli.terminal import echo, warn
from monitor.errors import ArgumentError
from monitor.text.quantities import counted
from updater import StructureError, parse_structure
from updater.structure import odd_units

Point = tuple[float, float, float]

_MATERIALS = {
    "steel": "youngs_modulus = 210e9\npoisson_ratio = 0.3\ndensity = 7850",
    "aluminium": "youngs_modulus = 70e9\npoisson_ratio = 0.33\ndensity = 2700",
    "concrete": "youngs_modulus = 33e9          # C30/37, uncracked\npoisson_ratio = 0.2\ndensity = 2500",
    "timber": "youngs_modulus = 11e9          # C24, along the grain\nshear_modulus = 0.69e9\ndensity = 420",
}
_DIMENSIONS = {
    "rectangle": ("width", "height"),
    "box": ("width", "height", "thickness", "corner_radius"),
    "circle": ("diameter",),
    "tube": ("diameter", "thickness"),
    "i": ("width", "height", "web", "flange"),
}
_NOTES = {"corner_radius": "          # outer; 0: sharp. Measure it: area, and masses found, depend on it"}
_RADIUS = 2.0  # thicknesses: outer corner radius of cold-formed tubes up to 6 mm, EN 10219-2
_QUESTIONS = {
    "height": "height of a column, post or storey [m]",
    "length": "length of the beam [m]",
    "storeys": "number of storeys",
    "section": "section of the members, such as box:0.06,0.04,0.003 or rectangle:0.05,0.005 [m]",
}
_NEEDED = {
    "cantilever": ("height",),
    "beam": ("length",),
    "portal": ("height", "length"),
    "storeys": ("height", "length", "storeys"),
    "t-frame": ("height", "length"),
}
_ROUNDING = 1e-9  # relative: distances up to the end of a member
_ELEMENTS = 20  # of the longest member: a static shape function each, exact at its nodes


def _between_the_ends(n: int) -> tuple[float, ...]:
    return tuple(k / (n + 1) for k in range(1, n + 1))


def _up_to_the_end(n: int) -> tuple[float, ...]:
    return tuple(k / n for k in range(1, n + 1))


def _from_end_to_end(n: int) -> tuple[float, ...]:
    return tuple(k / (n - 1) for k in range(n)) if n > 1 else (1.0,)


@dataclass(frozen=True, kw_only=True)
class _Member:
    name: str
    start: Point
    end: Point
    directions: str  #: axes that its sensors measure
    section: str = "main"
    places: Callable[[int], tuple[float, ...]] = _between_the_ends  #: of n sensors, as shares of the length

    def at(self, share: float) -> Point:
        """Return a point, as a share of the length."""
        x, y, z = (a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class SensorPlaces:
    """Measured places of the members."""

    number: int  #: places of a member, at equal distances
    distances: Mapping[str, tuple[float, ...]]  #: from the start of a member [m], by its name, in place of these
    option: str = "--sensors-at"  #: that gives the distances

    def of(self, member: _Member) -> list[Point]:
        """Return the measured points of a member.

        Raises
        ------
        ArgumentError
            If a distance is beyond its end.
        """
        if member.name not in self.distances:
            return [member.at(share) for share in member.places(self.number)]
        length = math.dist(member.start, member.end)
        for distance in self.distances[member.name]:
            if not 0 <= distance <= length * (1 + _ROUNDING):
                raise ArgumentError(
                    self.option, f"{member.name}: expected distances from 0 to {length:g} m, found {distance:g}"
                )
        return [member.at(min(distance / length, 1.0)) for distance in self.distances[member.name]]


def places_of(number: int, given: Sequence[str], option: str = "--sensors-at") -> SensorPlaces:
    """Return the measured places that an option gives as MEMBER:DISTANCE,..

    Raises
    ------
    ArgumentError
        If one of them has another form.
    """
    distances: dict[str, tuple[float, ...]] = {}
    for text in given:
        member, colon, listed = text.rpartition(":")
        try:
            found = tuple(float(value) for value in listed.split(","))
        except ValueError:
            found = ()
        if not (member and colon and found):
            raise ArgumentError(option, f"expected MEMBER:DISTANCE,.. in m, found {text!r}")
        distances[member] = found
    return SensorPlaces(number=number, distances=distances, option=option)


@dataclass(frozen=True, kw_only=True)
class _MeasuredAxis:
    channel: str
    at: Point
    axis: str
    sign: int = 1


@dataclass(frozen=True, kw_only=True)
class _Frame:
    members: tuple[_Member, ...]
    feet: tuple[Point, ...]  #: fixed, or pinned if so wanted
    supports: tuple[tuple[Point, str], ...] = ()  #: others, with their fixed axes


def write_structure(
    path: Path,
    kind: str | None,
    given: Mapping[str, float | str | None],
    *,
    beam_section: str | None,
    material: str,
    sensors: "SensorPlaces",
    listed: Sequence[str],
    channels: Path | None,
    sensor_mass: float | None,
    foot_stiffness: float | None,
    pinned: bool,
    force: bool,
) -> int:
    """Write the structure file of a kind of frame; what is needed and not given is asked for.

    Raises
    ------
    ArgumentError
        If something is missing, invalid or not used by this kind, or the file exists.
    """
    if kind is None:
        kind = asked("KIND", "kind of structure", KINDS)
    if kind not in KINDS:
        raise ArgumentError("KIND", f"expected one of {', '.join(KINDS)}, found {kind!r}")
    sizes = {name: _size(name, given[name]) for name in _NEEDED[kind]}
    for name in _QUESTIONS.keys() - {"section"} - sizes.keys():
        if given[name] is not None:
            raise ArgumentError(f"--{name}", f"is no dimension of a {kind}")
    frame = _FRAMES[kind](sizes)
    if pinned and len(frame.feet) < 2:
        raise ArgumentError("--pinned", f"a {kind} needs fixed feet, or it can move without deformation")
    if pinned and foot_stiffness is not None:
        raise ArgumentError("--pinned", "expected no --foot-stiffness with it")
    names = [member.name for member in frame.members]
    for name in sensors.distances:
        if name not in names:
            raise ArgumentError("--sensors-at", f"no member is named {name!r}; there are {', '.join(names)}")
    has_beams = any(member.section == "beam" for member in frame.members)
    if beam_section is not None and not has_beams:
        raise ArgumentError("--beam-section", f"a {kind} has one section: give it as --section")
    sections = {"main": _section("--section", str(given["section"] or asked("--section", _QUESTIONS["section"])))}
    if has_beams:
        sections["beam"] = _section("--beam-section", beam_section) if beam_section else sections["main"]
    measured = [_listed_axis(frame, text) for text in listed] or list(_measured_axes(frame, sensors))
    if listed and (sensors.distances or channels is not None):
        raise ArgumentError("--sensor", "expected neither --sensors-at nor --channels with it")
    if channels is not None:
        measured = _with_channels(measured, channels)
    for option, value in (("--sensor-mass", sensor_mass), ("--foot-stiffness", foot_stiffness)):
        if value is not None and not 0 < value < math.inf:
            raise ArgumentError(option, f"expected a positive number, found {value:g}")
    feet = _feet(frame.feet, foot_stiffness, pinned=pinned)
    text = "\n".join(_lines(kind, frame, sections, material, measured, sensor_mass, feet))
    try:
        loaded = parse_structure(text)
    except StructureError as error:
        raise ArgumentError("--section", str(error)) from error
    write_new(path, text, force=force)
    content = f"{counted(len(loaded.member), 'member')}, {counted(len(loaded.sensor), 'sensor')}"
    echo(f"written: {path}: {content}")
    for note in odd_units(loaded):
        warn(f"note: {note}")
    echo(f"next: edit it, then draw and check it: modalwatch structure {path}")
    return DONE


def _size(name: str, value: float | str | None) -> float:
    found = value if value is not None else asked(f"--{name}", _QUESTIONS[name])
    try:
        size = float(found)
    except ValueError as error:
        raise ArgumentError(f"--{name}", f"expected a number, found {found!r}") from error
    if not 0 < size < float("inf") or (name == "storeys" and size % 1):
        raise ArgumentError(f"--{name}", f"expected a {'whole ' * (name == 'storeys')}positive number, found {found}")
    return size


def _section(option: str, text: str) -> str:
    """Return the entries of a section given as SHAPE:DIMENSION,.."""
    shape, _, listed = text.partition(":")
    if shape not in _DIMENSIONS:
        raise ArgumentError(
            option, f"expected SHAPE:DIMENSIONS with a shape of {', '.join(_DIMENSIONS)}, found {text!r}"
        )
    names, values = _DIMENSIONS[shape], listed.split(",")
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        numbers = []
    if shape == "box" and len(numbers) == len(names) - 1:
        width, height, thickness = numbers
        radius = _RADIUS * thickness
        numbers.append(radius if radius < min(width, height) / 2 else 0.0)
    if len(numbers) != len(names):
        form = ",".join(names).upper().replace(",CORNER_RADIUS", "[,CORNER_RADIUS]")
        raise ArgumentError(option, f"expected {shape}:{form} in m, found {text!r}")
    dimensions = (f"{n} = {number:g}{_NOTES.get(n, '')}" for n, number in zip(names, numbers, strict=True))
    return "\n".join([f'shape = "{shape}"', *dimensions])


def _column(height: float) -> _Member:
    return _Member(name="column", start=(0, 0, 0), end=(0, 0, height), directions="xy", places=_up_to_the_end)


def _beam(size: Mapping[str, float]) -> _Frame:
    end = (size["length"], 0.0, 0.0)
    beam = _Member(name="beam", start=(0, 0, 0), end=end, directions="yz")
    return _Frame(members=(beam,), feet=(), supports=(((0, 0, 0), "x y z rx"), (end, "y z rx")))


def _storeys(size: Mapping[str, float]) -> _Frame:
    n, height, length = int(size.get("storeys", 1)), size["height"], size["length"]
    top = n * height
    posts = tuple(
        _Member(
            name=f"{side} post",
            start=(x, 0, 0),
            end=(x, 0, top),
            directions="xy",
            places=_between_the_ends if n == 1 else lambda _: _up_to_the_end(n),  # at each floor
        )
        for side, x in (("left", 0.0), ("right", length))
    )
    beams = tuple(
        _Member(
            name=f"beam {level}" if n > 1 else "beam",
            start=(0, 0, level * height),
            end=(length, 0, level * height),
            directions="yz",
            section="beam",
        )
        for level in range(1, n + 1)
    )
    return _Frame(members=(*posts, *beams), feet=((0, 0, 0), (length, 0, 0)))


def _t_frame(size: Mapping[str, float]) -> _Frame:
    height, half = size["height"], size["length"] / 2
    beam = _Member(
        name="crossbeam",
        start=(-half, 0, height),
        end=(half, 0, height),
        directions="yz",
        section="beam",
        places=_from_end_to_end,
    )
    return _Frame(members=(_column(height), beam), feet=((0, 0, 0),))


_FRAMES: dict[str, Callable[[Mapping[str, float]], _Frame]] = {
    "cantilever": lambda size: _Frame(members=(_column(size["height"]),), feet=((0, 0, 0),)),
    "beam": _beam,
    "portal": _storeys,
    "storeys": _storeys,
    "t-frame": _t_frame,
}


def _lines(
    kind: str,
    frame: _Frame,
    sections: Mapping[str, str],
    material: str,
    measured: Sequence[_MeasuredAxis],
    sensor_mass: float | None,
    feet: Sequence[str],
) -> Iterator[str]:
    yield "# Structure file of modalwatch. Axes: x along the beam, y out of the plane of the frame, z up."
    yield "# SI units throughout: m, kg, N, Pa. `modalwatch structure FILE` draws it and lists its modes."
    yield f'name = "{kind}"\n'
    yield "[mesh]"
    longest = max(sum((b - a) ** 2 for a, b in zip(m.start, m.end, strict=True)) ** 0.5 for m in frame.members)
    yield f"element_length = {longest / _ELEMENTS:.3g}          # longest element [m]\n"
    yield f"[material.{material}]\n{_MATERIALS[material]}\n"
    yield "# Sections: width is along the local y axis of a member (horizontal; of an upright member out of the plane)."
    for name, text in sections.items():
        yield f"[section.{name}]\n{text}\n"
    yield "# Members are joined where one ends on another."
    for member in frame.members:
        yield f'[[member]]\nname = "{member.name}"\nfrom = {_point(member.start)}\nto = {_point(member.end)}'
        yield f'material = "{material}"\nsection = "{member.section}"\n'
    yield "# Supports: axes that are held. A yielding foot, such as a plate on bolts, has springs in their place:"
    yield '# fixed = ["x", "y", "z"], stiffness = {rx = 2e5, ry = 2e5, rz = 2e5}; N/m for x y z, N m/rad for rx ry rz.'
    yield "# `diagnose` fits springs to the reference log: a tenth or ten times the true value is near enough."
    yield from feet
    for at, fixed in frame.supports:
        yield _support(at, fixed)
    yield "# Attached bodies whose mass is known, such as clamps and sensors:"
    if sensor_mass is None:
        yield "# [[body]]\n# at = [0.0, 0.0, 1.0]\n# mass = 0.25\n"
    else:
        for at in dict.fromkeys(axis.at for axis in measured):
            yield f"[[body]]\nat = {_point(at)}\nmass = {sensor_mass:g}\n"
    yield "# Sensors: one entry per measured axis. `channel` is its name in the data; the direction is positive."
    yield "# `at` is the position on the axis of a member. Replace names and positions by those of your sensors."
    for sensor in measured:
        direction = [sensor.sign * (sensor.axis == other) for other in "xyz"]
        name = json.dumps(sensor.channel, ensure_ascii=False)
        yield f"[[sensor]]\nchannel = {name}\nat = {_point(sensor.at)}\ndirection = {direction}\n"


def _feet(feet: Sequence[Point], stiffness: float | None, *, pinned: bool) -> list[str]:
    """Return the entries of fixed feet, of pinned ones, or of feet that yield in all rotations."""
    fixed = "x y z" if stiffness is not None else "x y z rx rz" if pinned else "x y z rx ry rz"
    return [_support(at, fixed, stiffness) for at in feet]


def _support(at: Point, fixed: str, stiffness: float | None = None) -> str:
    axes = ", ".join(f'"{axis}"' for axis in fixed.split())
    each = ", ".join(f"{axis} = {stiffness:g}" for axis in ("rx", "ry", "rz") if stiffness is not None)
    springs = f"stiffness = {{{each}}}\n" if each else ""
    return f"[[support]]\nat = {_point(at)}\nfixed = [{axes}]\n{springs}"


def _measured_axes(frame: _Frame, places: SensorPlaces) -> Iterator[_MeasuredAxis]:
    taken: set[tuple[Point, str]] = set()
    held = {*frame.feet, *(at for at, _ in frame.supports)}
    for member in frame.members:
        for number, at in enumerate(places.of(member), 1):
            for axis in member.directions:
                if at in held or (at, axis) in taken:
                    continue
                taken.add((at, axis))
                channel = f"{member.name.replace(' ', '_')}_{number}_{axis}"
                yield _MeasuredAxis(channel=channel, at=at, axis=axis)


def _listed_axis(frame: _Frame, text: str) -> _MeasuredAxis:
    """Return the measured axis of a sensor given as CHANNEL=MEMBER:DISTANCE:AXIS.

    Raises
    ------
    ArgumentError
        If it has another form, or is of no member of the frame.
    """
    channel, _, place = text.rpartition("=")
    member, _, rest = place.partition(":")
    distance, _, axis = rest.rpartition(":")
    members = {known.name: known for known in frame.members}
    if not channel or axis.removeprefix("-") not in tuple("xyz"):
        raise ArgumentError("--sensor", f"expected CHANNEL=MEMBER:DISTANCE:AXIS, found {text!r}")
    if member not in members:
        raise ArgumentError("--sensor", f"{text}: no member is named {member!r}; there are {', '.join(members)}")
    (at,) = places_of(1, [f"{member}:{distance}"], "--sensor").of(members[member])
    return _MeasuredAxis(channel=channel, at=at, axis=axis[-1], sign=-1 if axis.startswith("-") else 1)


def _with_channels(measured: Sequence[_MeasuredAxis], log: Path) -> list[_MeasuredAxis]:
    """Return the measured axes with the channels of a log, in its order.

    Raises
    ------
    ArgumentError
        If there are more or fewer, or a name that ends with an axis is that of another axis.
    LogError
        If the log cannot be read, or has no channels.
    """
    names = [channel.name for channel in log_channels(log)]
    expected = ", ".join(axis.channel for axis in measured)
    if len(names) != len(measured):
        raise ArgumentError("--channels", f"{log} has {len(names)} channels, expected {len(measured)}: {expected}")
    for name, own in zip(names, measured, strict=True):
        last = name.lower()[-2:]
        if last in ("_x", "_y", "_z", " x", " y", " z") and last[1] != own.axis:
            raise ArgumentError(
                "--channels", f"{log}: channel {name!r} has the place of {own.channel}; expected order: {expected}"
            )
    return [replace(own, channel=name) for name, own in zip(names, measured, strict=True)]


def _point(at: Point) -> str:
    return f"[{', '.join(f'{round(c, 4) + 0.0:.10g}' if c % 1 else f'{c:.1f}' for c in at)}]"

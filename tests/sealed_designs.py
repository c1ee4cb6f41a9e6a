"""Other structures, each as its owner's file says it and as it stands: a portal, a bridge, a mast, a grid.

What stands is off by as much as the T-frame is: moduli, density, walls, springs, what sensors weigh, where they are
and point, their gains and delays.
"""

from dataclasses import dataclass, replace

import numpy as np
from sealed_frame import Bar, Frame, Ground, Lump, Meeting, Vector
from sealed_specimen import FrameBody, Random, Scale, Sensor, State

_AXES = ("x", "y", "z")
_USUAL = 210e9 * 9.3e-8 / 1.48, 7.5, 1.48  # of the T-frame: E I / L [N m], mass [kg], longest bar [m]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section's constants; second moments about the two cross axes of a bar."""

    area: float
    second_moment: tuple[float, float]
    torsion_constant: float
    shear_factor: float


@dataclass(frozen=True, kw_only=True)
class Design:
    """A structure as its file says it; springs of grounds and meetings are nominal."""

    name: str
    bars: tuple[Bar, ...]
    grounds: tuple[Ground, ...]
    meetings: tuple[Meeting, ...]
    devices: tuple[tuple[str, float, str, str], ...]  #: bar, place along it [m], name, axes
    bodies: tuple[Lump, ...] = ()
    band: float
    window: float
    element: float  #: length of the file's elements [m]

    @property
    def scale(self) -> Scale:
        """Return how large it is over the T-frame."""
        longest = max(self.bars, key=lambda bar: bar.length)
        unit = longest.modulus * max(longest.second_moment) / longest.length
        mass = sum(bar.density * bar.area * bar.length for bar in self.bars)
        return Scale(
            stiffness=unit / _USUAL[0],
            mass=mass / _USUAL[1],
            length=longest.length / _USUAL[2],
            band=self.band,
            window=self.window,
        )

    def toml(self) -> str:
        """Return its structure file."""
        parts = [
            f'name = "{self.name}"\n[mesh]\nelement_length = {self.element}',
            "[material.steel]\nyoungs_modulus = 210e9\npoisson_ratio = 0.3\ndensity = 7850",
        ]
        for bar in self.bars:
            across = [float(i == bar.order[1]) for i in range(3)]
            parts += [
                f"[section.{bar.name}]\narea = {bar.area}\nsecond_moment = {list(bar.second_moment)}\n"
                f"torsion_constant = {bar.torsion_constant}\nshear_factor = {bar.shear_factor}",
                f'[[member]]\nname = "{bar.name}"\nfrom = {list(bar.start)}\nto = {list(bar.point(bar.length))}\n'
                f'material = "steel"\nsection = "{bar.name}"\nlocal_y = {across}',
            ]
        parts += [_support(self._place(g.bar, g.s), g) for g in self.grounds]
        for m in self.meetings:
            if np.isfinite(m.about).all():
                springs = ", ".join(f"r{a} = {k}" for a, k in zip(_AXES, m.about, strict=True))
                parts.append(
                    f'[[joint]]\nmember = "{m.other}"\nat = {self._place(m.bar, m.s)}\nstiffness = {{ {springs} }}'
                )
        parts += [
            f"[[body]]\nat = {self._place(b.bar, b.s)}\nmass = {b.mass}\noffset = {list(b.offset)}" for b in self.bodies
        ]
        for on, s, device, axes in self.devices:
            for axis in axes:
                unit = [int(a == axis) for a in _AXES]
                at = self._place(on, s)
                parts.append(f'[[sensor]]\nchannel = "{device}_{axis}"\nat = {at}\ndirection = {unit}')
        return "\n\n".join(parts) + "\n"

    def _place(self, bar: str, s: float) -> list[float]:
        return list(next(b for b in self.bars if b.name == bar).point(s))

    def draw(self, seed: int, *, n_modes: int = 30) -> State:
        """Draw one that stands."""
        random = np.random.default_rng((seed, 14))
        body = FrameBody(self._frame(random))
        sensors = self._sensors(random)
        per_device = np.repeat(np.arange(len(self.devices)), [len(axes) for *_, axes in self.devices])
        return State(
            body=body,
            drawn=body,
            sensors=sensors,
            forces=self._forces(random),
            damping=random.uniform(0.002, 0.006, n_modes),
            gain=1 + 0.005 * random.standard_normal(len(sensors)),
            delay=(2e-5 * random.standard_normal(len(self.devices)))[per_device],
            order=np.arange(len(sensors)),
            scale=self.scale,
        )

    def _frame(self, random: Random) -> Frame:
        e, rho = 1 + 0.01 * random.standard_normal(), 1 + 0.007 * random.standard_normal()
        bars = []
        for bar in self.bars:
            wall = 1 + 0.005 * random.standard_normal()
            first, second = bar.second_moment
            bars.append(
                replace(
                    bar,
                    modulus=bar.modulus * e,
                    shear_modulus=bar.shear_modulus * e,
                    density=bar.density * rho,
                    area=bar.area * wall,
                    second_moment=(first * wall, second * wall),
                    torsion_constant=bar.torsion_constant * wall,
                )
            )
        frame = Frame(
            bars=tuple(bars),
            grounds=tuple(
                replace(g, along=_scattered(g.along, random), about=_scattered(g.about, random)) for g in self.grounds
            ),
            meetings=tuple(replace(m, about=_scattered(m.about, random)) for m in self.meetings),
        )
        for bar in frame.bars:
            own = (*bar.breaks, *frame.stops(bar.name)[1:-1])
            frame = frame.with_bar(bar.name, breaks=tuple(sorted(set(own))))
        return replace(frame, lumps=(*self.bodies, *self._carried(random)))

    def _carried(self, random: Random) -> list[Lump]:
        """Return what the accelerometers weigh, off the axis."""
        scale = self.scale
        return [
            Lump(
                bar=bar,
                s=s,
                mass=scale.mass * random.uniform(0.004, 0.008),
                offset=_three(0.007 * scale.length * random.standard_normal(3)),
            )
            for bar, s, *_ in self.devices
        ]

    def _sensors(self, random: Random) -> tuple[Sensor, ...]:
        """Every device is off its place by as much of its bar as on the T-frame, and turned by one degree."""
        found = []
        for bar, s, device, axes in self.devices:
            length = next(b for b in self.bars if b.name == bar).length
            off = float(np.clip(s + 1.35e-3 * length * random.standard_normal(), 0.0, length))
            turn = np.radians(1.0) * random.standard_normal(3)
            for axis in axes:
                unit = np.eye(3)[_AXES.index(axis)]
                direction = unit + np.cross(turn, unit)
                found.append(
                    Sensor(
                        channel=f"{device}_{axis}",
                        device=device,
                        bar=bar,
                        s=off,
                        direction=_three(direction / np.linalg.norm(direction)),
                    )
                )
        return tuple(found)

    def _forces(self, random: Random) -> tuple[Sensor, ...]:
        """Return where the wind pushes, across each bar."""
        return tuple(
            Sensor(channel="", device="", bar=bar.name, s=s, direction=_three(np.eye(3)[axis]))
            for bar in self.bars
            for s in random.uniform(0.1, 1.0, 3) * bar.length
            for axis in bar.order[1:]
        )


def _scattered(springs: Vector, random: Random) -> Vector:
    """Draw springs of half to twice what the file says; those that are rigid or none stay so."""
    return _three(np.multiply(springs, np.exp(random.uniform(-np.log(2), np.log(2), 3))))


def _support(place: list[float], ground: Ground) -> str:
    names = [*_AXES, *(f"r{a}" for a in _AXES)]
    values = (*ground.along, *ground.about)
    fixed = [n for n, k in zip(names, values, strict=True) if np.isinf(k)]
    springs = ", ".join(f"{n} = {k}" for n, k in zip(names, values, strict=True) if 0 < k < np.inf)
    found = f"[[support]]\nat = {place}\nfixed = {fixed}".replace("'", '"')
    return found + (f"\nstiffness = {{ {springs} }}" if springs else "")


def _bar(name: str, start: Vector, axis: int, length: float, section: Section, size: float) -> Bar:
    return Bar(
        name=name,
        start=start,
        axis=axis,
        length=length,
        size=size,
        modulus=210e9,
        shear_modulus=80.77e9,
        density=7850.0,
        area=section.area,
        second_moment=section.second_moment,
        torsion_constant=section.torsion_constant,
        shear_factor=section.shear_factor,
    )


def _three(values: object) -> Vector:
    x, y, z = (float(v) for v in values)  # type: ignore[attr-defined]
    return x, y, z


def _box(across_first: float, across_second: float, wall: float) -> Section:
    """Return a thin box's constants from its outer measures along the two cross axes [m]."""
    a, b = across_first, across_second
    c, d = a - 2 * wall, b - 2 * wall
    middle = (a - wall) * (b - wall)
    return Section(
        area=a * b - c * d,
        second_moment=((a * b**3 - c * d**3) / 12, (b * a**3 - d * c**3) / 12),
        torsion_constant=2 * middle**2 * wall / (a + b - 2 * wall),
        shear_factor=0.44,
    )


def _tube(diameter: float, wall: float) -> Section:
    inner = diameter - 2 * wall
    second = np.pi / 64 * (diameter**4 - inner**4)
    return Section(
        area=float(np.pi / 4 * (diameter**2 - inner**2)),
        second_moment=(float(second), float(second)),
        torsion_constant=float(2 * second),
        shear_factor=0.53,
    )


def _rigid_but(axes: str = "", stiffness: float = 0.0) -> Vector:
    x, y, z = (stiffness if a in axes else np.inf for a in _AXES)
    return x, y, z


_POST, _BEAM = _box(0.06, 0.06, 0.003), _box(0.04, 0.08, 0.003)
_UNIT = 210e9 * _POST.second_moment[0] / 2.0 / 0.004  # N m/rad
PORTAL = Design(
    name="portal",
    bars=(
        _bar("left", (0.0, 0.0, 0.0), 2, 2.0, _POST, 0.06),
        _bar("beam", (0.0, 0.0, 2.0), 0, 3.0, _BEAM, 0.06),
        _bar("right", (3.0, 0.0, 0.0), 2, 2.0, _POST, 0.06),
    ),
    grounds=(Ground(bar="left", s=0.0, about=(_UNIT,) * 3), Ground(bar="right", s=0.0, about=(_UNIT,) * 3)),
    meetings=(
        Meeting(bar="left", s=2.0, other="beam", t=0.0, about=(_UNIT,) * 3),
        Meeting(bar="right", s=2.0, other="beam", t=3.0, about=(_UNIT,) * 3),
    ),
    devices=(
        *((post, z, f"{post}_{round(10 * z):02d}", "xy") for post in ("left", "right") for z in (0.8, 1.5)),
        *(("beam", x, f"beam_{round(100 * x):03d}", "yz") for x in (0.75, 1.5, 2.25)),
    ),
    band=150.0,
    window=120.0,
    element=0.1,
)

_GIRDER = _box(0.20, 0.30, 0.008)
BRIDGE = Design(
    name="bridge",
    bars=(_bar("girder", (0.0, 0.0, 0.0), 0, 12.0, _GIRDER, 0.3),),
    grounds=(
        Ground(bar="girder", s=0.0, along=_rigid_but("z", 8e7), about=(np.inf, 0.0, 0.0)),
        Ground(bar="girder", s=12.0, along=(0.0, np.inf, 8e7), about=(np.inf, 0.0, 0.0)),
    ),
    meetings=(),
    devices=tuple(("girder", x, f"g_{round(10 * x):03d}", "yz") for x in (1.5, 3.5, 5.0, 6.5, 8.5, 10.5)),
    band=180.0,
    window=600.0,
    element=0.4,
)

_LOW, _MID, _TOP = _tube(0.324, 0.008), _tube(0.273, 0.0063), _tube(0.219, 0.005)
_FOOT = 210e9 * _LOW.second_moment[0] / 15.0 / 0.004
MAST = Design(
    name="mast",
    bars=(
        _bar("low", (0.0, 0.0, 0.0), 2, 5.0, _LOW, 0.25),
        _bar("mid", (0.0, 0.0, 5.0), 2, 5.0, _MID, 0.25),
        _bar("top", (0.0, 0.0, 10.0), 2, 5.0, _TOP, 0.25),
    ),
    grounds=(Ground(bar="low", s=0.0, about=(_FOOT, 1.5 * _FOOT, np.inf)),),
    meetings=(Meeting(bar="low", s=5.0, other="mid", t=0.0), Meeting(bar="mid", s=5.0, other="top", t=0.0)),
    devices=(
        *(("low", z, f"m_{round(10 * z):03d}", "xy") for z in (2.5, 4.5)),
        *(("mid", z, f"m_{round(10 * z) + 50:03d}", "xy") for z in (2.0, 4.0)),
        *(("top", z, f"m_{round(10 * z) + 100:03d}", "xy") for z in (2.5, 5.0)),
    ),
    bodies=(Lump(bar="top", s=5.0, mass=30.0, offset=(0.15, 0.0, 0.2)),),
    band=120.0,
    window=600.0,
    element=0.5,
)

_LONG, _CROSS = _box(0.06, 0.10, 0.004), _box(0.08, 0.06, 0.003)
GRID = Design(
    name="grid",
    bars=(
        _bar("south", (0.0, 0.0, 0.0), 0, 4.0, _LONG, 0.1),
        _bar("north", (0.0, 1.2, 0.0), 0, 4.0, _LONG, 0.1),
        *(_bar(f"cross{i}", (x, 0.0, 0.0), 1, 1.2, _CROSS, 0.1) for i, x in enumerate((0.0, 1.4, 2.6, 4.0))),
    ),
    grounds=(
        Ground(bar="south", s=0.0),
        Ground(bar="south", s=4.0, along=(0.0, np.inf, np.inf)),
        Ground(bar="north", s=0.0, along=(0.0, 0.0, np.inf)),
        Ground(bar="north", s=4.0, along=(0.0, 0.0, np.inf)),
    ),
    meetings=tuple(
        Meeting(bar=girder, s=x, other=f"cross{i}", t=y)
        for girder, y in (("south", 0.0), ("north", 1.2))
        for i, x in enumerate((0.0, 1.4, 2.6, 4.0))
    ),
    devices=tuple(
        (girder, x, f"{girder}_{round(10 * x):02d}", "z")
        for girder in ("south", "north")
        for x in (0.7, 1.4, 2.1, 2.6, 3.4)
    ),
    band=158.0,
    window=120.0,
    element=0.1,
)

DESIGNS = {design.name: design for design in (PORTAL, BRIDGE, MAST, GRID)}

"""A structure as its owner's file describes it and as it really is.

The real structure is off by as much as the T-frame is: moduli, density, walls, springs, masses of sensors, their
positions and directions, their gains and delays.
"""

from dataclasses import dataclass, replace

import numpy as np

from tests.examiner.models.bar import Bar, Vector, vector
from tests.examiner.models.frame import Frame, Ground, Lump, Meeting
from tests.examiner.models.specimen import FrameBody, Random, Scale, Sensor, State, mounted

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
    """A structure as described by its file; springs of supports and joints are nominal."""

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
        """Draw a real one."""
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
        """Return the masses of the accelerometers, off the axis."""
        scale = self.scale
        return [
            Lump(
                bar=bar,
                s=s,
                mass=scale.mass * random.uniform(0.004, 0.008),
                offset=vector(0.007 * scale.length * random.standard_normal(3)),
            )
            for bar, s, *_ in self.devices
        ]

    def _sensors(self, random: Random) -> tuple[Sensor, ...]:
        """Every device is off its place by as much of its bar as on the T-frame, and turned by one degree."""
        found = []
        for bar, s, device, axes in self.devices:
            length = next(b for b in self.bars if b.name == bar).length
            found += mounted(random, device, axes, bar, s, length=length, off=1.35e-3 * length)
        return tuple(found)

    def _forces(self, random: Random) -> tuple[Sensor, ...]:
        """Return where the wind pushes, across each bar."""
        return tuple(
            Sensor(channel="", device="", bar=bar.name, s=s, direction=vector(np.eye(3)[axis]))
            for bar in self.bars
            for s in random.uniform(0.1, 1.0, 3) * bar.length
            for axis in bar.order[1:]
        )


def _scattered(springs: Vector, random: Random) -> Vector:
    """Draw springs of half to twice the file's values; rigid ones and missing ones stay."""
    return vector(np.multiply(springs, np.exp(random.uniform(-np.log(2), np.log(2), 3))))


def _support(place: list[float], ground: Ground) -> str:
    names = [*_AXES, *(f"r{a}" for a in _AXES)]
    values = (*ground.along, *ground.about)
    fixed = [n for n, k in zip(names, values, strict=True) if np.isinf(k)]
    springs = ", ".join(f"{n} = {k}" for n, k in zip(names, values, strict=True) if 0 < k < np.inf)
    found = f"[[support]]\nat = {place}\nfixed = {fixed}".replace("'", '"')
    return found + (f"\nstiffness = {{ {springs} }}" if springs else "")

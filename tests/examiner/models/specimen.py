"""A specimen with all its small errors at once, and the true signals of its channels: drawn from a seed."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from tests.examiner.models.bar import Bar, Vector, Zone, vector
from tests.examiner.models.frame import Frame, Ground, Lump, Meeting

Random = np.random.Generator
REFERENCE_TEMPERATURE = 20.0  #: [degC]
SOFTENING = -3.6e-4  #: of steel's modulus [1/K]
_SPAN = 1.48  # of the column [m]
_HALF = 0.40  # of the crossbeam


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """One channel: where it really is and which way it really points."""

    channel: str
    device: str
    bar: str
    s: float  #: along the bar [m]
    direction: Vector  #: unit


@dataclass(frozen=True, eq=False)
class Motion:
    """Modes of a specimen as they are, read wherever it is wanted."""

    frequency: FloatArray  #: (n_modes,) [Hz]
    at_sensors: FloatArray  #: (n_modes, n_channels) mass-normalised
    at_forces: FloatArray  #: (n_modes, n_forces)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Size of a specimen over the T-frame's, and its measurement."""

    length: float = 1.0
    mass: float = 1.0
    stiffness: float = 1.0  #: E I / L
    band: float = 290.0  #: Hz, that is analysed
    window: float = 120.0  #: s, that the uncertainty law is taken at


class Body(Protocol):
    """Anything that vibrates."""

    def __hash__(self) -> int: ...

    def motion(self, sensors: tuple[Sensor, ...], forces: tuple[Sensor, ...], n_modes: int) -> Motion:
        """Modes at sensors and at forces."""
        ...


@dataclass(frozen=True)
class FrameBody:
    """The frame at a temperature."""

    frame: Frame
    temperature: float = REFERENCE_TEMPERATURE

    def motion(self, sensors: tuple[Sensor, ...], forces: tuple[Sensor, ...], n_modes: int) -> Motion:
        softer = 1 + SOFTENING * (self.temperature - REFERENCE_TEMPERATURE)
        frame = self.frame
        for bar in frame.bars:
            moduli = {"modulus": bar.modulus * softer, "shear_modulus": bar.shear_modulus * softer}
            frame = frame.with_bar(bar.name, **moduli)
        solved = frame.solved(n_modes)
        seen, pushed = (
            np.array([np.array(s.direction) @ solved.motion(s.bar, s.s)[:3] for s in which]).T
            for which in (sensors, forces)
        )
        return Motion(solved.frequency, seen, pushed)


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """A body with its measuring chain, at one time."""

    body: Body
    sensors: tuple[Sensor, ...]
    forces: tuple[Sensor, ...]
    damping: FloatArray  #: (n_modes,) of critical, of the specimen's modes as it was drawn
    drawn: Body  #: as it was drawn
    gain: FloatArray  #: (n_channels,) what a sensor says over what is true
    delay: FloatArray  #: (n_channels,) of each sensor [s]
    order: IndexArray  #: (n_channels,) sensor that each channel really is
    dead: tuple[str, ...] = ()
    clock: float = 1.0  #: samples per second over what is claimed
    temperature: float = REFERENCE_TEMPERATURE  #: what devices report
    loudness: float = 1.0  #: of the forces
    scale: Scale = Scale()
    solved: dict[int, Motion] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(s.channel for s in self.sensors)

    def motion(self, n_modes: int) -> Motion:
        """Modes at the sensors' places, solved once."""
        if n_modes not in self.solved:
            self.solved[n_modes] = self.body.motion(self.sensors, self.forces, n_modes)
        return self.solved[n_modes]

    def modal_damping(self, n_modes: int) -> FloatArray:
        """Damping (n_modes,): that of the mode of the specimen as it was drawn that is most like each."""
        now, then = self.motion(n_modes), _solved(self.drawn, self.sensors, self.forces, len(self.damping))
        mac = (now.at_sensors @ then.at_sensors.T) ** 2
        mac /= np.outer((now.at_sensors**2).sum(1), (then.at_sensors**2).sum(1))
        far = np.abs(np.log(now.frequency[:, None] / then.frequency))
        _, partner = linear_sum_assignment(1 - mac + 2 * far)
        return np.asarray(self.damping[partner])

    def claimed_frequency(self, n_modes: int) -> FloatArray:
        """Return the result of a perfect analysis [Hz], the clock's error included."""
        return self.motion(n_modes).frequency / self.clock

    def claimed_shape(self, n_modes: int) -> FloatArray:
        """Shapes (n_modes, n_channels) as measured by the channels, real, without delays, not normalised."""
        found = (self.motion(n_modes).at_sensors * self.gain)[:, self.order]
        found[:, [self.channels.index(c) for c in self.dead]] = 0.0
        return np.asarray(found)

    def of_body(self, body: Body, **changes: object) -> "State":
        """Return the state with another body."""
        return replace(self, body=body, solved={}, **changes)  # type: ignore[arg-type]

    @property
    def frame(self) -> Frame:
        """The frame, of a body that is one."""
        assert isinstance(self.body, FrameBody)
        return self.body.frame

    def of_frame(self, frame: Frame) -> "State":
        """Return the state with another frame."""
        assert isinstance(self.body, FrameBody)
        return self.of_body(replace(self.body, frame=frame))


@lru_cache(maxsize=4)
def _solved(body: Body, sensors: tuple[Sensor, ...], forces: tuple[Sensor, ...], n_modes: int) -> Motion:
    return body.motion(sensors, forces, n_modes)


_PLACES = (
    *(("column", z, f"col_{round(100 * z):03d}", "xy") for z in (0.37, 0.74, 1.11)),
    ("crossbeam", _HALF, "beam_mid", "xy"),
    ("crossbeam", 0.0, "beam_left", "yz"),
    ("crossbeam", 2 * _HALF, "beam_right", "yz"),
)


def draw_state(seed: int, *, n_modes: int = 30) -> State:
    """Draw a T-frame: E, density, sections, weld, foot, joint, cables, sensors' masses, places, gains and damping."""
    random = np.random.default_rng((seed, 1))
    body = FrameBody(_frame(random))
    return State(
        body=body,
        drawn=body,
        sensors=_sensors(random),
        forces=_forces(random),
        damping=random.uniform(0.002, 0.006, n_modes),
        gain=1 + 0.005 * random.standard_normal(12),
        delay=np.repeat(2e-5 * random.standard_normal(6), 2),
        order=np.arange(12),
    )


def _frame(random: Random) -> Frame:
    e, rho = 1 + 0.01 * random.standard_normal(), 1 + 0.007 * random.standard_normal()
    weld = random.uniform(0.0, 1.0)  # how much of it there is
    bars = []
    for name, start, axis, length, breaks in (
        ("column", (0.0, 0.0, 0.0), 2, _SPAN, ()),
        ("crossbeam", (-_HALF, 0.0, _SPAN), 0, 2 * _HALF, (_HALF,)),
    ):
        wall = 1 + 0.005 * random.standard_normal()  # thickness of the tube's wall
        bars.append(
            Bar(
                name=name,
                start=start,
                axis=axis,
                length=length,
                size=0.03,
                modulus=210e9 * e,
                shear_modulus=80.8e9 * e,
                density=7850.0 * rho,
                area=4.1934e-4 * wall,
                second_moment=(9.3e-8 * wall, 9.3e-8 * wall),
                torsion_constant=1.58e-7 * wall,
                shear_factor=0.44,
                breaks=breaks,
                zones=_weld(name, weld),
            )
        )
    unit = 210e9 * 9.3e-8 / _SPAN
    foot, joint = (vector(unit / random.uniform(0.001, 0.01, 3)) for _ in range(2))
    return Frame(
        bars=tuple(bars),
        grounds=(Ground(bar="column", s=0.0, about=foot),),
        meetings=(Meeting(bar="column", s=_SPAN, other="crossbeam", t=_HALF, about=joint),),
        lumps=_carried(random),
    )


def _weld(name: str, much: float) -> tuple[Zone, ...]:
    """The weld thickens the section towards the joint, and the cable runs down the column."""
    steps = [(0.030, 0.1), (0.020, 0.2), (0.010, 0.4)]
    if name == "column":
        cable = (Zone(start=0.0, end=1.11, mass=0.015),)
        return cable + tuple(
            Zone(start=_SPAN - d, end=_SPAN, bend1=1 + much * k, bend2=1 + much * k, mass=0.3 * much) for d, k in steps
        )
    return tuple(
        Zone(start=_HALF - d, end=_HALF + d, bend1=1 + much * k, bend2=1 + much * k, twist=1 + much * k)
        for d, k in steps
    )


def _carried(random: Random) -> tuple[Lump, ...]:
    """The accelerometers themselves."""
    return tuple(
        Lump(bar=bar, s=s, mass=random.uniform(0.008, 0.015), offset=vector(0.01 * random.standard_normal(3)))
        for bar, s, _, _ in _PLACES
    )


def _sensors(random: Random) -> tuple[Sensor, ...]:
    """Every device is off its place by 2 mm and turned by one degree."""
    found = []
    for bar, s, device, axes in _PLACES:
        length = _SPAN if bar == "column" else 2 * _HALF
        found += mounted(random, device, axes, bar, s, length=length, off=2e-3)
    return tuple(found)


def mounted(random: Random, device: str, axes: str, bar: str, s: float, *, length: float, off: float) -> list[Sensor]:
    """Return a device's channels, off their place on a bar by a deviation [m], and turned by one degree."""
    place = float(np.clip(s + off * random.standard_normal(), 0.0, length))
    turn = np.radians(1.0) * random.standard_normal(3)
    found = []
    for axis in axes:
        unit = np.eye(3)["xyz".index(axis)]
        direction = unit + np.cross(turn, unit)
        unit = direction / np.linalg.norm(direction)
        found.append(Sensor(channel=f"{device}_{axis}", device=device, bar=bar, s=place, direction=vector(unit)))
    return found


def _forces(random: Random) -> tuple[Sensor, ...]:
    """Positions and directions of the wind, across each bar."""
    found = []
    for bar, length, axes in (("column", _SPAN, (0, 1)), ("crossbeam", 2 * _HALF, (1, 2))):
        for s in random.uniform(0.1, 1.0, 4) * length:
            found += [Sensor(channel="", device="", bar=bar, s=s, direction=vector(np.eye(3)[a])) for a in axes]
    return tuple(found)

"""Random changes of a specimen; only the scorer gets the truth."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from tests.examiner.models.bar import Bar, Vector, Zone, vector
from tests.examiner.models.frame import Floor, Lump, Prop
from tests.examiner.models.specimen import Random, Scale, State

_CLEAR = 0.06  # m: from a stretch's end to a ground, a meeting or a free end
_EULER = np.pi**2 * 210e9 * 9.3e-8 / (4 * 1.48**2)  # N, of the T-frame's column


@dataclass(frozen=True, kw_only=True)
class Hidden:
    """One thing that was done."""

    cause: str
    position: Vector | None = None  #: [m]
    channels: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)  #: as a diagnosis names them
    reach: float = 0.0  #: half the length over which it acts [m]


@dataclass(frozen=True, eq=False)
class Done:
    """A specimen before and after."""

    before: State
    after: State
    hidden: tuple[Hidden, ...]
    wandering: tuple[State, ...] = ()  #: what it goes through while the log runs, if it does not stay the same

    def during(self, window: int) -> State:
        """State in a window of the log."""
        return self.wandering[window % len(self.wandering)] if self.wandering else self.after


Do = Callable[[State, Random], Done]


def log_uniform(random: Random, low: float, high: float) -> float:
    """Draw a size of which only the order is known."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def sign(random: Random) -> float:
    """Draw plus or minus one."""
    return float(random.choice([-1.0, 1.0]))


def somewhere(state: State, random: Random, *, lowest: float = 0.15) -> tuple[str, float]:
    """Draw a place, by length; not where nothing moves: `lowest` [m of the T-frame] from the grounds."""
    frame, far = state.frame, lowest * state.scale.length
    while True:
        s = random.uniform(far, sum(bar.length for bar in frame.bars))
        for bar in frame.bars:
            if s < bar.length or bar is frame.bars[-1]:
                break
            s -= bar.length
        if all(abs(s - held) >= far for held in frame.held(bar.name)):
            return bar.name, float(s)


def with_lump(state: State, lump: Lump) -> State:
    """Fix a body to the frame."""
    return state.of_frame(replace(state.frame, lumps=(*state.frame.lumps, lump)))


def nothing(state: State, random: Random) -> Done:
    """Leave it."""
    del random
    return Done(state, state, ())


def added_mass(state: State, random: Random) -> Done:
    """Add a body of 50 to 500 g next to a bar; one time in four it was there before and is removed.

    Here and below: of the T-frame, and as much of another specimen (`State.scale`).
    """
    bar, s = somewhere(state, random, lowest=0.3)
    mass = state.scale.mass * log_uniform(random, 0.05, 0.5)
    axis = state.frame.bar(bar).axis
    offset = state.scale.length * np.where(np.arange(3) == axis, 0.0, random.uniform(-0.025, 0.025, 3))
    inertia = mass * (state.scale.length * random.uniform(0.005, 0.02, 3)) ** 2
    lump = Lump(bar=bar, s=s, mass=mass, offset=vector(offset), inertia=vector(inertia))
    place = state.frame.bar(bar).point(s)
    if random.random() < 0.25:
        return Done(with_lump(state, lump), state, (_at("added_mass", place, mass=-mass),))
    return Done(state, with_lump(state, lump), (_at("added_mass", place, mass=mass),))


def distributed_mass(state: State, random: Random) -> Done:
    """Lay 0.2 to 1 kg along 0.25 to 0.7 m of a bar."""
    bar = state.frame.bars[int(random.integers(len(state.frame.bars)))]
    extent, mass = random.uniform(0.25, 0.7) * state.scale.length, log_uniform(random, 0.2, 1.0) * state.scale.mass
    extent = min(extent, 0.8 * bar.length)
    held, clear = state.frame.held(bar.name), 0.2 * state.scale.length
    lowest, highest = clear * (0.0 in held), bar.length - extent - clear * (bar.length in held)
    start = random.uniform(min(lowest, bar.length - extent), max(lowest, highest))
    zone = Zone(start=start, end=start + extent, mass=mass / extent)
    frame = state.frame.with_bar(bar.name, zones=(*bar.zones, zone))
    hidden = _at("distributed_mass", bar.point(start + extent / 2), reach=extent / 2, mass=mass, extent=extent)
    return Done(state, state.of_frame(frame), (hidden,))


def local_stiffness(state: State, random: Random) -> Done:
    """Take 20 to 70 % of the stiffness of 3 to 30 cm of a bar, off grounds, meetings and free ends."""
    bar = _one_bar(state, random)
    extent, left = log_uniform(random, 0.03, 0.3), 1 - random.uniform(0.2, 0.7)
    return _softer(state, random, bar, extent, (left, left, left))


def one_sided(state: State, random: Random) -> Done:
    """Take 30 to 80 % about one cross axis of 3 to 15 cm, to half as much about the other and in twist: a saw cut."""
    bar = _one_bar(state, random)
    extent, loss = log_uniform(random, 0.03, 0.15), random.uniform(0.3, 0.8)
    other, twist = (1 - loss * random.uniform(0.0, 0.5) for _ in range(2))
    bends = (1 - loss, other) if random.random() < 0.5 else (other, 1 - loss)
    return _softer(state, random, bar, extent, (*bends, twist))


def _one_bar(state: State, random: Random) -> Bar:
    along = np.cumsum([bar.length for bar in state.frame.bars])
    return state.frame.bars[int(np.searchsorted(along, random.random() * along[-1]))]


def _softer(state: State, random: Random, bar: Bar, extent: float, left: Vector) -> Done:
    """Leave shares of a stretch's stiffness, about its two cross axes and in twist."""
    frame, clear = state.frame, _CLEAR * state.scale.length
    extent *= state.scale.length
    stops = frame.stops(bar.name)
    extent = min(extent, 0.95 * (max(b - a for a, b in pairwise(stops)) - 2 * clear))  # there must be a place for it
    middle = 0.0
    while any(abs(middle - stop) <= extent / 2 + clear for stop in stops):
        middle = random.uniform(0, bar.length)
    bend1, bend2, twist = left
    zone = Zone(start=middle - extent / 2, end=middle + extent / 2, bend1=bend1, bend2=bend2, twist=twist)
    frame = frame.with_bar(bar.name, zones=(*bar.zones, zone))
    hidden = _at("local_stiffness", bar.point(middle), reach=extent / 2, loss=1 - min(left), extent=extent)
    return Done(state, state.of_frame(frame), (hidden,))


def support_stiffness(state: State, random: Random) -> Done:
    """Leave 10 to 60 % of a support's springs about and along each axis."""
    grounds = state.frame.grounds
    i = _one_of([_sprung((*g.along, *g.about)) for g in grounds], random)
    left = random.uniform(0.1, 0.6, 3)
    after = replace(
        grounds[i], along=vector(np.multiply(grounds[i].along, left)), about=vector(np.multiply(grounds[i].about, left))
    )
    springs = zip(("x", "y", "z", "rx", "ry", "rz"), (*after.along, *after.about), strict=True)
    stiffness = {f"stiffness_{axis}": k for axis, k in springs if 0 < k < np.inf}
    frame = replace(state.frame, grounds=(*grounds[:i], after, *grounds[i + 1 :]))
    place = frame.bar(after.bar).point(after.s)
    return Done(state, state.of_frame(frame), (_at("support_stiffness", place, **stiffness),))


def joint_stiffness(state: State, random: Random) -> Done:
    """Leave 10 to 60 % of a joint's stiffness about each axis."""
    meetings = state.frame.meetings
    i = _one_of([_sprung(m.about) for m in meetings], random)
    left = random.uniform(0.1, 0.6, 3)
    after = replace(meetings[i], about=vector(np.multiply(meetings[i].about, left)))
    stiffness = {f"stiffness_{a}": k for a, k in zip(("rx", "ry", "rz"), after.about, strict=True)}
    frame = replace(state.frame, meetings=(*meetings[:i], after, *meetings[i + 1 :]))
    place = frame.bar(after.bar).point(after.s)
    return Done(state, state.of_frame(frame), (_at("joint_stiffness", place, **stiffness),))


def _sprung(stiffness: tuple[float, ...]) -> bool:
    return any(0 < k < np.inf for k in stiffness)


def _one_of(eligible: list[bool], random: Random) -> int:
    chosen = np.flatnonzero(eligible)
    return int(chosen[0] if len(chosen) == 1 else random.choice(chosen))


def support_spring(state: State, random: Random) -> Done:
    """Lean something of 0.5 to 20 kN/m against a bar, across it."""
    bar, s = somewhere(state, random, lowest=0.4)
    axis = int(random.choice([a for a in range(3) if a != state.frame.bar(bar).axis]))
    unit = state.scale.stiffness / state.scale.length**2
    prop = Prop(bar=bar, s=s, axis=axis, stiffness=unit * log_uniform(random, 500.0, 2e4))
    frame = replace(state.frame, props=(*state.frame.props, prop))
    hidden = _at("support_spring", state.frame.bar(bar).point(s), **{f"stiffness_{'xyz'[axis]}": prop.stiffness})
    return Done(state, state.of_frame(frame), (hidden,))


def axial_force(state: State, random: Random) -> Done:
    """Press or pull the column by 5 to 40 % of its Euler load."""
    force = sign(random) * random.uniform(0.05, 0.4) * _EULER
    frame = state.frame.with_bar("column", preload=force)
    return Done(state, state.of_frame(frame), (_at("axial_force", (0.0, 0.0, 0.74), reach=0.74, force=force),))


def member_temperature(state: State, random: Random) -> Done:
    """Warm or cool one bar by 8 to 25 K: it is softer, and pushes where the others hold it."""
    bar = state.frame.bars[int(random.integers(len(state.frame.bars)))]
    warmer = sign(random) * random.uniform(8.0, 25.0)
    left = 1 - warmer * (3.5e-4 + 0.4e-4 * random.standard_normal())
    force = state.frame.heated(bar.name, 1.2e-5 * warmer)
    frame = state.frame.with_bar(bar.name, modulus=bar.modulus * left, shear_modulus=bar.shear_modulus * left)
    for other in frame.bars:
        frame = frame.with_bar(other.name, preload=other.preload + force[other.name])
    hidden = _at("member_temperature", bar.point(bar.length / 2), reach=bar.length / 2, warmer=warmer)
    return Done(state, state.of_frame(frame), (hidden,))


def attached_oscillator(state: State, random: Random) -> Done:
    """Attach 50 to 300 g on a spring, tuned away from the frame's modes but within the analysed band."""
    bar, s = somewhere(state, random, lowest=0.6)
    axis = int(random.choice([a for a in range(3) if a != state.frame.bar(bar).axis]))
    share = state.scale.band / Scale().band
    frequency = share * log_uniform(random, 14.0, 130.0)
    while np.abs(np.log(state.motion(24).frequency / frequency)).min() < 0.05:
        frequency = share * log_uniform(random, 14.0, 130.0)
    mass = state.scale.mass * log_uniform(random, 0.05, 0.3)
    after = with_lump(state, Lump(bar=bar, s=s, mass=mass, axis=axis, spring=frequency))
    place = state.frame.bar(bar).point(s)
    return Done(state, after, (_at("attached_oscillator", place, mass=mass, frequency=frequency),))


def ground_mode(state: State, random: Random) -> Done:
    """Let a foot, or all feet together, stand on a floor with a mode of its own within the analysed band.

    Its mass, or inertia, is 0.3 to 10 times about that of the frame moved with the floor. All modes have one damping: a
    mode that a floor changes much would take that of another one (`State.modal_damping`).
    """
    state = replace(state, damping=np.full(len(state.damping), state.damping[0]))
    frame, scale, share = state.frame, state.scale, state.scale.band / Scale().band
    together = len(frame.grounds) > 1 and random.random() < 0.4
    grounds = tuple(range(len(frame.grounds))) if together else (int(random.integers(len(frame.grounds))),)
    held = np.all([np.greater((*frame.grounds[g].along, *frame.grounds[g].about), 0) for g in grounds], axis=0)
    axis = int(random.choice(np.flatnonzero(held[:5])))
    frequency = share * log_uniform(random, 10.0, 130.0)
    while np.abs(np.log(state.motion(24).frequency / frequency)).min() < 0.05:
        frequency = share * log_uniform(random, 10.0, 130.0)
    weight = sum(bar.density * bar.area * bar.length for bar in frame.bars)
    moved = weight if axis < 3 else weight * (0.8 * scale.length) ** 2
    mass = moved * log_uniform(random, 0.3, 10.0)
    floor = Floor(grounds=grounds, axis=axis, mass=mass, frequency=frequency)
    after = state.of_frame(replace(frame, floors=(*frame.floors, floor)))
    of_mass = ("mass_x", "mass_y", "mass_z", "inertia_rx", "inertia_ry")[axis]
    place = np.mean([frame.bar(frame.grounds[g].bar).point(frame.grounds[g].s) for g in grounds], axis=0)
    return Done(state, after, (_at("ground_mode", vector(place), **{of_mass: mass}, frequency=frequency),))


def global_stiffness(state: State, random: Random) -> Done:
    """Change all moduli, and with them the foot's and joint's springs, by 2 to 6 %."""
    loss = sign(random) * random.uniform(0.02, 0.06)
    frame = state.frame
    for bar in frame.bars:
        frame = frame.with_bar(bar.name, modulus=bar.modulus * (1 - loss), shear_modulus=bar.shear_modulus * (1 - loss))
    return Done(state, state.of_frame(frame), (Hidden(cause="global_stiffness", parameters={"loss": loss}),))


def global_density(state: State, random: Random) -> Done:
    """Change the density by 2 to 6 %: paint, or mass that was never weighed."""
    gain = sign(random) * random.uniform(0.02, 0.06)
    frame = state.frame
    for bar in frame.bars:
        frame = frame.with_bar(bar.name, density=bar.density * (1 + gain))
    return Done(state, state.of_frame(frame), (Hidden(cause="global_density"),))


def temperature(state: State, random: Random) -> Done:
    """Warm or cool everything by 10 to 30 K; devices measure it."""
    now = state.temperature + sign(random) * random.uniform(10.0, 30.0)
    body = replace(state.body, temperature=now)  # type: ignore[type-var]
    return Done(state, state.of_body(body, temperature=now), (Hidden(cause="temperature"),))


def sampling_clock(state: State, random: Random) -> Done:
    """Let the recorder sample 1 to 3 % faster or slower than stated."""
    error = sign(random) * random.uniform(0.01, 0.03)
    return Done(state, replace(state, clock=1 + error), (Hidden(cause="sampling_clock"),))


def damping_change(state: State, random: Random) -> Done:
    """Multiply all damping by 1.6 to 3."""
    factor = random.uniform(1.6, 3.0)
    return Done(state, replace(state, damping=state.damping * factor), (Hidden(cause="damping_change"),))


def amplitude_softening(state: State, random: Random) -> Done:
    """Let foot and joint slip: their flexibility grows with the amplitude, which was one and is now one to three."""
    slip = random.uniform(0.3, 1.0, 2)
    tight = state.frame

    def at(level: float) -> State:
        grounds = tuple(replace(g, about=_looser(g.about, slip[0] * level)) for g in tight.grounds)
        meetings = tuple(replace(m, about=_looser(m.about, slip[1] * level)) for m in tight.meetings)
        damping = state.damping * (1 + 0.2 * slip.mean() * (level - 1))
        loose = state.of_frame(replace(tight, grounds=grounds, meetings=meetings))
        return replace(loose, damping=damping, loudness=level)

    levels = [at(float(level)) for level in random.permutation(np.linspace(1.0, 3.0, 5))]
    return Done(at(1.0), at(2.0), (Hidden(cause="amplitude_softening"),), tuple(levels))


def _looser(about: Vector, slip: float) -> Vector:
    return vector(np.divide(about, 1 + slip))


def _at(cause: str, position: Vector, *, reach: float = 0.0, **parameters: float) -> Hidden:
    return Hidden(cause=cause, position=position, reach=reach, parameters=parameters)

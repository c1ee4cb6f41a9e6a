"""Random changes outside the catalogue: a diagnosis must not name a cause."""

from dataclasses import replace

import numpy as np

from tests.examiner.draws import Do, Done, somewhere, with_lump
from tests.examiner.models.bar import Zone
from tests.examiner.models.frame import Brace, Lump
from tests.examiner.models.specimen import Random, State
from tests.examiner.sensor_chain import reseated


def five_masses(state: State, random: Random) -> Done:
    """Add 80 to 250 g at each of five positions."""
    after = state
    for _ in range(5):
        bar, s = somewhere(state, random, lowest=0.3)
        after = with_lump(after, Lump(bar=bar, s=s, mass=state.scale.mass * random.uniform(0.08, 0.25)))
    return Done(state, after, ())


def braced(state: State, random: Random) -> Done:
    """Fit a strut between column and crossbeam."""
    ends = ("column", random.uniform(0.6, 1.2)), ("crossbeam", float(random.choice([0.1, 0.7])))
    strut = Brace(ends=ends, stiffness=random.uniform(2e4, 2e5))
    return Done(state, state.of_frame(replace(state.frame, braces=(strut,))), ())


def corroded(state: State, random: Random) -> Done:
    """Thin every bar along all its length, in one plane more than in the other, and with it the mass."""
    frame = state.frame
    for bar in frame.bars:
        one, other = random.uniform(0.55, 0.95, 2)
        lost = -bar.density * bar.area * random.uniform(0.05, 0.15)
        zone = Zone(start=0.0, end=bar.length, bend1=one, bend2=other, twist=(one + other) / 2, mass=lost)
        frame = frame.with_bar(bar.name, zones=(*bar.zones, zone))
    return Done(state, state.of_frame(frame), ())


def riddled(state: State, random: Random) -> Done:
    """Change the stiffness of every tenth of every bar by itself."""
    frame = state.frame
    for bar in frame.bars:
        stops = np.linspace(0.0, bar.length, 11)
        left = random.uniform(0.6, 1.2, (10, 2))
        zones = tuple(
            Zone(start=a, end=b, bend1=one, bend2=other, twist=(one + other) / 2)
            for a, b, (one, other) in zip(stops[:-1], stops[1:], left, strict=True)
        )
        frame = frame.with_bar(bar.name, zones=(*bar.zones, *zones))
    return Done(state, state.of_frame(frame), ())


def sliding(state: State, random: Random) -> Done:
    """Let 200 to 400 g slide along half the crossbeam while the log runs."""
    mass, start = random.uniform(0.2, 0.4), random.uniform(0.0, 0.4)
    places = start + np.linspace(0.0, 0.4, 5)
    states = tuple(with_lump(state, Lump(bar="crossbeam", s=float(s), mass=mass)) for s in places)
    return Done(state, states[2], (), states)


OUTSIDE: dict[str, Do] = {
    "reseated": reseated,
    "five_masses": five_masses,
    "braced": braced,
    "corroded": corroded,
    "riddled": riddled,
    "sliding": sliding,
}

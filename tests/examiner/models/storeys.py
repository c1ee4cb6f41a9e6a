"""A two-storey aluminium frame on flexible feet with flexible joints, whose file has clamped feet and rigid joints."""

from dataclasses import replace

import numpy as np

from tests.examiner.design import Design, Section
from tests.examiner.models.bar import Bar, Vector, vector
from tests.examiner.models.frame import Ground, Meeting
from tests.examiner.models.specimen import State

FOOT, LOOSE_FOOT = 60e3, 15e3  #: rotational stiffness before and after the event [N m/rad]
_JOINT = 60e3  # N m/rad, of which each is drawn from half to twice
_SIDE, _WALL = 0.07, 0.004
_RIGID: Vector = (np.inf, np.inf, np.inf)


def _tube() -> Section:
    """Return the constants of a square tube."""
    inner, middle = _SIDE - 2 * _WALL, _SIDE - _WALL
    second = (_SIDE**4 - inner**4) / 12
    return Section(
        area=_SIDE**2 - inner**2, second_moment=(second, second), torsion_constant=middle**3 * _WALL, shear_factor=0.44
    )


def _bar(name: str, start: Vector, axis: int, length: float) -> Bar:
    section = _tube()
    return Bar(
        name=name,
        start=start,
        axis=axis,
        length=length,
        size=0.15,
        modulus=70e9,
        shear_modulus=26.3e9,
        density=2700.0,
        area=section.area,
        second_moment=section.second_moment,
        torsion_constant=section.torsion_constant,
        shear_factor=section.shear_factor,
    )


_BARS = (
    _bar("left", (0.0, 0.0, 0.0), 2, 6.0),
    _bar("right", (4.0, 0.0, 0.0), 2, 6.0),
    _bar("floor", (0.0, 0.0, 3.0), 0, 4.0),
    _bar("roof", (0.0, 0.0, 6.0), 0, 4.0),
)
_MEETINGS = tuple(
    Meeting(bar=post, s=z, other=beam, t=t, about=_RIGID)
    for beam, z in (("floor", 3.0), ("roof", 6.0))
    for post, t in (("left", 0.0), ("right", 4.0))
)
_FILED = Design(
    name="two storeys",
    bars=_BARS,
    grounds=tuple(Ground(bar=post, s=0.0, about=_RIGID) for post in ("left", "right")),
    meetings=_MEETINGS,
    devices=(
        *((post, z, f"{post}_{round(10 * z):02d}", "xy") for post in ("left", "right") for z in (1.5, 3.0, 4.5, 6.0)),
        *((beam, 2.0, f"{beam}_mid", "yz") for beam in ("floor", "roof")),
    ),
    band=60.0,
    window=300.0,
    element=0.25,
)


def toml() -> str:
    """Return the structure file: clamped feet, rigid joints."""
    return _FILED.toml().replace(
        "youngs_modulus = 210e9\npoisson_ratio = 0.3\ndensity = 7850",
        "youngs_modulus = 70e9\npoisson_ratio = 0.33\ndensity = 2700",
    )


def as_it_stands(seed: int) -> State:
    """Draw a frame whose feet have 60 kN m/rad and whose joints have 30 to 120 kN m/rad."""
    design = replace(_FILED, meetings=tuple(replace(m, about=(_JOINT,) * 3) for m in _MEETINGS))
    return _with_feet(design.draw(seed), (FOOT, FOOT))


def _with_feet(state: State, stiffness: tuple[float, float]) -> State:
    grounds = tuple(replace(g, about=vector([k] * 3)) for g, k in zip(state.frame.grounds, stiffness, strict=True))
    return state.of_frame(replace(state.frame, grounds=grounds))


def with_loose_foot(state: State) -> State:
    """Return the frame with the left foot loosened to 15 kN m/rad."""
    return _with_feet(state, (LOOSE_FOOT, FOOT))


def with_channels(state: State, axis: str) -> State:
    """Return the frame with the sensors along one axis only."""
    kept = [i for i, sensor in enumerate(state.sensors) if sensor.channel.endswith(f"_{axis}")]
    return replace(
        state,
        sensors=tuple(state.sensors[i] for i in kept),
        gain=state.gain[kept],
        delay=state.delay[kept],
        order=np.arange(len(kept)),
        solved={},
    )

"""Errors of a structure file about a frame that otherwise agrees with it: nothing was measured before."""

from dataclasses import dataclass, replace

import numpy as np

from tests.examiner import sensor_chain as chain
from tests.examiner.draws import Do, added_mass, nothing
from tests.examiner.models.specimen import FrameBody, State, draw_state

_RIGID = (1e8, 1e8, 1e8)
UNITS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Coarse:
    """Elements that the file gives column and crossbeam; None: as it is shipped."""

    column: int
    crossbeam: int


def draw_as_filed(seed: int) -> State:
    """Draw a frame with rigid foot and joint, no weld, no load, no sensor askew; E and density are off by 0.1 %."""
    random, state = np.random.default_rng((seed, 12)), draw_state(seed)
    (foot,), (joint,) = state.frame.grounds, state.frame.meetings
    grounds, meetings = (replace(foot, about=_RIGID),), (replace(joint, about=_RIGID),)
    frame = replace(state.frame, grounds=grounds, meetings=meetings, lumps=())
    for bar in frame.bars:
        e, rho = 1 + 1e-3 * random.standard_normal(2)
        frame = frame.with_bar(
            bar.name,
            modulus=210e9 * e,
            shear_modulus=80.8e9 * e,
            density=7850.0 * rho,
            area=4.1934e-4,
            second_moment=(9.3e-8, 9.3e-8),
            torsion_constant=1.58e-7,
            zones=(),
        )
    body = FrameBody(frame)
    sensors = tuple(replace(s, direction=UNITS[s.channel[-1]]) for s in state.sensors)
    return replace(state, body=body, drawn=body, sensors=sensors, solved={})


def draw_mesh(seed: int) -> Coarse:
    """Draw a mesh that puts the upper modes 0.5 to 2 % too high."""
    random = np.random.default_rng((seed, 13))
    return Coarse(int(random.integers(3, 6)), 2)


FILE: dict[str, Do] = {
    "nothing": nothing,
    "mesh_error": nothing,
    "added_mass": added_mass,
    "sensor_polarity": chain.sensor_polarity,
    "sensor_swap": chain.sensor_swap,
    "sensor_position": chain.sensor_position,
}

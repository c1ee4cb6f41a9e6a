"""Random changes of the solid bar."""

from dataclasses import replace

import numpy as np

from tests.examiner import sensor_chain as chain
from tests.examiner.draws import Do, Done, Hidden, log_uniform, nothing, sign
from tests.examiner.models.solid import HEIGHTS, LENGTH, SolidBar
from tests.examiner.models.specimen import Random, Sensor, State

_UNITS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def draw_bar(seed: int, *, n_modes: int = 30) -> State:
    """Draw a bar: modulus and density off by a per cent, a bedding that gives, sensors off by a millimetre."""
    random = np.random.default_rng((seed, 11))
    sensors = []
    for z in HEIGHTS:
        off = float(np.clip(z + 1e-3 * random.standard_normal(), 0.0, LENGTH))
        for axis, unit in _UNITS.items():
            turned = np.array(unit) + np.radians(1.0) * random.standard_normal(3)
            a, b, c = (float(v) for v in turned / np.linalg.norm(turned))
            name = f"z{round(1000 * z):04d}"
            sensors.append(Sensor(channel=f"{name}_{axis}", device=name, bar="bar", s=off, direction=(a, b, c)))
    forces = [
        Sensor(channel="", device="", bar="bar", s=float(z), direction=unit)
        for z in random.uniform(0.3, LENGTH, 3)
        for unit in _UNITS.values()
    ]
    modulus = 210e9 * (1 + 0.01 * random.standard_normal())
    body = SolidBar(
        modulus=modulus,
        density=7850.0 * (1 + 0.007 * random.standard_normal()),
        bedding=modulus / (LENGTH * random.uniform(0.002, 0.01)),
    )
    return State(
        body=body,
        drawn=body,
        sensors=tuple(sensors),
        forces=tuple(forces),
        damping=random.uniform(0.002, 0.006, n_modes),
        gain=1 + 0.005 * random.standard_normal(len(sensors)),
        delay=np.repeat(2e-5 * random.standard_normal(len(HEIGHTS)), 2),
        order=np.arange(len(sensors)),
    )


def _bar(state: State) -> SolidBar:
    assert isinstance(state.body, SolidBar)
    return state.body


def added_mass(state: State, random: Random) -> Done:
    """Stick 50 to 300 g to one face, over 4 cm."""
    z, mass = random.uniform(0.3, LENGTH - 0.03), log_uniform(random, 0.05, 0.3)
    body = replace(_bar(state), patches=((z, 0.04, mass),))
    hidden = Hidden(cause="added_mass", position=(0.0, 0.0, z), parameters={"mass": mass})
    return Done(state, state.of_body(body), (hidden,))


def local_stiffness(state: State, random: Random) -> Done:
    """Anneal 3 to 15 cm to 30 to 70 % of the modulus."""
    extent, loss = log_uniform(random, 0.03, 0.15), random.uniform(0.3, 0.7)
    z = random.uniform(0.08 + extent / 2, 0.75 * LENGTH)
    body = replace(_bar(state), soft=((z - extent / 2, z + extent / 2, 1 - loss),))
    at: tuple[float, float, float] = (0.0, 0.0, z)
    parameters = {"loss": loss, "extent": extent}
    return Done(
        state,
        state.of_body(body),
        (Hidden(cause="local_stiffness", position=at, reach=extent / 2, parameters=parameters),),
    )


def support_stiffness(state: State, random: Random) -> Done:
    """Leave 10 to 40 % of the bedding."""
    body = replace(_bar(state), bedding=_bar(state).bedding * random.uniform(0.1, 0.4))
    return Done(state, state.of_body(body), (Hidden(cause="support_stiffness", position=(0.0, 0.0, 0.0)),))


def global_stiffness(state: State, random: Random) -> Done:
    """Change the modulus, and the bedding with it, by 2 to 6 %."""
    loss = sign(random) * random.uniform(0.02, 0.06)
    bar = _bar(state)
    body = replace(bar, modulus=bar.modulus * (1 - loss), bedding=bar.bedding * (1 - loss))
    return Done(state, state.of_body(body), (Hidden(cause="global_stiffness", parameters={"loss": loss}),))


SOLID: dict[str, Do] = {
    "added_mass": added_mass,
    "local_stiffness": local_stiffness,
    "support_stiffness": support_stiffness,
    "global_stiffness": global_stiffness,
    "sensor_gain": chain.sensor_gain,
    "sensor_polarity": chain.sensor_polarity,
    "sensor_swap": chain.sensor_swap,
    "sensor_delay": chain.sensor_delay,
    "nothing": nothing,
}

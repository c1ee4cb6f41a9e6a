"""Random changes of the measuring chain of a specimen."""

from dataclasses import replace

import numpy as np

from tests.examiner.draws import Done, Hidden, log_uniform, sign
from tests.examiner.models.specimen import Random, State


def _channel(state: State, random: Random) -> tuple[int, str]:
    index = int(random.integers(len(state.channels)))
    return index, state.channels[index]


def sensor_gain(state: State, random: Random) -> Done:
    """Scale one channel by 7 to 30 %, up or down."""
    index, name = _channel(state, random)
    factor = log_uniform(random, 1.07, 1.3) ** sign(random)
    gain = np.where(np.arange(len(state.gain)) == index, state.gain * factor, state.gain)
    hidden = Hidden(cause="sensor_gain", channels=(name,), parameters={"gain": factor})
    return Done(state, replace(state, gain=gain), (hidden,))


def sensor_polarity(state: State, random: Random) -> Done:
    """Turn one channel round."""
    index, name = _channel(state, random)
    gain = np.where(np.arange(len(state.gain)) == index, -state.gain, state.gain)
    return Done(state, replace(state, gain=gain), (Hidden(cause="sensor_polarity", channels=(name,)),))


def sensor_swap(state: State, random: Random) -> Done:
    """Exchange two channels' cables."""
    a, b = (int(i) for i in random.choice(len(state.channels), 2, replace=False))
    order = state.order.copy()
    order[[a, b]] = order[[b, a]]
    hidden = Hidden(cause="sensor_swap", channels=(state.channels[a], state.channels[b]))
    return Done(state, replace(state, order=order), (hidden,))


def sensor_orientation(state: State, random: Random) -> Done:
    """Tilt one channel by 6 to 25 degrees towards another axis."""
    index, name = _channel(state, random)
    sensor = state.sensors[index]
    angle = np.radians(random.uniform(6.0, 25.0))
    own = np.array(sensor.direction)
    across = np.cross(own, np.eye(3)[int(random.choice([a for a in range(3) if "xyz"[a] != name[-1]]))])
    across /= np.linalg.norm(across)
    x, y, z = (float(v) for v in np.cos(angle) * own + np.sin(angle) * across)
    sensors = tuple(replace(s, direction=(x, y, z)) if s is sensor else s for s in state.sensors)
    hidden = Hidden(cause="sensor_orientation", channels=(name,), parameters={"angle": float(angle)})
    return Done(state, replace(state, sensors=sensors, solved={}), (hidden,))


def sensor_delay(state: State, random: Random) -> Done:
    """Delay a device, with all its channels, by 0.2 to 2 ms."""
    _, name = _channel(state, random)
    device = next(s.device for s in state.sensors if s.channel == name)
    delay = log_uniform(random, 2e-4, 2e-3)
    of_it = np.array([s.device == device for s in state.sensors])
    channels = tuple(s.channel for s in state.sensors if s.device == device)
    hidden = Hidden(cause="sensor_delay", channels=channels, parameters={"delay": delay})
    return Done(state, replace(state, delay=np.where(of_it, state.delay + delay, state.delay)), (hidden,))


def sensor_dead(state: State, random: Random) -> Done:
    """Let a device measure only its own noise."""
    _, name = _channel(state, random)
    device = next(s.device for s in state.sensors if s.channel == name)
    dead = tuple(s.channel for s in state.sensors if s.device == device)
    return Done(state, replace(state, dead=dead), (Hidden(cause="sensor_dead", channels=dead),))


def reseated(state: State, random: Random) -> Done:
    """Take every accelerometer off and put it back, each a little elsewhere, turned and with another gain."""
    sensors = []
    for sensor in state.sensors:
        direction = np.array(sensor.direction) + np.radians(6.0) * random.standard_normal(3)
        x, y, z = (float(v) for v in direction / np.linalg.norm(direction))
        off = 0.012 * state.scale.length * random.standard_normal()
        s = float(np.clip(sensor.s + off, 0.0, state.frame.bar(sensor.bar).length))
        sensors.append(replace(sensor, s=s, direction=(x, y, z)))
    gain = state.gain * (1 + 0.04 * random.standard_normal(len(state.gain)))
    return Done(state, replace(state, sensors=tuple(sensors), gain=gain, solved={}), ())

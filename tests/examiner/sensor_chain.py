"""Random changes of the measuring chain of a specimen."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.examiner.draws import Done, Hidden, log_uniform, sign, with_lump
from tests.examiner.models.bar import vector
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import Random, State

_ITS_OWN = 0.01  # m of the T-frame: a body as near to a device is its own mass


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


def sensor_position(state: State, random: Random) -> Done:
    """Move a device, with its mass, by 2 to 20 cm of the T-frame along its bar."""
    while True:
        sensor = state.sensors[_channel(state, random)[0]]
        shift = sign(random) * log_uniform(random, 0.02, 0.2) * state.scale.length
        if 0 <= sensor.s + shift <= state.frame.bar(sensor.bar).length:
            return moved(state, sensor.device, shift)


def moved(state: State, device: str, shift: float) -> Done:
    """Move a device along its bar [m], with the body of the frame that is nearest to it: its own mass."""
    frame = state.frame
    sensor = next(s for s in state.sensors if s.device == device)
    bodies = [lump for lump in frame.lumps if lump.bar == sensor.bar and not lump.spring]
    own = min(bodies, key=lambda lump: abs(lump.s - sensor.s), default=None)
    if own is not None and abs(own.s - sensor.s) < _ITS_OWN * state.scale.length:
        lumps = tuple(replace(lump, s=lump.s + shift) if lump is own else lump for lump in frame.lumps)
        state_after = state.of_frame(replace(frame, lumps=lumps))
    else:
        state_after = state
    sensors = tuple(replace(s, s=s.s + shift) if s.device == device else s for s in state.sensors)
    hidden = Hidden(
        cause="sensor_position",
        position=frame.bar(sensor.bar).point(sensor.s + shift),
        channels=tuple(s.channel for s in state.sensors if s.device == device),
        parameters={"shift": shift},
    )
    return Done(state, replace(state_after, sensors=sensors, solved={}), (hidden,))


def exchanged_devices(state: State, random: Random) -> Done:
    """Exchange two devices with channels along the same axes."""
    devices = [tuple(i for i, s in enumerate(state.sensors) if s.device == d) for d in _devices(state)]
    pairs = [(a, b) for a, b in combinations(devices, 2) if len(a) > 1 and _axes(state, a) == _axes(state, b)]
    one, other = pairs[int(random.integers(len(pairs)))]
    order = state.order.copy()
    order[list(one)], order[list(other)] = order[list(other)], order[list(one)]
    hidden = Hidden(cause="sensor_swap", channels=tuple(state.channels[i] for i in (*one, *other)))
    return Done(state, replace(state, order=order), (hidden,))


def turned_device(state: State, random: Random) -> Done:
    """Turn a device with all its channels by 6 to 25 degrees about an axis that turns two of them."""
    devices = [d for d in _devices(state) if sum(s.device == d for s in state.sensors) > 1]
    device = devices[int(random.integers(len(devices)))]
    own = [s for s in state.sensors if s.device == device]
    axis = next(a for a in range(3) if "xyz"[a] not in {s.channel[-1] for s in own})
    angle = sign(random) * np.radians(random.uniform(6.0, 25.0))
    turn = Rotation.from_rotvec(angle * np.eye(3)[axis])
    sensors = tuple(
        replace(s, direction=vector(turn.apply(s.direction))) if s.device == device else s for s in state.sensors
    )
    names = tuple(s.channel for s in own)
    hidden = Hidden(cause="sensor_orientation", channels=names, parameters={"angle": float(abs(angle))})
    return Done(state, replace(state, sensors=sensors, solved={}), (hidden,))


def cable_mass(state: State, random: Random) -> Done:
    """Hang 30 to 150 g at a device: its cable, or a heavier housing."""
    sensor = state.sensors[_channel(state, random)[0]]
    mass = state.scale.mass * log_uniform(random, 0.03, 0.15)
    place = state.frame.bar(sensor.bar).point(sensor.s)
    hidden = Hidden(cause="added_mass", position=place, parameters={"mass": mass})
    return Done(state, with_lump(state, Lump(bar=sensor.bar, s=sensor.s, mass=mass)), (hidden,))


def _devices(state: State) -> list[str]:
    return list(dict.fromkeys(s.device for s in state.sensors))


def _axes(state: State, channels: tuple[int, ...]) -> list[str]:
    return [state.channels[i][-1] for i in channels]


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

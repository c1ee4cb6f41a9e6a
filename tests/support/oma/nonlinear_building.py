"""Ambient vibration of a building with a nonlinear element, integrated over time: truth of tests.

Four storeys that shear, with modal damping, under random forces on all floors. Forces of the element act between two
floors. The linear part is propagated exactly from step to step (Van Loan 1978), with the forces held; four steps are
a sample.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
import scipy.signal

from daq import Channel, FloatArray, Recording

RATE = 50.0  #: samples per second [Hz]
_STEPS = 4  # per sample
_AT_ONCE = 3000  # samples whose forces are drawn together
STOREYS = 4
_LOWEST = 2.0  # frequency of the linear building [Hz]
DAMPING = np.array([0.008, 0.006, 0.01, 0.012])
_RMS = 0.1  # of all channels [m/s2]

Modulation = Callable[[FloatArray, np.random.Generator], FloatArray]


@dataclass
class Element:
    """Element between the ground and the first floor: force over the drift x and its rate v, per building (n,).

    Sizes are relative to the standard deviation of the drift of the linear building, and to a storey's stiffness.
    """

    kind: str
    size: float
    limit: float = 1.0
    slid: FloatArray | float = field(default=0.0)

    def force(self, drift: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the force on the building against the drift (n,)."""
        match self.kind:
            case "linear":
                return np.zeros_like(drift)
            case "stiffening":
                return self.size * drift**3
            case "slip":  # a spring that slides at a force
                held = np.clip(drift - self.slid, -self.limit, self.limit)
                self.slid = drift - held
                return self.size * held
            case "contact":  # a spring that is touched at a drift
                return self.size * np.sign(drift) * np.maximum(np.abs(drift) - self.limit, 0.0)
            case "drag":
                return self.size * np.abs(rate) * rate
        raise ValueError(f"kind: {self.kind}")


def steady(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return forces of constant size."""
    return np.ones(len(time))


def gusts(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return forces whose logarithm is a random process of 10 s."""
    slow = scipy.signal.lfilter([1], [1, -np.exp(-(time[1] - time[0]) / 10)], rng.standard_normal(len(time)))
    return np.asarray(np.exp(0.8 * slow / slow.std()))


def traffic(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return forces of vehicles of different weight, one per 30 s, over a background."""
    passing = rng.uniform(0, time[-1], int(time[-1] / 30))
    return np.asarray(
        0.1 + (rng.exponential(3, len(passing)) * np.exp(-0.5 * ((time[:, None] - passing) / 2) ** 2)).sum(1)
    )


def blows(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return forces of short blows, one per 5 s."""
    found = np.zeros(len(time))
    found[rng.integers(0, len(time), int(time[-1] / 5))] = 30.0
    return found


class Building:
    """Building with one element, alone or as many independent copies."""

    def __init__(self, element: Element) -> None:
        stiffness = 2 * np.eye(STOREYS) - np.eye(STOREYS, k=1) - np.eye(STOREYS, k=-1)
        stiffness[-1, -1] = 1.0
        value, self.shape = np.linalg.eigh(stiffness)  #: (n_floors, n_modes)
        #: stiffness of a storey over the mass of a floor [1/s2]
        self.storey = (2 * np.pi * _LOWEST) ** 2 / float(value[0])
        omega = np.sqrt(self.storey * value)
        self.frequency = omega / (2 * np.pi)  #: (n_modes,) of the linear building [Hz]
        zero, one = np.zeros((STOREYS, STOREYS)), np.eye(STOREYS)
        damping = self.shape * (2 * DAMPING * omega) @ self.shape.T
        state = np.block(
            [[zero, one, zero], [-self.storey * stiffness, -damping, one], [np.zeros((STOREYS, 3 * STOREYS))]]
        )
        step = scipy.linalg.expm(state / (RATE * _STEPS))
        self._forward, self._pushed = step[: 2 * STOREYS, : 2 * STOREYS].T, step[: 2 * STOREYS, 2 * STOREYS :].T
        #: standard deviation of a force per step for which the drift of the first storey has one of 1
        self.force = float(np.sqrt(RATE * _STEPS / (self.shape[0] ** 2 / (4 * DAMPING * omega**3)).sum()))
        self._element = replace(element, slid=0.0)  # not where another building has left it

    def motion(self, state: FloatArray, forces: FloatArray) -> FloatArray:
        """Return the states (n_steps, n, 2 n_floors) after each step.

        Parameters
        ----------
        state : (n, 2 n_floors) before the first step
        forces : (n_steps, n, n_floors)
        """
        found, reaction = forces @ self._pushed, self.storey * self._pushed[0]
        for after in found:
            force = self._element.force(state[:, 0], state[:, STOREYS])
            after += state @ self._forward - force[:, None] * reaction
            state = after
        return found


def vibrations(
    element: Element,
    seconds: float,
    seeds: range,
    *,
    modulation: Modulation = steady,
    noise: float = 0.01,
    only: int | None = None,
) -> list[Recording]:
    """Return the accelerations of the floors of one building per seed [m/s2].

    Parameters
    ----------
    noise : standard deviation of every channel's noise, over that of the channel with the smallest signal [-]
    only : mode that the forces excite, from 0 on; all unless given
    """
    rngs = [np.random.default_rng(seed) for seed in seeds]
    building = Building(element)
    excited = np.eye(STOREYS) if only is None else np.outer(*[building.shape[:, only]] * 2)
    time = np.arange(int(seconds * RATE)) / RATE
    level = building.force * np.array([modulation(time, rng) for rng in rngs]).T
    state, found = np.zeros((len(rngs), 2 * STOREYS)), np.empty((len(time), len(rngs), STOREYS))
    for start in range(0, len(time), _AT_ONCE):
        part = level[start : start + _AT_ONCE]
        drawn = np.stack([rng.standard_normal((len(part), _STEPS, STOREYS)) for rng in rngs], axis=2)
        forces = part[:, None, :, None] * drawn @ excited
        states = building.motion(state, forces.reshape(-1, len(rngs), STOREYS))
        velocity = np.concatenate([state[None], states[_STEPS - 1 :: _STEPS]])[..., STOREYS:]
        state, found[start : start + _AT_ONCE] = states[-1], np.diff(velocity, axis=0) * RATE
    channels = tuple(Channel(name=f"floor_{k + 1}", device="logger", axis=k) for k in range(STOREYS))
    return [
        Recording(channels=channels, data=_noisy(found[:, k], noise, rng), rate=RATE, start=0)
        for k, rng in enumerate(rngs)
    ]


def _noisy(data: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    scaled = data * (_RMS / data.std())
    return np.asarray(scaled + noise * scaled.std(0).min() * rng.standard_normal(data.shape))


def free_decay(element: Element, mode: int, drift: float, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return amplitude [drift of the first storey], frequency [Hz] and damping [-] along a free decay of a mode.

    Parameters
    ----------
    mode : from 0 on
    drift : at the start
    """
    building = Building(element)
    shape = building.shape[:, mode] / building.shape[0, mode]
    state = np.concatenate([drift * shape, np.zeros(STOREYS)])[None]
    states = building.motion(state, np.zeros((int(seconds * RATE) * _STEPS, 1, STOREYS)))
    every = np.concatenate([state[None], states[_STEPS - 1 : -1 : _STEPS]])[:, 0, :STOREYS]  # at each sample
    motion = every @ shape / (shape @ shape)
    analytic = scipy.signal.hilbert(motion)
    width = int(3 * RATE / building.frequency[mode])
    amplitude, phase = np.abs(analytic), np.unwrap(np.angle(analytic))
    rate = (phase[width:] - phase[:-width]) * RATE / width  # over three periods
    decay = -np.log(amplitude[width:] / amplitude[:-width]) * RATE / width
    inner = slice(width, -width)
    return amplitude[width // 2 :][: len(rate)][inner], (rate / (2 * np.pi))[inner], (decay / rate)[inner]

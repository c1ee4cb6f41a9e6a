"""Portals with a crack that opens and closes, or a hinge with play: records under random forces.

A hinge in the left post has one stiffness while it is open and another while it is closed: it opens above a rotation,
or is open within that rotation on both sides (play), or beyond it on both sides. Time is integrated by exact
transitions of the modes with the open and with the closed hinge, ten steps per sample; a step in which it opens or
closes is divided there. A hinge with dry friction sticks as the closed one, and slides as the open one from a moment on
until it turns back; there too, steps are divided.
"""

import itertools
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
import scipy.linalg
from scipy.signal import butter, firwin, lfilter, upfirdn

from daq import Channel, Recording
from monitor.analysis.observation import Observation, observe
from tests.support.portals.measured_modes import observed
from tests.support.portals.tube_portal import LEFT, MODULUS, Portal

#: white noise; the same above `LOW` reduced; half-sine blows from one side at random times; white noise in gusts
Force = Literal["white", "low", "blows", "gusts"]
#: sides of the threshold on which a hinge is open; or beyond it from where it sticks, with dry friction
Opens = Literal["above", "within", "beyond", "slips"]
RATE, SECONDS, WINDOWS, OVER = 500, 45, 4, 10
SHORT = 20  # s, of a window without identification
PARTS = 16  # of a step, at one of which the crack opens or closes
BLOCK = 16  # steps that are computed at once until the crack opens or closes
SETTLING = 20  # s
DAMPING = 0.004
WHOLE = 1e-3  # m: rotation per moment over E I of a closed crack, next to none
HIGHEST = 1600.0  # Hz: higher modes respond statically
LOW = 80.0  # Hz
BLOWS, LENGTH = 3.0, 0.004  # per second, and duration of each [s]
GUST, SCATTER = 3.0, 0.5  # correlation time of the size of the forces [s], and standard deviation of its logarithm


@dataclass(frozen=True)
class Crack:
    """A hinge in the left post, in the plane of the portal."""

    place: float  #: share of the height
    opened: float  #: rotation per moment over E I while it is open [m]
    closed: float = WHOLE  #: and while it is closed [m]
    #: rotation at which it opens above, over its own rms about zero; moment on both sides, over that of the mean spring
    threshold: float = 0.0
    opens: Opens = "above"
    points: int = 5  #: seed of the points of the forces

    @property
    def healthy(self) -> "Crack":
        """Return the place before the change."""
        return Crack(self.place, WHOLE, WHOLE, points=self.points)

    def share(self, open_time: float) -> float:
        """Return the share of the mean added flexibility that is absent while it is closed."""
        mean = open_time * self.opened + (1 - open_time) * self.closed - WHOLE
        return open_time * (self.opened - self.closed) / mean


class CrackedPortal:
    """Modes with the mean spring, and the change of the spring while it is open and while it is closed."""

    def __init__(self, portal: Portal, crack: Crack) -> None:
        stiffness, mass, point, self.jump = portal.matrices(LEFT, crack.place)
        rigidity = MODULUS * portal.section[1]
        mean = 2 * rigidity / (crack.opened + crack.closed)
        whole = stiffness + mean * np.outer(self.jump, self.jump)
        square, shape = scipy.linalg.eigh(whole, mass, subset_by_index=(0, 40))
        kept = square < (2 * np.pi * HIGHEST) ** 2
        self.square, shape = square[kept], shape[:, kept]
        static = np.linalg.solve(whole, self.jump)
        # flexibility of the hinge in the modes that are left out, which follow without inertia
        rest = self.jump @ static - ((self.jump @ shape) ** 2 / self.square).sum()
        change = [rigidity / flexibility - mean for flexibility in (crack.opened, crack.closed)]
        self.change = [dk / (1 + dk * rest) for dk in change]
        #: rotation in the modes while open, and while closed, for the moment of a unit one of the mean spring
        self.turn = [mean * (1 + dk * rest) / (mean + dk) for dk in change]
        self.at_sensors = shape[portal.rows(point)]
        everywhere = shape[: 6 * len(point)].reshape(len(point), 6, -1)[:, :3]
        places = np.random.default_rng(crack.points).choice(np.arange(4, len(point) - 4), 8, replace=False)
        self.at_forces = everywhere[places, np.arange(8) % 3]
        self.jump = self.jump @ shape

    def transitions(self, change: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the state and modal forces over k parts of a step (PARTS + 1, ...), and what reads accelerations."""
        n = len(self.square)
        stiffness = np.diag(self.square) + change * np.outer(self.jump, self.jump)
        damping = np.diag(2 * DAMPING * np.sqrt(self.square))
        rate = np.zeros((3 * n, 3 * n))
        rate[:n, n : 2 * n] = np.eye(n)
        rate[n : 2 * n] = np.hstack([-stiffness, -damping, np.eye(n)])
        part = scipy.linalg.expm(rate / (RATE * OVER * PARTS))
        steps = np.array(list(itertools.accumulate([part] * PARTS, np.matmul, initial=np.eye(3 * n))))
        return (
            steps[:, : 2 * n, : 2 * n],
            steps[:, : 2 * n, 2 * n :],
            -self.at_sensors @ np.hstack([stiffness, damping]),
        )

    def run(self, force: np.ndarray, threshold: float, opens: Opens = "above") -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations (n_steps, n_channels, n_windows), and rotations of the hinge (n_steps, n_windows)."""
        # beyond the threshold the spring is another one: its moment continues from there
        near, far = self.change if opens == "within" else self.change[::-1]
        push = self.jump * (far - near) * threshold
        if near == far:
            threshold = np.inf  # one spring, on which a slider sticks
        run = self._slide if opens == "slips" else self._run
        # numbers 0, 1 and -1, as the sides
        springs = _Spring(self, near, 0 * push), _Spring(self, far, push), _Spring(self, far, -push)
        if near == far and opens != "slips":
            motion, turned = self._linear(force, springs[0])
            return motion[SETTLING * RATE * OVER :], turned[SETTLING * RATE * OVER :]
        done = [run(np.ascontiguousarray(own), threshold, opens, springs) for own in np.moveaxis(force, 2, 0)]
        motion, turned = (np.stack(each, axis=-1) for each in zip(*done, strict=True))
        return motion[SETTLING * RATE * OVER :], turned[SETTLING * RATE * OVER :]

    def _linear(self, force: np.ndarray, spring: "_Spring") -> tuple[np.ndarray, np.ndarray]:
        """Return what `run` does, of all windows at once with one spring, from the start of the forces on."""
        n_steps, _, n_windows = force.shape
        force = np.concatenate([force, np.zeros((-n_steps % BLOCK, *force.shape[1:]))])
        motion = np.empty((len(force), len(self.at_sensors), n_windows))
        turned = np.zeros((len(force) + 1, n_windows))
        state, one = np.zeros((2 * len(self.square), n_windows)), np.ones((1, n_windows))
        for k in range(0, len(force), BLOCK):
            known = np.concatenate([state, force[k : k + BLOCK].reshape(-1, n_windows), one])
            motion[k : k + BLOCK] = (spring.accelerations @ known).reshape(BLOCK, -1, n_windows)
            turned[k + 1 : k + 1 + BLOCK] = spring.rotations @ known
            state = spring.states[-1] @ known
        return motion[:n_steps], turned[:n_steps]

    def _run(
        self, force: np.ndarray, threshold: float, opens: Opens, springs: tuple["_Spring", "_Spring", "_Spring"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations (n_steps, n_channels), and rotations (n_steps,), of one window."""
        n, n_steps = len(self.square), len(force)
        force = np.vstack([force, np.zeros((BLOCK, force.shape[1]))])
        motion, turned = np.empty((len(force), len(self.at_sensors))), np.empty(len(force))
        state, rotation, k = np.zeros(2 * n), 0.0, 0
        while k < n_steps:
            side = int(side_of(rotation, threshold, opens))
            spring = springs[side]
            known = np.concatenate([state, force[k : k + BLOCK].ravel(), [1.0]])
            after = spring.rotations @ known
            sides = side_of(after, threshold, opens)
            crossed = sides != side
            whole = int(crossed.argmax()) if crossed.any() else BLOCK  # steps until the spring is another one
            started = min(whole + 1, BLOCK)
            turned[k], turned[k + 1 : k + started] = rotation, after[: started - 1]
            motion[k : k + started] = (spring.accelerations[: started * motion.shape[1]] @ known).reshape(started, -1)
            state = spring.states[whole] @ known
            k += whole
            if whole == BLOCK:
                rotation = after[-1]
            else:
                reached = int(sides[whole])
                part = round(PARTS * (threshold * (side or reached) - turned[k]) / (after[whole] - turned[k]))
                state = springs[reached].over(PARTS - part, spring.over(part, state, force[k]), force[k])
                rotation, k = float(self.jump @ state[:n]), k + 1
        return motion[:n_steps], turned[:n_steps]

    def _slide(
        self, force: np.ndarray, threshold: float, _: Opens, springs: tuple["_Spring", "_Spring", "_Spring"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations (n_steps, n_channels), and 0 while it sticks, 1 while it slides (n_steps,).

        A slider that is at u sticks within the threshold about u. Its force is that of the sliding hinge at rotations
        of u / threshold thresholds.
        """
        n, n_steps, stuck = len(self.square), len(force), springs[0].pushed(springs[2])
        force = np.vstack([force, np.zeros((BLOCK, force.shape[1]))])
        motion, slides = np.empty((len(force), len(self.at_sensors))), np.zeros(len(force))
        state, at, side, k = np.zeros(2 * n), 0.0, 0, 0
        while k < n_steps:
            spring, size = (springs[side], 1.0) if side else (stuck, at / threshold)
            known = np.concatenate([state, force[k : k + BLOCK].ravel(), [size]])
            # rotation about the slider, or the rate at which it slides, before and after each step
            course = (
                side * np.append(self.jump @ state[n:], spring.rates @ known)
                if side
                else np.append(self.jump @ state[:n], spring.rotations @ known) - at
            )
            ends = course[1:] < 0 if side else np.abs(course[1:]) > threshold
            whole = int(np.argmax(ends)) if ends.any() else BLOCK
            started = min(whole + 1, BLOCK)
            slides[k : k + started] = abs(side)
            motion[k : k + started] = (spring.accelerations[: started * motion.shape[1]] @ known).reshape(started, -1)
            state = spring.states[whole] @ known
            k += whole
            if whole == BLOCK:
                continue
            first, last = course[whole], course[whole + 1]
            limit = 0.0 if side else float(np.copysign(threshold, last))
            part = round(PARTS * min(max((limit - first) / (last - first), 0.0), 1.0))
            state = spring.over(part, state, force[k], size)
            if side:  # it turns back, and sticks where it has come to
                at, side = float(self.jump @ state[:n]) - side * threshold, 0
                state = stuck.over(PARTS - part, state, force[k], at / threshold)
            else:
                side = 1 if last > 0 else -1
                state = springs[side].over(PARTS - part, state, force[k])
            k += 1
        return motion[:n_steps], slides[:n_steps]


class _Spring:
    """Motion while the hinge has one spring, linear in what is known: the first state, forces of a block, and a one."""

    def __init__(self, portal: CrackedPortal, change: float, push: np.ndarray) -> None:
        self.portal, self.change, self.push = portal, change, push
        self.parts, by_modes, read = portal.transitions(change)
        self.by_force, self.by_push = by_modes @ portal.at_forces.T, by_modes @ push
        n_states, n_forces = self.by_force.shape[1:]
        state, states, accelerations = np.eye(n_states, n_states + BLOCK * n_forces + 1), [], []
        for k in range(BLOCK):
            own = slice(n_states + k * n_forces, n_states + (k + 1) * n_forces)
            felt = read @ state
            felt[:, own] += portal.at_sensors @ portal.at_forces.T
            felt[:, -1] += portal.at_sensors @ push
            states.append(state)
            accelerations.append(felt)
            state = self.parts[-1] @ state
            state[:, own] += self.by_force[-1]
            state[:, -1] += self.by_push[-1]
        self.states = np.array([*states, state])  #: (BLOCK + 1, n_states, n_known)
        self.rotations = portal.jump @ self.states[1:, : n_states // 2]  #: (BLOCK, n_known), after each step
        self.rates = portal.jump @ self.states[1:, n_states // 2 :]  #: (BLOCK, n_known) of the rotation, likewise
        self.accelerations = np.vstack(accelerations)  #: (BLOCK * n_channels, n_known), at the start of each step

    def pushed(self, other: "_Spring") -> "_Spring":
        """Return the same spring with the constant force of another one."""
        return _Spring(self.portal, self.change, other.push)

    def over(self, parts: int, state: np.ndarray, force: np.ndarray, size: float = 1.0) -> np.ndarray:
        """Return the state after parts of a step, with a multiple of the constant force."""
        after: np.ndarray = self.parts[parts] @ state + self.by_force[parts] @ force + size * self.by_push[parts]
        return after


def side_of(rotation: np.ndarray | float, threshold: float, opens: Opens) -> np.ndarray:
    """Return 1 above the threshold, -1 below that on the other side if there is one, else 0."""
    above = np.asarray(np.greater(rotation, threshold), int)
    return above if opens == "above" else above - np.less(rotation, -threshold)


def forces(seed: int, kind: Force, windows: int = WINDOWS, seconds: int = SECONDS) -> np.ndarray:
    """Return forces (n_steps, 8, n_windows)."""
    random = np.random.default_rng(seed)
    shape = (SETTLING + seconds + 1) * RATE * OVER, 8, windows
    if kind == "blows":
        hits = (random.uniform(size=shape) < BLOWS / (RATE * OVER)) * random.lognormal(size=shape)
        return upfirdn(np.sin(np.linspace(0, np.pi, round(LENGTH * RATE * OVER))), hits, axis=0)[: shape[0]]
    white = random.standard_normal(shape)
    if kind == "gusts":
        step = np.exp(-1 / (GUST * RATE * OVER))
        slow = lfilter([np.sqrt(1 - step**2)], [1, -step], random.standard_normal((shape[0], 1, windows)), axis=0)
        return white * np.exp(SCATTER * slow)
    return lfilter(*butter(2, LOW / (RATE * OVER / 2)), white, axis=0) if kind == "low" else white


@cache
def records(
    portal: Portal,
    crack: Crack,
    seed: int,
    kind: Force = "white",
    windows: int = WINDOWS,
    seconds: int = SECONDS,
) -> tuple[tuple[Recording, ...], float]:
    """Return windows with noise and gains 0.3 % off, and the share of the time in which the crack is open."""
    cracked, force = CrackedPortal(portal, crack), forces(seed, kind, windows, seconds)
    threshold, short = 0.0, force[: (SETTLING + 5) * RATE * OVER]
    if crack.threshold and crack.opens == "above":
        _, turned = cracked.run(short, 0.0)
        threshold = crack.threshold * float(turned.std())
    elif crack.threshold:
        mean = (crack.opened + crack.closed) / 2
        _, turned = CrackedPortal(portal, replace(crack, opened=mean, closed=mean)).run(short, 0.0)
        threshold = crack.threshold * float(turned.std()) * cracked.turn[crack.opens != "within"]
    motion, turned = cracked.run(force, threshold, crack.opens)
    taps = firwin(32 * OVER + 1, 0.88 / OVER, window=("kaiser", 9.0))
    random = np.random.default_rng((seed, 1))
    gain = 1 + 0.003 * np.random.default_rng(7).standard_normal(motion.shape[1])
    fine = np.moveaxis(motion, 2, 0)
    filtered = [upfirdn(taps, own.T, down=OVER, axis=1)[:, 64 : 64 + seconds * RATE].T for own in fine]
    level = 0.05 / np.sqrt(np.mean(np.square(filtered)))
    channels = tuple(Channel(name=c, device="daq", axis=axis) for c, (_, axis) in portal.sensors().items())
    start = 1_767_225_600_000_000_000 + seed * 3600 * 10**9
    found = [
        Recording(
            channels=channels,
            data=level * data * gain + 2.5e-4 * random.standard_normal(data.shape),
            rate=float(RATE),
            start=start + k * seconds * 10**9,
            temperature=np.nan,
        )
        for k, data in enumerate(filtered)
    ]
    far = float((turned if crack.opens == "slips" else side_of(turned, threshold, crack.opens) != 0).mean())
    return tuple(found), 1 - far if crack.opens == "within" else far


def identified(portal: Portal, crack: Crack, seed: int, kind: Force = "white") -> tuple[Observation, float]:
    """Return the modes identified in the windows of a record, and the share of the time in which the crack is open."""
    found, open_time = records(portal, crack, seed, kind)
    return observe(found), open_time


def sampled(
    portal: Portal, crack: Crack, seed: int, kind: Force = "white", seconds: int = SHORT
) -> tuple[Observation, float]:
    """Return the same with modes drawn about those with the mean spring: only the last window has signals."""
    cracked, ((sample,), open_time) = CrackedPortal(portal, crack), records(portal, crack, seed, kind, 1, seconds)
    frequency = np.sqrt(cracked.square) / (2 * np.pi)
    modes = observed(portal, frequency, cracked.at_sensors, seed, np.random.default_rng((seed, 2)), seconds)
    return replace(modes, sample=sample), open_time

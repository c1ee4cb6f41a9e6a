"""Portals with a crack that opens and closes: records under random forces.

A hinge in the left post has one stiffness while it is open and another while it is closed. Time is integrated by exact
transitions of the modes with the open and with the closed crack, ten steps per sample; a step in which the crack opens
or closes is divided there.
"""

import itertools
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
import scipy.linalg
from scipy.signal import butter, firwin, lfilter, upfirdn

from daq import Channel, Recording
from tests.support.portals.tube_portal import LEFT, MODULUS, Portal

#: white noise; the same above `LOW` reduced; half-sine blows from one side at random times
Force = Literal["white", "low", "blows"]
RATE, SECONDS, WINDOWS, OVER = 500, 45, 4, 10
PARTS = 16  # of a step, at one of which the crack opens or closes
SETTLING = 20  # s
DAMPING = 0.004
WHOLE = 1e-3  # m: rotation per moment over E I of a closed crack, next to none
HIGHEST = 1600.0  # Hz: higher modes respond statically
LOW = 80.0  # Hz
BLOWS, LENGTH = 3.0, 0.004  # per second, and duration of each [s]


@dataclass(frozen=True)
class Crack:
    """A hinge in the left post, in the plane of the portal."""

    place: float  #: share of the height
    opened: float  #: rotation per moment over E I while it is open [m]
    closed: float = WHOLE  #: and while it is closed [m]
    threshold: float = 0.0  #: rotation at which it opens, over its own rms about zero [-]

    @property
    def healthy(self) -> "Crack":
        """Return the place before it cracks."""
        return Crack(self.place, WHOLE, WHOLE)

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
        self.at_sensors = shape[portal.rows(point)]
        everywhere = shape[: 6 * len(point)].reshape(len(point), 6, -1)[:, :3]
        places = np.random.default_rng(5).choice(np.arange(4, len(point) - 4), 8, replace=False)
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

    def run(self, force: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations (n_steps, n_channels, n_windows), and rotations of the hinge (n_steps, n_windows)."""
        n, (n_steps, _, n_windows) = len(self.square), force.shape
        # numbers 0 and 1: closed and open
        (a1, b1, read1), (a0, b0, read0) = map(self.transitions, self.change)
        a, more = np.array([a0, a1]), np.array([b0, b1]) @ self.at_forces.T
        direct = self.at_sensors @ self.at_forces.T
        # beyond the threshold the spring is another one: its moment continues from there
        push = self.jump * (self.change[0] - self.change[1]) * threshold
        shift, moved = np.array([0 * b1, b1]) @ push, (self.at_sensors @ push)[:, None]
        state, motion = np.zeros((2 * n, n_windows)), np.empty((n_steps, len(self.at_sensors), n_windows))
        turned, rotation = np.empty((n_steps, n_windows)), np.zeros(n_windows)
        ends = [(a[is_open, -1], more[is_open, -1], shift[is_open, -1][:, None]) for is_open in (1, 0)]
        for k, now in enumerate(force):
            turned[k], opened = rotation, rotation > threshold
            motion[k] = np.where(opened, read1 @ state + moved, read0 @ state) + direct @ now
            after = np.where(opened, *(step @ state + by_force @ now + by_push for step, by_force, by_push in ends))
            rotation = self.jump @ after[:n]
            for w in np.flatnonzero((rotation > threshold) != opened):
                part = round(PARTS * (threshold - turned[k, w]) / (rotation[w] - turned[k, w]))
                middle = state[:, w]
                for is_open, parts in ((int(opened[w]), part), (int(not opened[w]), PARTS - part)):
                    middle = a[is_open, parts] @ middle + more[is_open, parts] @ now[:, w] + shift[is_open, parts]
                after[:, w], rotation[w] = middle, self.jump @ middle[:n]
            state = after
        return motion[SETTLING * RATE * OVER :], turned[SETTLING * RATE * OVER :]


def forces(seed: int, kind: Force) -> np.ndarray:
    """Return forces (n_steps, 8, n_windows)."""
    random = np.random.default_rng(seed)
    shape = (SETTLING + SECONDS + 1) * RATE * OVER, 8, WINDOWS
    if kind == "blows":
        hits = (random.uniform(size=shape) < BLOWS / (RATE * OVER)) * random.lognormal(size=shape)
        return upfirdn(np.sin(np.linspace(0, np.pi, round(LENGTH * RATE * OVER))), hits, axis=0)[: shape[0]]
    white = random.standard_normal(shape)
    return lfilter(*butter(2, LOW / (RATE * OVER / 2)), white, axis=0) if kind == "low" else white


@cache
def records(portal: Portal, crack: Crack, seed: int, kind: Force = "white") -> tuple[tuple[Recording, ...], float]:
    """Return windows with noise and gains 0.3 % off, and the share of the time in which the crack is open."""
    cracked, force = CrackedPortal(portal, crack), forces(seed, kind)
    threshold = 0.0
    if crack.threshold:
        _, turned = cracked.run(force[: (SETTLING + 5) * RATE * OVER], 0.0)
        threshold = crack.threshold * float(turned.std())
    motion, turned = cracked.run(force, threshold)
    taps = firwin(32 * OVER + 1, 0.88 / OVER, window=("kaiser", 9.0))
    random = np.random.default_rng((seed, 1))
    gain = 1 + 0.003 * np.random.default_rng(7).standard_normal(motion.shape[1])
    fine = np.moveaxis(motion, 2, 0)
    filtered = [upfirdn(taps, own.T, down=OVER, axis=1)[:, 64 : 64 + SECONDS * RATE].T for own in fine]
    level = 0.05 / np.sqrt(np.mean(np.square(filtered)))
    channels = tuple(Channel(name=c, device="daq", axis=axis) for c, (_, axis) in portal.sensors().items())
    start = 1_767_225_600_000_000_000 + seed * 3600 * 10**9
    found = [
        Recording(
            channels=channels,
            data=level * data * gain + 2.5e-4 * random.standard_normal(data.shape),
            rate=float(RATE),
            start=start + k * SECONDS * 10**9,
            temperature=np.nan,
        )
        for k, data in enumerate(filtered)
    ]
    return tuple(found), float((turned > threshold).mean())

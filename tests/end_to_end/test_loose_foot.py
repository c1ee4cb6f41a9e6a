"""A foot that has come loose, where two modes are then close: records of a frame by a finite element code of its own.

Portals of thin tube. Beam elements with consistent mass (Przemieniecki 1968, ch. 11), 32 per member; white forces. The
program's model has another modulus and density, elements of 40 mm and shear-flexible beams. The stiffness of the right
foot falls from 2000 to 120 N m/rad. Two modes are then some tenths of a per cent apart, and three minutes mix their
shapes.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg
from scipy.signal import firwin, lfilter, upfirdn

from daq import Channel, Recording
from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, observe, window_seconds
from tests.support.thorough import few_of
from updater import Structure, parse_structure

RATE, SECONDS, OVER = 500, 180, 4
LEFT, RIGHT = 2000.0, 120.0  # N m/rad
MODULUS, SHEAR, DENSITY = 212e9, 81.5e9, 7830.0
PLACES = ("left", 0.5), ("beam", 0.0), ("beam", 0.25), ("beam", 0.625), ("right", 0.625)
AXES = "xy", "xy", "yz", "yz", "xy"
SENSOR = 0.02  # kg


@dataclass(frozen=True)
class Portal:
    """Two posts and a beam of box section; dimensions in m."""

    across: float  #: outer side of the section in the plane
    along: float  #: and out of it
    wall: float
    height: float
    width: float

    @property
    def section(self) -> tuple[float, float, float, float]:
        """Area, second moments about y and in the plane's normal direction, torsion constant."""
        b, d, t = self.across, self.along, self.wall
        area = b * d - (b - 2 * t) * (d - 2 * t)
        in_plane = (d * b**3 - (d - 2 * t) * (b - 2 * t) ** 3) / 12
        out_of_plane = (b * d**3 - (b - 2 * t) * (d - 2 * t) ** 3) / 12
        return area, in_plane, out_of_plane, 2 * t * ((b - t) * (d - t)) ** 2 / (b + d - 2 * t)

    def at(self, member: str, share: float) -> tuple[float, float, float]:
        """Return a point of a member, that far up a post or along the beam."""
        if member == "beam":
            return share * self.width, 0.0, self.height
        return (0.0 if member == "left" else self.width), 0.0, share * self.height

    def sensors(self) -> dict[str, tuple[tuple[float, float, float], int]]:
        """Return the place and axis of each channel."""
        return {
            f"{member}_{share:g}_{axis}": (self.at(member, share), "xyz".index(axis))
            for (member, share), axes in zip(PLACES, AXES, strict=True)
            for axis in axes
        }

    def file(self) -> Structure:
        """Return the structure as its owner describes it."""
        area, in_plane, out_of_plane, torsion = self.section
        lines = [
            'name = "portal"\n[mesh]\nelement_length = 0.04',
            "[material.steel]\nyoungs_modulus = 210e9\nshear_modulus = 80.8e9\ndensity = 7850",
            f"[section.tube]\narea = {area}\nsecond_moment = [{in_plane}, {out_of_plane}]",
            f"torsion_constant = {torsion}\nshear_factor = 0.44",
        ]
        ends = {
            "left post": ((0.0, 0.0, 0.0), self.at("left", 1.0)),
            "right post": (self.at("right", 0.0), self.at("right", 1.0)),
            "beam": (self.at("left", 1.0), self.at("right", 1.0)),
        }
        for name, (start, end) in ends.items():
            lines.append(f'[[member]]\nname = "{name}"\nfrom = {list(start)}\nto = {list(end)}')
            lines.append('material = "steel"\nsection = "tube"\nlocal_y = [0.0, 1.0, 0.0]')
        for foot in (self.at("left", 0.0), self.at("right", 0.0)):
            lines.append(f'[[support]]\nat = {list(foot)}\nfixed = ["x", "y", "z"]')
            lines.append(f"stiffness = {{rx = {LEFT}, ry = {LEFT}, rz = {LEFT}}}")
        for channel, (at, axis) in self.sensors().items():
            direction = [float(k == axis) for k in range(3)]
            lines.append(f'[[sensor]]\nchannel = "{channel}"\nat = {list(at)}\ndirection = {direction}')
        lines += [f"[[body]]\nat = {list(self.at(*place))}\nmass = {SENSOR}" for place in PLACES]
        return parse_structure("\n".join(lines))

    def modes(self, foot: float, n: int = 32) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frequencies [Hz], and mass-normalised shapes at the sensors and at all nodes (n_nodes, 3, n_modes)."""
        rise = np.linspace(0, self.height, n + 1)
        node = [(0.0, 0.0, z) for z in rise]
        node += [(x, 0.0, self.height) for x in np.linspace(0, self.width, n + 1)[1:]]
        node += [(self.width, 0.0, z) for z in rise[-2::-1]]
        point = np.array(node)
        stiffness, mass = np.zeros((2, 6 * len(point), 6 * len(point)))
        for k in range(len(point) - 1):
            along = point[k + 1] - point[k]
            length = float(np.linalg.norm(along))
            frame = np.array([along / length, (0, 1, 0), np.cross(along / length, (0, 1, 0))])
            turn, own = np.kron(np.eye(4), frame), slice(6 * k, 6 * k + 12)
            for whole, element in zip((stiffness, mass), self._element(length), strict=True):
                whole[own, own] += turn.T @ element @ turn
        for first, spring in ((0, LEFT), (6 * (len(point) - 1), foot)):
            stiffness[range(first, first + 6), range(first, first + 6)] += [*3 * [1e10], spring, spring, LEFT]
        for place in PLACES:
            first = 6 * self._nearest(point, self.at(*place))
            mass[range(first, first + 3), range(first, first + 3)] += SENSOR
        square, shape = scipy.linalg.eigh(stiffness, mass, subset_by_index=(0, 24))
        rows = [6 * self._nearest(point, at) + axis for at, axis in self.sensors().values()]
        return np.sqrt(square) / (2 * np.pi), shape[rows], shape.reshape(len(point), 6, -1)[:, :3]

    @staticmethod
    def _nearest(point: np.ndarray, at: tuple[float, float, float]) -> int:
        away = np.linalg.norm(point - at, axis=1)
        assert away.min() < 1e-9
        return int(np.argmin(away))

    def _element(self, length: float) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness and consistent mass (12, 12) of a Bernoulli beam along x, by nodes x y z rx ry rz."""
        area, in_plane, out_of_plane, torsion = self.section
        stiffness, mass = np.zeros((2, 12, 12))
        for k, rigidity, per_density in ((0, MODULUS * area, area), (3, SHEAR * torsion, in_plane + out_of_plane)):
            dofs = np.ix_((k, k + 6), (k, k + 6))
            stiffness[dofs] += rigidity / length * np.array([[1, -1], [-1, 1]])
            mass[dofs] += DENSITY * per_density * length / 6 * np.array([[2, 1], [1, 2]])
        h = length
        bending = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
        bending += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
        inertia = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
        inertia += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
        for moment, own, sign in ((out_of_plane, (1, 5, 7, 11), 1), (in_plane, (2, 4, 8, 10), -1)):
            turn = np.diag([1, sign, 1, sign])
            stiffness[np.ix_(own, own)] += MODULUS * moment / h**3 * turn @ bending @ turn
            mass[np.ix_(own, own)] += DENSITY * area * h / 420 * turn @ inertia @ turn
        return stiffness, mass

    def record(self, foot: float, seed: int) -> Recording:
        """Return accelerations under eight white forces, damping 0.4 %, with noise and gains 0.3 % off."""
        frequency, at_sensors, everywhere = self.modes(foot)
        random = np.random.default_rng((seed, int(foot)))
        places = np.random.default_rng(5).choice(np.arange(4, len(everywhere) - 4), 8, replace=False)
        at_forces = everywhere[places, np.arange(8) % 3]
        fine, settling = RATE * OVER, 20 * RATE * OVER
        force = random.standard_normal((8, settling + (SECONDS + 1) * fine))
        motion = np.zeros((len(at_sensors), force.shape[1]))
        for k in np.flatnonzero(frequency < 0.24 * fine):
            omega, damping = 2 * np.pi * frequency[k], 0.004
            pole = omega * (-damping + 1j * np.sqrt(1 - damping**2))
            step = np.exp(pole / fine)
            state = lfilter([0.0, (step - 1) / pole], [1.0, -step], (at_forces[:, k] @ force).astype(complex))
            acceleration = (pole**2 * state).imag / pole.imag + at_forces[:, k] @ force
            motion += np.outer(at_sensors[:, k], acceleration)
        filtered = upfirdn(firwin(513, 0.88 / OVER, window=("kaiser", 9.0)), motion[:, settling:], down=OVER, axis=1)
        data = filtered[:, 64 : 64 + SECONDS * RATE].T
        gain = 1 + 0.003 * np.random.default_rng((seed, 7)).standard_normal(len(at_sensors))
        data = 0.05 * (data / np.sqrt(np.mean(data**2)) * gain + 5e-3 * random.standard_normal(data.shape))
        channels = tuple(Channel(name=c, device="daq", axis=axis) for c, (_, axis) in self.sensors().items())
        start = 1_767_225_600_000_000_000 + (3600 * 10**9 if foot == RIGHT else 0)
        return Recording(channels=channels, data=data, rate=float(RATE), start=start, temperature=np.nan)

    def observed(self, foot: float, seed: int) -> Observation:
        """Return the modes of the windows of a record."""
        whole = self.record(foot, seed)
        n = round(window_seconds(self.file(), SECONDS) * RATE)
        parts = range(len(whole.data) // n)
        return observe(
            replace(whole, data=whole.data[k * n : (k + 1) * n], start=whole.start + round(k * n / RATE * 1e9))
            for k in parts
        )


#: by the distance of the two closest modes with the loose foot, in per cent
PORTALS = {
    0.14: Portal(0.010, 0.010, 0.001, 0.6, 0.66),
    0.31: Portal(0.018, 0.015, 0.0015, 0.8, 1.45),
    0.33: Portal(0.015, 0.018, 0.0015, 0.9, 1.15),
    0.58: Portal(0.015, 0.018, 0.0015, 0.9, 1.175),
    1.13: Portal(0.018, 0.015, 0.0015, 1.0, 1.175),
    1.63: Portal(0.015, 0.018, 0.0015, 0.8, 1.15),
}
#: without the record of the first portal in which a mode is identified with a MAC of 0.85 with the true one
CASES = [(0.14, 3), *((apart, seed) for apart in PORTALS for seed in range(10) if (apart, seed) != (0.14, 3))]


@pytest.mark.parametrize(("apart", "seed"), few_of(CASES, 1))
def test_loose_foot_is_named_where_two_modes_mix(apart: float, seed: int) -> None:
    """Its stiffness within three stated deviations, of at most a fifth.

    The third axis may be listed too: it is at two deviations, which chance exceeds in one of 20 cases.
    """
    portal = PORTALS[apart]
    frequency, _, _ = portal.modes(RIGHT)
    assert 100 * (np.diff(frequency[1:11]) / frequency[1:10]).min() == pytest.approx(apart, abs=0.005)
    found = explain(portal.file(), portal.observed(LEFT, seed), portal.observed(RIGHT, seed)).diagnosis
    print(apart, seed, found)
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.cause == "support_stiffness"
    assert cause.where
    assert cause.where.position == portal.at("right", 0.0)
    for axis in ("rx", "ry"):
        stiffness = cause.parameters[f"stiffness_{axis}"]
        assert stiffness.std < RIGHT / 5
        assert abs(stiffness.value - RIGHT) < 3 * stiffness.std

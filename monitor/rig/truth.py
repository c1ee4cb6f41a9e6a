"""The true structure, as the devices feel it: finer than the reference model and different in kind.

Timoshenko elements of 10 mm with consistent mass stand on a flexible foot and joint; ambient forces shake them; each
device filters, samples at its own clock, scatters in gain, adds noise and rounds to counts.
"""

from collections.abc import Iterator

import numpy as np
from scipy.signal import firwin, lfilter

from daq import EPSON_SCALE, FloatArray, IntArray
from monitor.rig.scenario import RigDevice, Scenario
from updater import Ambient, AmbientResponse, Body, Joint, Model, Structure, Support, build_model

_MESH = 0.01  # m
_OVERSAMPLING = 4
_CHUNK = 0.1  # s simulated at once
_HALF_TAPS = 64  # of the anti-alias filter, at the simulation's rate
_KEPT = 4.0  # s of simulated motion that devices may still ask for
_TURNS = ("rx", "ry", "rz")


def true_structure(structure: Structure, scenario: Scenario) -> Structure:
    """Return the structure as it really is."""
    truth = scenario.truth
    material = {
        name: m.model_copy(
            update={
                "youngs_modulus": m.youngs_modulus * truth.stiffness_factor,
                "shear_modulus": m.shear_modulus * truth.stiffness_factor,
                "density": m.density * truth.density_factor,
            }
        )
        for name, m in structure.material.items()
    }
    longest = max(structure.member, key=lambda member: member.length)
    bending = material[longest.material].youngs_modulus * max(structure.section[longest.section].second_moment)
    unit = bending / longest.length
    supports = tuple(_flexible(s, truth.foot_flexibility, unit) for s in structure.support)
    changed = structure.model_copy(
        update={"material": material, "support": supports, "joint": _joints(structure, scenario, unit)}
    )
    return changed.with_mesh(_MESH)


def _flexible(support: Support, flexibility: tuple[float, float, float], unit: float) -> Support:
    springs = {a: unit / c for a, c in zip(_TURNS, flexibility, strict=True) if c > 0 and a in support.fixed}
    fixed = [a for a in support.fixed if a not in springs]
    return Support.model_validate({"at": support.at, "fixed": fixed, "stiffness": springs})


def _joints(structure: Structure, scenario: Scenario, unit: float) -> tuple[Joint, ...]:
    """Return a joint wherever an end of one member meets a later member."""
    springs = {a: unit / c for a, c in zip(_TURNS, scenario.truth.joint_flexibility, strict=True) if c > 0}
    if not springs:
        return ()
    return tuple(
        Joint.model_validate({"member": member.name, "at": end, "stiffness": springs})
        for i, member in enumerate(structure.member)
        for end in {p for other in structure.member[:i] for p in (other.start, other.end)}
        if _passes(member.start, member.end, end)
    )


def _passes(start: tuple[float, ...], end: tuple[float, ...], point: tuple[float, ...]) -> bool:
    a, b = np.subtract(point, start), np.subtract(end, start)
    along = float(a @ b / (b @ b))
    return bool(0 <= along <= 1 and np.linalg.norm(a - along * b) < 1e-6)


class World:
    """The motion at all devices, simulated as far as somebody asks for it.

    Parameters
    ----------
    structure : nominal
    scenario : what is true instead, and what happens
    """

    def __init__(self, structure: Structure, scenario: Scenario) -> None:
        self._scenario = scenario
        self._true = true_structure(structure, scenario)
        self._rate = _OVERSAMPLING * scenario.rate
        self._random = np.random.default_rng((scenario.seed, 1))
        model = self._model(())
        read = np.concatenate([model.read(np.array(device.at))[:3] for device in scenario.device])
        damping = np.array(scenario.truth.damping)
        self._response = AmbientResponse(model, read, damping, self._ambient(), rate=self._rate, seed=scenario.seed)
        self._response.step(
            round(5 / (damping.min() * 2 * np.pi * 10) * self._rate)
        )  # until it swings as it always has
        self._filter = firwin(2 * _HALF_TAPS + 1, 1.0 * scenario.rate / 2 * 0.86, fs=self._rate, window=("kaiser", 8.0))
        self._delay_line = np.zeros((2 * _HALF_TAPS, len(read)))
        self._motion = np.zeros((0, len(read)))  # filtered, at the simulation's rate
        self._first = 0  # its first sample
        self._simulated = 0  # samples simulated so far
        self._bodies: tuple[Body, ...] = ()
        self._waiting: list[tuple[int, Body]] = []
        self._origin: int | None = None

    def origin(self, time: int) -> int:
        """Return the time of the world's first sample [ns UTC]: that of whoever asks first."""
        if self._origin is None:
            self._origin = time
        return self._origin

    def _model(self, bodies: tuple[Body, ...]) -> Model:
        return build_model(self._true.with_bodies(bodies), shear_flexible=True, mass="consistent")

    def _ambient(self) -> Ambient:
        """Draw where the forces act: on every member, each point across it in both directions."""
        points: list[FloatArray] = []
        axes: list[int] = []
        for member in self._true.member:
            along = int(np.argmax(np.abs(np.subtract(member.end, member.start))))
            for share in self._random.uniform(0.1, 1.0, self._scenario.truth.forces_per_member):
                points += [member.point(member.length * share)] * 2
                axes += [axis for axis in range(3) if axis != along]
        return Ambient(
            points=tuple((float(p[0]), float(p[1]), float(p[2])) for p in points),
            axes=tuple(axes),
            density=self._scenario.truth.force_density,
        )

    def schedule(self, body: Body, time: int) -> None:
        """Clamp a body on at a time [ns UTC]."""
        self._waiting.append((round((time - self.origin(time)) * 1e-9 * self._rate), body))
        self._waiting.sort(key=lambda entry: entry[0])

    def motion(self, first: int, last: int, device: int) -> FloatArray:
        """Return filtered accelerations (n, 3) [m/s2] of a device, samples first .. last - 1 at the simulation's rate.

        Raises
        ------
        ValueError
            If they are so long ago that they are forgotten.
        """
        if first < self._first:
            raise ValueError(f"motion: expected a sample from {self._first} on, found {first}")
        while self._first + len(self._motion) < last:
            self._advance()
        part = self._motion[first - self._first : last - self._first]
        return part[:, 3 * device : 3 * device + 3]

    def _advance(self) -> None:
        n = round(_CHUNK * self._rate)
        raw = np.concatenate(list(self._pieces(n)))
        stream = np.concatenate([self._delay_line, raw])
        self._delay_line = stream[len(stream) - 2 * _HALF_TAPS :]
        filtered = lfilter(self._filter, [1.0], stream, axis=0)[2 * _HALF_TAPS :]
        motion = np.concatenate([self._motion, filtered])
        kept = round(_KEPT * self._rate)
        self._first += max(0, len(motion) - kept)
        self._motion = motion[-kept:]

    def _pieces(self, n: int) -> Iterator[FloatArray]:
        """Simulate n samples, changing the structure at the very sample."""
        end = self._simulated + n
        while self._waiting and self._waiting[0][0] < end:
            at, body = self._waiting.pop(0)
            if at > self._simulated:
                yield self._response.step(at - self._simulated)
                self._simulated = at
            self._bodies = (*self._bodies, body)
            self._response.change(self._model(self._bodies))
        if end > self._simulated:
            yield self._response.step(end - self._simulated)
        self._simulated = end


class DeviceSource:
    """What one device measures of the world; its samples lie between the simulation's, by its own clock.

    Parameters
    ----------
    world : shared by all devices
    number : of the device in the scenario
    """

    def __init__(self, world: World, scenario: Scenario, number: int) -> None:
        self._world, self._number = world, number
        self._rate = _OVERSAMPLING * scenario.rate
        self._random = np.random.default_rng((scenario.seed, 2, number))
        self._gain = 1 + scenario.truth.gain_scatter * self._random.standard_normal(3)
        self._noise = scenario.truth.noise_density * np.sqrt(scenario.rate / 2)
        self._start = self._step = 0.0

    def start(self, time: int, rate: float) -> None:
        """Begin: scan k is taken at time + k / rate [ns UTC, Hz]."""
        self._start = (
            time - self._world.origin(time)
        ) * 1e-9 * self._rate + 4  # the interpolation looks back a few samples
        self._step = self._rate / rate

    def read(self, index: int, n: int) -> IntArray:
        """Return scans index .. index + n - 1 as counts (n, 3)."""
        position = self._start + self._step * (index + np.arange(n))
        base = np.floor(position).astype(np.intp)
        first = int(base[0]) - 2
        motion = self._world.motion(first, int(base[-1]) + 4, self._number)
        signal = _lagrange(motion, base - first, position - base)
        signal = self._gain * signal + self._noise * self._random.standard_normal(signal.shape)
        return np.asarray(np.round(signal / EPSON_SCALE), np.int32)


def _lagrange(signal: FloatArray, base: FloatArray, x: FloatArray) -> FloatArray:
    """Interpolate with the polynomial through six points; error under -70 dB below an eighth of the rate."""
    nodes = np.arange(-2, 4)
    out = np.zeros((len(x), signal.shape[1]))
    for k in nodes:
        others = nodes[nodes != k]
        weight = np.prod((x[:, None] - others) / (k - others), axis=1)
        out += weight[:, None] * signal[base + k]
    return out


def make_sources(structure: Structure, scenario: Scenario) -> tuple[World, list[DeviceSource]]:
    """Return the world and one source a device."""
    world = World(structure, scenario)
    return world, [DeviceSource(world, scenario, i) for i in range(len(scenario.device))]


def describe(device: RigDevice) -> str:
    """Return a device's serial number: its name's last eight letters."""
    return device.name[-8:].upper()

"""The structure as it really is: finer than the reference model, different in kind, and shaken by its surroundings.

Timoshenko elements of 10 mm with consistent mass on a flexible foot, with flexible joints; bodies are clamped on
exactly at their sample. Deviations are relative, so that any frame of straight members can be simulated.
"""

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from daq import FloatArray
from monitor.rig.scenario import RigEvent, Scenario, Vector
from updater import Model, ModelError, Structure, build_model
from updater.fe import Ambient, AmbientResponse, Crack
from updater.structure import Joint, Member, Support

OVERSAMPLING = 4  #: simulated samples a scan at the scenario's rate
LEAD = 4000  #: simulated samples before the world's origin, for the devices' filters to look back on
_MESH = 0.01  # m
_HIGHEST = 0.45  # of the simulated rate: modes near half of it would appear at other frequencies
_CHUNK = 0.25  # s simulated at once
_KEPT = 4.0  # s of motion that devices may still request
_SETTLED = (
    4.0  # time constants of the slowest mode, after which the motion is taken as stationary (1 - e^-8 of its power)
)
_LONGEST_SETTLING = 3600.0  # s that are simulated before the rig begins
_PARTS = 48  # in which a body comes little by little
_TURNS = ("rx", "ry", "rz")


def true_structure(structure: Structure, scenario: Scenario) -> Structure:
    """Return the structure as it really is, before anything is added to it."""
    truth = scenario.truth
    scaled = {"youngs_modulus": truth.stiffness_factor, "shear_modulus": truth.stiffness_factor}
    scaled["density"] = truth.density_factor
    material = {
        name: m.model_copy(update={key: getattr(m, key) * factor for key, factor in scaled.items()})
        for name, m in structure.material.items()
    }
    longest = max(structure.member, key=lambda member: member.length)
    modulus = material[longest.material].youngs_modulus
    unit = modulus * max(structure.section[longest.section].second_moment) / longest.length
    supports = tuple(_flexible(s, truth.foot_flexibility, unit) for s in structure.support)
    joints = structure.joint or _joints(structure, truth.joint_flexibility, unit)
    return structure.model_copy(update={"material": material, "support": supports, "joint": joints}).with_mesh(_MESH)


def _springs(flexibility: Vector, unit: float) -> dict[str, float]:
    return {axis: unit / c for axis, c in zip(_TURNS, flexibility, strict=True) if c > 0}


def _flexible(support: Support, flexibility: Vector, unit: float) -> Support:
    """Give a support springs where it was rigid."""
    springs = {axis: k for axis, k in _springs(flexibility, unit).items() if axis in support.fixed}
    fixed = [axis for axis in support.fixed if axis not in springs]
    return Support.model_validate({"at": support.at, "fixed": fixed, "stiffness": {**support.stiffness, **springs}})


def _joints(structure: Structure, flexibility: Vector, unit: float) -> tuple[Joint, ...]:
    """Return a joint wherever two members meet, between the later one and the rest."""
    springs = _springs(flexibility, unit)
    meetings: dict[Vector, Member] = {}
    for i, later in enumerate(structure.member):
        for other in structure.member[:i]:
            ends = [p for p in (other.start, other.end) if passes(later, p)]
            ends += [p for p in (later.start, later.end) if passes(other, p)]
            meetings.update(dict.fromkeys(ends, later))
    return tuple(
        Joint.model_validate({"member": member.name, "at": point, "stiffness": springs})
        for point, member in meetings.items()
        if springs
    )


def passes(member: Member, point: Vector) -> bool:
    """Return whether a point is on a member."""
    a, b = np.subtract(point, member.start), np.subtract(member.end, member.start)
    along = float(np.clip(a @ b / (b @ b), 0, 1))
    return bool(np.linalg.norm(a - along * b) < 1e-6)


def _in_parts(event: RigEvent) -> list[RigEvent]:
    """Return an event that takes some time as many small ones."""
    if not event.body or not event.over:
        return [event]
    part = event.body.times(1 / _PARTS)
    return [
        event.model_copy(update={"at": event.at + event.over * (k + 0.5) / _PARTS, "body": part, "over": 0.0})
        for k in range(_PARTS)
    ]


class World:
    """The motion at all devices, simulated as far as it is requested.

    The same scenario and the same times of its events give the same motion to the last bit, for any division into
    pieces. Memory is bounded: motion older than a few seconds is discarded.

    Parameters
    ----------
    structure : nominal
    scenario : true properties, and events
    """

    def __init__(self, structure: Structure, scenario: Scenario) -> None:
        self._scenario = scenario
        self._true = true_structure(structure, scenario)
        self.rate = OVERSAMPLING * scenario.rate  #: simulated samples per second [Hz]
        self._begins = sorted(event.at for event in scenario.event)
        parts = [part for event in scenario.event for part in _in_parts(event)]
        self._events = sorted(parts, key=lambda event: event.at)
        self._states = [self._state(self._events[:n]) for n in range(len(self._events) + 1)]
        self._response = self._stationary_response()
        self._size = round(_CHUNK * self.rate)
        self._chunks: deque[FloatArray] = deque(maxlen=round(_KEPT / _CHUNK))
        self._n_simulated = 0
        self._changes: list[int] = []  # samples at which the next states begin
        self._origin: int | None = None

    def _state(self, events: Sequence[RigEvent]) -> tuple[Model, Crack | None]:
        """Return the structure after some events; a crack takes the place of one before it, also of the file's."""
        bodies = [event.body for event in events if event.body]
        model = build_model(self._true.with_bodies(bodies), shear_flexible=True, mass="consistent")
        cracks = [event.crack for event in events if event.crack]
        return model, Crack(**cracks[-1].model_dump()) if cracks else Crack.of(self._true)

    def _stationary_response(self) -> AmbientResponse:
        """Return the response once it swings as it always has."""
        (model, crack), damping = self._states[0], self._damping()
        read = np.concatenate([model.read(np.array(device.at))[:3] for device in self._scenario.device])
        seed = int(np.random.SeedSequence((self._scenario.seed, 2)).generate_state(1)[0])
        response = AmbientResponse(model, read, damping, self._ambient(), rate=self.rate, seed=seed)
        if crack:
            response.change(model, crack)
        slowest = float(np.min(damping * model.modes(len(damping)).omega))
        if _SETTLED / slowest > _LONGEST_SETTLING:
            raise ModelError(
                f"the rig's slowest mode decays in {1 / slowest:.3g} s: "
                f"expected {_LONGEST_SETTLING / _SETTLED:g} s or less"
            )
        for _ in range(round(_SETTLED / slowest / _CHUNK)):
            response.step(round(_CHUNK * self.rate))
        return response

    def _damping(self) -> FloatArray:
        """Return the damping (n_modes,) of the modes; with a crack, of those that the simulated rate resolves.

        Higher modes would appear at other frequencies. At a crack, one shape more has their flexibility. Bodies lower
        frequencies, so that modes are counted before all events.
        """
        damping = np.array(self._scenario.truth.damping)
        if not any(crack for _, crack in self._states):
            return damping
        resolved = self._states[0][0].modes(len(damping)).frequency < _HIGHEST * self.rate
        return damping[: max(int(np.count_nonzero(resolved)), 1)]

    def _ambient(self) -> Ambient:
        """Draw where the forces act: on every member, at each place across it in both directions."""
        random = np.random.default_rng((self._scenario.seed, 1))
        points: list[Vector] = []
        axes: list[int] = []
        for member in self._true.member:
            along = int(np.argmax(np.abs(np.subtract(member.end, member.start))))
            for share in random.uniform(0.1, 1.0, self._scenario.truth.forces_per_member):
                x, y, z = (float(value) for value in member.point(member.length * share))
                points += [(x, y, z)] * 2
                axes += [axis for axis in range(3) if axis != along]
        return Ambient(points=tuple(points), axes=tuple(axes), density=self._scenario.truth.force_density)

    def sample(self, time: int) -> float:
        """Return the simulated sample, whole and part, of a time [ns UTC]; the first requested time is the origin."""
        if self._origin is None:
            self._origin = time
        return LEAD + (time - self._origin) * 1e-9 * self.rate

    def begin(self, time: int) -> tuple[int, ...]:
        """Start the timeline at a time [ns UTC] and return the times of the events [ns UTC], to the simulated sample.

        Raises
        ------
        ValueError
            If an event would be before the time already simulated.
        """
        samples, begins = (
            [round(self.sample(time + round(at * 1e9))) for at in times]
            for times in ([event.at for event in self._events], self._begins)
        )
        if samples and samples[0] < self._n_simulated:
            raise ValueError(
                f"event at sample {samples[0]}: expected one from {self._n_simulated} on, the rest has passed"
            )
        self._changes = samples
        origin = self._origin or 0
        return tuple(origin + round((sample - LEAD) / self.rate * 1e9) for sample in begins)

    def keep_up(self, time: int) -> None:
        """Simulate until a time [ns UTC], whether or not motion is requested."""
        while self._n_simulated < self.sample(time):
            self._advance()

    def motion(self, first: int, last: int, device: int) -> FloatArray:
        """Return accelerations (last - first, 3) [m/s2] of a device, samples first .. last - 1.

        Raises
        ------
        ValueError
            If some of them are forgotten.
        """
        while self._n_simulated < last:
            self._advance()
        oldest = self._n_simulated // self._size - len(self._chunks)
        if first < oldest * self._size:
            raise ValueError(f"motion: expected samples from {oldest * self._size} on, found {first}")
        held = range(first // self._size, -(-last // self._size))
        motion = np.concatenate([self._chunks[n - oldest][:, 3 * device : 3 * device + 3] for n in held])
        return motion[first - held.start * self._size : last - held.start * self._size]

    def _advance(self) -> None:
        self._chunks.append(np.concatenate(list(self._pieces(self._n_simulated + self._size))))

    def _pieces(self, end: int) -> Iterator[FloatArray]:
        """Simulate to a sample, changing the structure at the very sample."""
        while self._changes and self._changes[0] < end:
            at = self._changes.pop(0)
            yield self._response.step(at - self._n_simulated) if at > self._n_simulated else self._nothing
            self._n_simulated = at
            self._response.change(*self._states[-1 - len(self._changes)])
        yield self._response.step(end - self._n_simulated)
        self._n_simulated = end

    @property
    def _nothing(self) -> FloatArray:
        return np.zeros((0, 3 * len(self._scenario.device)))

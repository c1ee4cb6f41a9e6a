"""Records of independent specimens at sensors and where there is none, with reference models learned beforehand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, Recording
from oma.spectral import aligned
from tests.examiner.cases import N_BEFORE, specimen
from tests.examiner.models.bar import vector
from tests.examiner.models.specimen import Sensor, State
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated, recorded
from updater import Reference, Structure, learn_reference
from updater.structure import Member
from updater.validation import Fibre, Point

_RMS = 0.01  # m/s2 of the signals
_BAND = 290.0  # Hz, recorded at 1 kHz
_N_MODES = 30  # that a record consists of
_SHARES = (0.23, 0.55, 0.87)  # of a member's length: where the truth is recorded

FRAME_SEED = 5  #: of the frame of most tests


@dataclass(frozen=True, eq=False, kw_only=True)
class UnmeasuredPoints:
    """A record of a specimen, and the truth at points without a sensor."""

    state: State
    reference: Reference
    points: tuple[Point | Fibre, ...]
    unit: FloatArray  #: (n_points,) recorded value of a unit of each signal
    rate: float  #: [Hz]

    def record(self, seconds: float, seed: int) -> tuple[Recording, FloatArray]:
        """Return the same as `raw_record`, with the delays of the devices removed."""
        record, truth = self.raw_record(seconds, seed)
        delays = dict(self.reference.delays.seconds)
        return aligned(record, {c.device: delays.get(c.device, 0.0) for c in record.channels}), truth

    def raw_record(self, seconds: float, seed: int) -> tuple[Recording, FloatArray]:
        """Return signals of the sensors, and the truth (n_samples, n_points) [m/s2] or [Pa].

        Parameters
        ----------
        seconds : of a record at 1 kHz; of slower specimens as many samples
        """
        n, random = len(self.state.channels) - len(self.points), np.random.default_rng((seed, 1))
        duration = 1000 * seconds / self.rate
        stresses = sum(isinstance(point, Fibre) for point in self.points)
        record = recorded(self.state, duration, random, rate=self.rate, n_displaced=stresses)
        sensors = replace(record, channels=record.channels[:n], data=record.data[:, :n])
        return sensors, record.data[:, n:] / self.unit


def modal_stress_of(state: State, member: Member, fibre: Fibre, n_modes: int) -> FloatArray:
    """Return the stress (n_modes,) of the specimen's modes: its modulus times the gradient of the motion along it."""
    bar, solved = state.frame.bar(member.name), state.frame.solved(n_modes)
    along = np.eye(3)[bar.axis]
    across = np.array(member.local_y or (np.eye(3)[1] if bar.axis == 2 else np.cross([0, 0, 1], along)))
    lever = fibre.y * across + fibre.z * np.cross(along, across)
    step = bar.size / 4
    ends = [solved.motion(bar.name, fibre.distance + k * step) for k in (-1, 1)]
    moved = [along @ (motion[:3] + np.cross(motion[3:].T, lever).T) for motion in ends]
    return np.asarray(bar.modulus * (moved[1] - moved[0]) / (2 * step))


def _fibre(structure: Structure, member: Member, share: float) -> Fibre:
    """Return a fibre 1.2 radii of gyration off both axes."""
    section = structure.section[member.section]
    y, z = (1.2 * (moment / section.area) ** 0.5 for moment in section.second_moment[::-1])
    return Fibre(member=member.name, distance=share * member.length, y=y, z=z)


def unmeasured_points(which: str, seed: int, fibres: Sequence[Fibre] = ()) -> UnmeasuredPoints:
    """Return a specimen ("frame", "portal", ...) with a learned reference, across all its members.

    Parameters
    ----------
    fibres : of which stresses are recorded. Default: one at each place
    """
    state, _ = specimen("" if which == "frame" else which, seed)
    random = np.random.default_rng((seed, 2))
    structure = structure_of(f"{which}: nothing")
    before = observation(state, estimated(state, N_BEFORE, random, noise="law"))
    reference = learn_reference(structure, before.estimates, before.tracks, before.lateness.delays)
    sensors: list[Sensor] = []
    points: list[Point | Fibre] = []
    for member in structure.member:
        along = np.subtract(member.end, member.start)
        for share in _SHARES:
            for axis in np.flatnonzero(np.abs(along) < 0.9 * member.length).tolist():
                x, y, z = np.add(member.start, share * along).tolist()
                points.append(Point(at=(x, y, z), axis=axis))
                name = f"{member.name} {share} {'xyz'[axis]}"
                sensors.append(
                    Sensor(
                        channel=name,
                        device="truth",
                        bar=member.name,
                        s=share * member.length,
                        direction=vector(np.eye(3)[axis]),
                    )
                )
    n, k = len(state.sensors), len(sensors)
    fibres = fibres or [_fibre(structure, member, share) for member in structure.member for share in _SHARES]
    sensors += [replace(sensors[0], channel=f"{fibre.name} x") for fibre in fibres]
    unit = np.ones(k + len(fibres))
    state = replace(
        state,
        sensors=(*state.sensors, *sensors),
        gain=np.r_[state.gain, np.ones(len(unit))],
        delay=np.r_[state.delay, np.zeros(len(unit))],
        order=np.r_[state.order, np.arange(n, n + len(unit))],
        solved={},
    )
    motion = state.motion(_N_MODES)
    members = {member.name: member for member in structure.member}
    for i, fibre in enumerate(fibres):
        stress = modal_stress_of(state, members[fibre.member], fibre, _N_MODES)
        unit[k + i] = (
            np.abs(motion.at_sensors[:, :n]).mean() / np.abs(stress / (2 * np.pi * motion.frequency) ** 2).mean()
        )
        motion.at_sensors[:, n + k + i] = unit[k + i] * stress
    rate = 1000 * state.scale.band / _BAND
    rms = recorded(state, 4000 / rate, random, rate=rate).data[:, :n].std()
    state = replace(state, loudness=state.loudness * _RMS / float(rms))
    state = replace(state, solved={_N_MODES: motion})
    return UnmeasuredPoints(state=state, reference=reference, points=(*points, *fibres), unit=unit, rate=rate)

"""Records of independent specimens at sensors and at points without one, with reference models learned beforehand."""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, Recording
from oma.spectral import aligned
from tests.examiner.cases import N_BEFORE, specimen
from tests.examiner.models.bar import vector
from tests.examiner.models.specimen import Sensor, State
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated, recorded
from updater import Reference, learn_reference
from updater.validation import Point

_RMS = 0.01  # m/s2 of the signals
_BAND = 290.0  # Hz, recorded at 1 kHz
_SHARES = (0.23, 0.55, 0.87)  # of a member's length: where the truth is recorded


@dataclass(frozen=True, eq=False, kw_only=True)
class UnmeasuredPoints:
    """A record of a specimen, and the truth at points without a sensor."""

    state: State
    reference: Reference
    points: tuple[Point, ...]
    rate: float  #: [Hz]

    def record(self, seconds: float, seed: int) -> tuple[Recording, FloatArray]:
        """Return signals of the sensors, device delays removed, and accelerations (n_samples, n_points) [m/s2].

        Parameters
        ----------
        seconds : of a record at 1 kHz; of slower specimens as many samples
        """
        n, random = len(self.state.channels) - len(self.points), np.random.default_rng((seed, 1))
        duration = 1000 * seconds / self.rate
        record = recorded(self.state, duration, random, rate=self.rate)
        sensors = replace(record, channels=record.channels[:n], data=record.data[:, :n])
        delays = dict(self.reference.delays.seconds)
        return aligned(sensors, {c.device: delays.get(c.device, 0.0) for c in sensors.channels}), record.data[:, n:]


def unmeasured_points(which: str, seed: int) -> UnmeasuredPoints:
    """Return a specimen ("frame", "portal", ...) with a learned reference, across all its members."""
    state, _ = specimen("" if which == "frame" else which, seed)
    random = np.random.default_rng((seed, 2))
    structure = structure_of(f"{which}: nothing")
    before = observation(state, estimated(state, N_BEFORE, random, noise="law"))
    reference = learn_reference(structure, before.estimates, before.tracks, before.lateness.delays)
    sensors, points = [], []
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
    state = replace(
        state,
        sensors=(*state.sensors, *sensors),
        gain=np.r_[state.gain, np.ones(k)],
        delay=np.r_[state.delay, np.zeros(k)],
        order=np.r_[state.order, np.arange(n, n + k)],
        solved={},
    )
    rate = 1000 * state.scale.band / _BAND
    rms = recorded(state, 4000 / rate, random, rate=rate).data[:, :n].std()
    state = replace(state, loudness=state.loudness * _RMS / float(rms))
    return UnmeasuredPoints(state=state, reference=reference, points=tuple(points), rate=rate)

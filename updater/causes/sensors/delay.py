"""A channel, or a device, that is late: its part of every mode turns by -2 pi f tau, and no frequency moves."""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.sensors.channel_fault import Chain, corrected, groups_of
from updater.inference import Comparison, Effect, Fit, no_effect, picked, predict, reanalyse, residual
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Structure

_STD = 2e-3  # s: filters of other settings, stations on a bus, clocks that are not disciplined
_FARTHEST = 0.01  # s, of the delays that a fit may begin at
_WORTH = 100.0  # chi-square that a fault must explain, so that several faults start with theirs together
_MAX_FAULTS = 8  # that are looked for so
_PHASE_STEP = 0.5  # rad of the highest mode between them: a fit finds its way within one


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorDelay(Chain):
    """Channels that are late together; the parameter is by how much [s]."""

    late: FloatArray  #: (n_alternatives, n_channels) 1 for the channels of each
    begin: FloatArray  #: (n_alternatives, 1) the best of many delays [s]
    name: str = "sensor_delay"
    advice: str = "Tap between the sensor and a sensor of another device: both channels must respond at the same time."

    @property
    def start(self) -> FloatArray:
        """At the best of many delays: phases repeat, so that a fit from none may end a period away."""
        return self.begin

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the channels' delays."""
        return replace(no_effect(len(rows), self.comparison), imaginary=theta[:, :1] * self.late[rows])

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return how much later than it was."""
        std = float(fit.covariance[fit.best, 0, 0] ** 0.5)
        return {"delay": Quantity(value=float(fit.theta[fit.best, 0]), std=std, unit="s")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the delay at the sensors."""
        return corrected(structure, self.channels[row], delay=float(theta[0]))


def propose_sensor_delay(reference: Reference, comparison: Comparison) -> SensorDelay | None:
    """Return every channel and every device; none where phases are not known."""
    if not comparison.phased.any():
        return None
    groups = groups_of(reference, comparison)
    late = np.array([[float(c in group) for c in comparison.channels] for group in groups])
    return SensorDelay(
        prior_std=np.array([_STD]),
        lower=np.full((len(groups), 1), -np.inf),
        comparison=comparison,
        channels=tuple(groups),
        late=late,
        begin=_search(comparison, late, np.ones(late.shape[1]), np.zeros(late.shape[1]))[0][:, None],
    )


def begin_at(reference: Reference, comparison: Comparison) -> tuple[FloatArray, FloatArray]:
    """Return gains (n_channels,) of 1, -1 or 0, and delays [s], to begin at where many channels are judged at once.

    One by one, the fault that explains most of the residual: a reversed or dead channel, a delayed channel or device.
    """
    n = len(comparison.channels)
    late = np.array([[float(c in group) for c in comparison.channels] for group in groups_of(reference, comparison)])
    sign, imaginary = np.ones(n), np.zeros(n)
    phased = comparison.phased.any()
    for _ in range(_MAX_FAULTS):
        delay, gained = _search(comparison, late, sign, imaginary) if phased else (np.zeros(0), np.zeros(0))
        other, better = _other_gain(comparison, sign, imaginary)
        most = gained.max(initial=0.0)
        if max(most, better) < _WORTH:
            break
        if better > most:
            sign = other
        else:
            imaginary = imaginary + delay[np.argmax(gained)] * late[np.argmax(gained)]
    return sign, imaginary


def _other_gain(comparison: Comparison, gain: FloatArray, imaginary: FloatArray) -> tuple[FloatArray, float]:
    """Return the gains (n_channels,) with the one channel turned or silent that explains most, and the chi-square."""
    one = np.eye(len(gain))
    tried = np.vstack([gain, gain * (1 - 2 * one), gain * (1 - one)])
    cost = _costs(comparison, np.broadcast_to(imaginary, tried.shape), tried)
    return tried[np.argmin(cost)], float(cost[0] - cost.min())


def _search(
    comparison: Comparison, late: FloatArray, sign: FloatArray, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the delay [s] of each alternative (n_alternatives,) that explains most, and the chi-square it gains.

    Parameters
    ----------
    late : (n_alternatives, n_channels) 1 for the channels of each
    sign, known : (n_channels,) -1 for channels that are turned; delays that come on top [s]
    """
    highest = float(comparison.frequency[comparison.paired].max())
    step = _PHASE_STEP / (2 * np.pi * highest)
    tried = step * np.arange(-round(_FARTHEST / step), round(_FARTHEST / step) + 1)
    imaginary = (known + late[:, None] * tried[:, None]).reshape(-1, len(sign))
    cost = _costs(comparison, imaginary, np.broadcast_to(sign, imaginary.shape)).reshape(-1, len(tried))
    cost = cost + (tried / _STD) ** 2
    best = np.argmin(cost, axis=1)
    return tried[best], cost[:, len(tried) // 2] - cost.min(axis=1)


def _costs(comparison: Comparison, imaginary: FloatArray, sign: FloatArray) -> FloatArray:
    """Return chi-squares (n,) of delays [s] and signs (n, n_channels) of the structure as it was."""
    n = len(imaginary)
    value, vector = picked(reanalyse(comparison, no_effect(1, comparison)))
    effect = no_effect(n, comparison)
    effect = replace(effect, imaginary=imaginary, chain=sign[:, :, None] * effect.chain)
    same = np.broadcast_to(value, (n, *value.shape[1:])), np.broadcast_to(vector, (n, *vector.shape[1:]))
    return np.asarray((residual(comparison, predict(comparison, *same, effect), comparison.plain) ** 2).sum(1))

"""A channel, or a device, that is late: its part of every mode turns by -2 pi f tau, and no frequency moves."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.chain import Chain, corrected, groups_of
from updater.comparison import Comparison, residual
from updater.reanalysis import Effect, no_effect, picked, predict, reanalyse
from updater.reference import Reference
from updater.structure import Structure
from updater.verdict import Quantity

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

_STD = 2e-3  # s: filters of other settings, stations on a bus, clocks that are not disciplined
_FARTHEST = 0.01  # s, of the delays that a fit may begin at
_WORTH = 100.0  # of chi-square: what a delay must explain for several to begin at theirs together
_PHASE_STEP = 0.5  # rad of the highest mode between them: a fit finds its way within one


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorDelay(Chain):
    """Channels that are late together; the parameter is by how much [s]."""

    late: FloatArray  #: (n_alternatives, n_channels) 1 for the channels of each
    begin: FloatArray  #: (n_alternatives, 1) the best of many delays [s]
    name: str = "sensor_delay"
    advice: str = "Tap beside the sensor and one of another device at once: the two channels must start together."

    @property
    def start(self) -> FloatArray:
        """At the best of many delays: phases repeat, so that a fit from none may end a period away."""
        return self.begin

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the channels' delays."""
        return replace(no_effect(len(rows), self.comparison), lag=theta[:, :1] * self.late[rows])

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
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
        drifting=False,
        comparison=comparison,
        channels=tuple(groups),
        late=late,
        begin=_search(comparison, late, np.ones(late.shape[1]))[0][:, None],
    )


def likely_delays(comparison: Comparison, sign: FloatArray) -> FloatArray:
    """Return the delay [s] of each channel (n_channels,) that by itself explains most; 0 where none explains much.

    Parameters
    ----------
    sign : (n_channels,) -1 for channels that are turned
    """
    found, gained = _search(comparison, np.eye(len(sign)), sign)
    return np.where(gained > _WORTH, found, 0.0)


def _search(comparison: Comparison, late: FloatArray, sign: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the delay [s] of each alternative (n_alternatives,) that explains most, and the chi-square it gains."""
    highest = float(comparison.frequency[comparison.paired].max())
    step = _PHASE_STEP / (2 * np.pi * highest)
    tried = step * np.arange(-round(_FARTHEST / step), round(_FARTHEST / step) + 1)
    value, vector = picked(reanalyse(comparison, no_effect(1, comparison)))
    cost = np.array([_costs(comparison, value, vector, row * tried[:, None], sign) for row in late])
    cost = cost + (tried / _STD) ** 2
    best = np.argmin(cost, axis=1)
    return tried[best], cost[:, len(tried) // 2] - cost.min(axis=1)


def _costs(
    comparison: Comparison, value: FloatArray, vector: FloatArray, lag: FloatArray, sign: FloatArray
) -> FloatArray:
    """Return chi-squares (n,) of delays (n, n_channels) of the structure as it was, channels of signs (n_channels,)."""
    n = len(lag)
    effect = no_effect(n, comparison)
    effect = replace(effect, lag=lag, chain=sign[:, None] * effect.chain)
    same = np.broadcast_to(value, (n, *value.shape[1:])), np.broadcast_to(vector, (n, *vector.shape[1:]))
    return np.asarray((residual(comparison, predict(comparison, *same, effect), comparison.plain) ** 2).sum(1))

"""The recorder's clock runs fast or slow: every frequency, and every tone, is misread by one factor.

A structure's changes leave tones alone (mains, machines), a clock's do not. Tones that moved together with the modes
speak for the clock, tones that stayed against it; a machine may also have changed its speed by itself.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.overall.common_factor import COMMON_FACTOR_STD, CommonFactor
from updater.inference import Comparison, Fit
from updater.quantities import Quantity
from updater.reference import Reference
from updater.structure import Recorder, Structure

_STEADY = 5e-4  # of ln f: how far a mains tone wanders
_RESTLESS = 0.1  # probability that a tone has moved by itself
_FREE = 0.05  # of ln f: how far it then may be


@dataclass(frozen=True, eq=False, kw_only=True)
class SamplingClock(CommonFactor):
    """Frequencies are read by a factor off."""

    log_tones: float  #: log likelihood of the tones, if it is the clock, over that if it is not
    name: str = "sampling_clock"
    instrument: str = "A tone of known frequency in both records"
    advice: str = "Record a tone of known frequency (mains, a tuning fork) during the next log."

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log evidence of the tones."""
        del covariance, rows
        return np.full(len(theta), self.log_tones)

    def reading(self, theta: FloatArray) -> float:
        """Return the factor over the error of a tone."""
        return float(self.log_factor(theta)) / _STEADY

    def parameters(self, fit: Fit[Cause]) -> dict[str, Quantity]:
        """Return the error of the clock: indicated over true frequencies, less one."""
        value, std = self.found(fit)
        factor = float(np.exp(value))
        return {"error": Quantity(value=factor - 1, std=factor * std, unit="-")}

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Write the clock's factor at the recorder."""
        del row
        old = structure.recorder.clock if structure.recorder else 1.0
        recorder = Recorder(clock=old * float(np.exp(self.log_factor(theta))))
        return structure.model_copy(update={"recorder": recorder})


def propose_sampling_clock(reference: Reference, comparison: Comparison) -> SamplingClock:
    """Return the single alternative, determined by tones if there are any."""
    del reference
    tones = comparison.circumstances.tones
    centre, spread, log_tones = 0.0, COMMON_FACTOR_STD, 0.0
    if len(tones):
        # the factor that most tones agree on, none being one of the candidates
        candidates = np.append(tones, 0.0)
        agreed = candidates[int(np.argmax([_log_likelihood(tones, c) for c in candidates]))]
        steady = tones[np.abs(tones - agreed) < 3 * _STEADY]
        precision = COMMON_FACTOR_STD**-2.0 + len(steady) * _STEADY**-2.0
        centre, spread = float(steady.sum() * _STEADY**-2.0 / precision), precision**-0.5
        # Laplace: the likelihood at its peak, times the prior there, times the width
        log_prior = -0.5 * (centre / COMMON_FACTOR_STD) ** 2 + np.log(spread / COMMON_FACTOR_STD)
        log_tones = _log_likelihood(tones, centre) - _log_likelihood(tones, 0.0) + float(log_prior)
    return SamplingClock(comparison=comparison, centre=centre, spread=spread, log_tones=log_tones)


def _log_likelihood(tones: FloatArray, factor: float) -> float:
    """Return the log likelihood of log ratios of tones, each of which may have moved by itself."""
    steady = (1 - _RESTLESS) / _STEADY * np.exp(-0.5 * ((tones - factor) / _STEADY) ** 2)
    free = _RESTLESS / _FREE * np.exp(-0.5 * (tones / _FREE) ** 2)
    return float(np.log(steady + free).sum())

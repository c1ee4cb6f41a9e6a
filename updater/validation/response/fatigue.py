"""Fatigue by the vibration: rainflow counts of stress ranges, and the S-N curves of Eurocode 3.

References
----------
ASTM E1049-85 (2011). Standard practices for cycle counting in fatigue analysis, s. 5.4.4.
EN 1993-1-9 (2005). Design of steel structures: fatigue, s. 7.1 (direct stresses, figure 7.1).
Palmgren, A. (1924); Miner, M. A. (1945). Cumulative damage in fatigue. J. Appl. Mech. 12, A159-A164.
"""

from dataclasses import dataclass

import numpy as np
from rainflow import extract_cycles

from daq import FloatArray
from oma.preparation import gapless_stretches

_AT_CATEGORY, _AT_KNEE, _AT_CUTOFF = 2e6, 5e6, 1e8  # cycles to failure
_SLOPE, _BELOW_KNEE = 3, 5


@dataclass(frozen=True, eq=False, kw_only=True)
class StressCycles:
    """Cycles of a stress in some time."""

    ranges: FloatArray  #: (n,) from valley to peak [Pa]
    counts: FloatArray  #: (n,) 1 for a cycle, 0.5 for a half cycle
    seconds: float  #: time in which they were counted [s]

    def __add__(self, other: "StressCycles") -> "StressCycles":
        """Return the cycles of two records."""
        return StressCycles(
            ranges=np.concatenate([self.ranges, other.ranges]),
            counts=np.concatenate([self.counts, other.counts]),
            seconds=self.seconds + other.seconds,
        )

    @property
    def largest(self) -> float:
        """Largest range [Pa]."""
        return float(self.ranges.max(initial=0.0))

    @property
    def rate(self) -> float:
        """Number of cycles per second [Hz]."""
        return float(self.counts.sum()) / self.seconds if self.seconds else 0.0

    def equivalent_range(self, slope: int = _BELOW_KNEE) -> float:
        """Return the constant range that has the same damage in as many cycles, by an S-N curve of one slope [Pa]."""
        total = float(self.counts.sum())
        return float((self.counts @ self.ranges**slope / total) ** (1 / slope)) if total else 0.0


def count_cycles(stress: FloatArray, rate: float) -> StressCycles:
    """Count the cycles of a stress (n_samples,) [Pa] at a rate [Hz], of each stretch between NaN by itself."""
    found, samples = [], 0
    for start, stop in gapless_stretches(stress[:, None]):
        part = stress[start:stop]
        turning = np.flatnonzero(np.diff(np.sign(np.diff(part)))) + 1
        reversals = part[np.r_[0, turning, len(part) - 1]]
        found += [(size, count) for size, _, count, _, _ in extract_cycles(reversals.tolist())]
        samples += stop - start
    ranges, counts = np.array(found).reshape(-1, 2).T
    return StressCycles(ranges=ranges, counts=counts, seconds=samples / rate)


def damage_rate(cycles: StressCycles, category: float, factor: float = 1.0) -> float:
    """Return the damage per second; failure is expected at a damage of 1 (Palmgren-Miner) [1/s].

    Parameters
    ----------
    cycles : of the nominal stress
    category : of the detail, its reference range at 2 million cycles, such as 71e6 [Pa]
    factor : on the ranges, such as that of a stress concentration or of partial factors [-]
    """
    knee = category * (_AT_CATEGORY / _AT_KNEE) ** (1 / _SLOPE)
    cutoff = knee * (_AT_KNEE / _AT_CUTOFF) ** (1 / _BELOW_KNEE)
    ranges = factor * cycles.ranges
    steep = (ranges / knee) ** _SLOPE
    flat = np.where(ranges >= cutoff, (ranges / knee) ** _BELOW_KNEE, 0.0)
    damage = float(cycles.counts @ np.where(ranges >= knee, steep, flat)) / _AT_KNEE
    return damage / cycles.seconds if damage else 0.0

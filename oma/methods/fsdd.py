"""Frequency-spatial domain decomposition: a bell fitted to the spectrum that a mode's shape filters out.

References
----------
Zhang, L., Wang, T., Tamura, Y. (2010). A frequency-spatial domain decomposition (FSDD) method for operational modal
analysis. Mechanical Systems and Signal Processing 24(5), 1227-1239.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from oma.methods.fdd import FDD, Reading, read_bell
from oma.spectral import Decomposition, SpectralResonance


@dataclass(frozen=True, kw_only=True)
class FSDD(FDD):
    """FSDD; where the paper fits a line to the inverse of the spectrum, this takes the most likely bell."""

    name: ClassVar[str] = "fsdd"

    def read(self, parts: Decomposition, one: SpectralResonance, others: Sequence[SpectralResonance]) -> Reading:
        """Return frequency and damping from the bell."""
        return read_bell(parts, one, others)

"""Accepted change: provenance, frequency shifts, and the windows of the new reference."""

from dataclasses import dataclass

import numpy as np

from daq import IndexArray
from monitor.analysis.window import Window
from monitor.detection import Shift
from monitor.results.windows import AcceptedShift


@dataclass(frozen=True, eq=False, kw_only=True)
class AcceptedChange:
    """One accepted change of the structure."""

    time: int  #: when it became the reference [ns UTC]
    raised: int  #: when the alarm was [ns UTC]
    cause: str  #: cause in a person's words
    by: str
    found: str  #: text of the diagnosis
    structure: str  #: text of the structure with the found causes; empty: as before
    windows: tuple[Window, ...]  #: windows of the changed structure, from which the reference is learned
    shift: Shift  #: shift of the frequencies relative to the expected ones; NaN for modes that the change hides

    @property
    def hides(self) -> IndexArray:
        """Return the tracks that are not watched, since no window of the change shows them."""
        return np.flatnonzero(np.isnan(self.shift.log_frequency))

    @property
    def result(self) -> AcceptedShift:
        """Return the change as it is written to the log."""
        return AcceptedShift(
            time=self.time,
            raised=self.raised,
            cause=self.cause,
            by=self.by,
            found=self.found,
            n_windows=len(self.windows),
            shift_percent=[_finite(value) for value in 100 * np.expm1(self.shift.log_frequency)],
            shift_std_percent=[_finite(value) for value in 100 * self.shift.std],
        )


@dataclass(frozen=True, kw_only=True)
class AcceptanceRequest:
    """An acceptance that waits for windows of the changed structure."""

    cause: str
    by: str


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

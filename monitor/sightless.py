"""Windows that say nothing of the structure: a few in a row, and the watch is blind, though data flow."""

import math
from dataclasses import dataclass

from monitor.results import WindowResult

MOST = 3  #: windows in a row from which on it is


@dataclass(frozen=True)
class Sight:
    """Number of consecutive windows without a usable result, and the reason of the last one."""

    dark: int = 0
    why: str = ""

    def after(self, window: WindowResult) -> "Sight":
        """Return the same after one more window."""
        why = _why(window)
        return Sight(self.dark + 1, why) if why else Sight()

    @property
    def blind(self) -> str | None:
        """Text to be reported; None while all is well."""
        return f"no usable result from the last {self.dark} windows: {self.why}" if self.dark >= MOST else None


def _why(window: WindowResult) -> str:
    """Return why a window says nothing, or nothing."""
    if window.problem:
        return window.problem
    judged = window.phase == "learning" or (window.novelty is not None and math.isfinite(window.novelty.t2))
    return "" if judged else "no watched mode was identified"

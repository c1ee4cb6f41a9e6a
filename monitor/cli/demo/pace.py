"""Pace of an accelerated rig: as fast as the analysis of its monitor."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from daq import ScaledClock
from daq.timing import SharedTime
from monitor.results.windows import Result, WindowResult

_AHEAD = 2.0  # windows that the rig may be ahead of the analysis
_LONGEST = 60.0  # s of wall time that it waits for one result


class Pace:
    """Holds the world of a rig while the analysis is behind: no window is left out, whatever the machine.

    Parameters
    ----------
    clock : fields of the rig's clock, as it reports them
    window : length of a window [s]
    """

    def __init__(self, clock: Mapping[str, Any], window: float) -> None:
        self._clock, self._most = ScaledClock(**clock), _AHEAD * window
        self._world = SharedTime(Path(clock["shared"])) if clock["shared"] else None  # none in real time

    def keep(self, result: Result) -> None:
        """Hold the world after a result that is late, else let it go on."""
        if self._world is not None and isinstance(result, WindowResult):
            behind = (self._clock.now() - result.end) * 1e-9 > self._most
            self._world.hold(_LONGEST if behind else 0.0)

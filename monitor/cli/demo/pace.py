"""Pace of an accelerated rig: as fast as the analysis of its monitor."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
        self._most = round(_AHEAD * window * 1e9)
        self._world = SharedTime(Path(clock["shared"])) if clock["shared"] else None  # none in real time

    def keep(self, result: Result) -> None:
        """Let the world go on to some windows after a result, and hold it there until the next one."""
        if self._world is not None and isinstance(result, WindowResult):
            self._world.hold(_LONGEST, at=result.end + self._most)

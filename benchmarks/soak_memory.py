"""Whether the memory of the monitor's processes is flat: what a soak's last hour shows of it."""

from dataclasses import dataclass, field

import numpy as np
from soak_rig import CYCLE

HOUR = 3600.0  # s: the last one of a soak, in which no process is ended, is the one that is judged
_SETTLED = CYCLE  # s of a process's life before that: everything is loaded and has run once, and rings are full
# MB/h. The hour has 72 faults: with one a day, 2 MB/h are 10 MB a year. Less it cannot tell, as the lows scatter by
# some tenths of a megabyte; those of analysis and view, which take and give back much with each window, by megabytes.
# What grows with time or windows, and not with faults, is to be looked at faster than they come: docs/soak.md.
MOST = {"monitor": 2.0, "pages": 2.0, "analysis": 10.0, "view": 10.0}


@dataclass
class Process:
    """Memory of one process, as it was looked at."""

    role: str
    times: list[float] = field(default_factory=list)  #: since the monitor's start [s]
    rss: list[float] = field(default_factory=list)  #: [MB]

    def growth(self) -> tuple[float, float] | None:
        """Return the slope of the lowest memory in each cycle of the last hour, and its standard deviation [MB/h].

        What comes and goes within a cycle - files, windows, what waits while a fault lasts - does not count, what
        stays does. None if the process has not lived that long.
        """
        lows = self.lows()
        if lows is None:
            return None
        hours = np.arange(len(lows)) * CYCLE / HOUR
        (slope, _), covariance = np.polyfit(hours, lows, 1, cov=True)
        return float(slope), float(np.sqrt(covariance[0, 0]))

    def lows(self) -> np.ndarray | None:
        """Return the lowest memory in each cycle of the last hour [MB]; None if it has not lived that long."""
        times, rss = np.array(self.times), np.array(self.rss)
        begin = times[-1] - HOUR
        if times[0] + _SETTLED > begin:
            return None
        number = ((times - begin) // CYCLE).astype(int)
        return np.array([rss[number == k].min() for k in range(round(HOUR / CYCLE))])


def judged(processes: list[Process]) -> tuple[list[str], bool | None]:
    """Return a row a process that lived through the last hour, and whether all are flat; None if the first did not."""
    if processes[0].lows() is None:
        return [], None
    rows, flat = [], set()
    for process in processes:
        growth, lows = process.growth(), process.lows()
        if growth is None or lows is None:
            continue
        slope, deviation = growth
        if slope <= MOST[process.role]:
            flat.add(process.role)
        told = ", ".join(f"{low:.1f}" for low in lows)
        rows.append(f"| {process.role} | {told} | {slope:+.2f} ± {deviation:.2f} | {MOST[process.role]:g} |")
    return rows, flat == set(MOST)

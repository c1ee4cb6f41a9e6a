"""Growth of the memory of the monitor's processes in the last hour of a soak."""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.monitor.soak.rig import CYCLE

BLOCKS, HEAP = "blocks of Python in use [1000]", "heap in use"  # of the monitor
HOUR = 3600.0  # s: the last one of a soak, in which no process is ended, is the one that is judged
_SETTLED = CYCLE  # s of a process's life before that: everything is loaded and has run once, and rings are full
# MB/h. The hour has 72 faults: with one a day, 2 MB/h are 10 MB a year. Less it cannot tell, as the lows scatter by
# some tenths of a megabyte; those of analysis and view, which take and give back much with each window, by megabytes.
# What grows with time or windows, and not with faults, is to be looked at faster than they come: the documentation.
# What the monitor has in use, as it says itself, is known to a hundredth of that: a leak shows there first, and what
# allocators keep between what is in use does not.
MAX = {"monitor": 2.0, "pages": 2.0, "analysis": 10.0, "view": 10.0, BLOCKS: 5.0, HEAP: 0.5}


@dataclass
class Series:
    """Memory of one kind, as it was looked at."""

    kind: str  #: role of the process it is of, or `BLOCKS` or `HEAP`
    times: list[float] = field(default_factory=list)  #: since the monitor's start [s]
    values: list[float] = field(default_factory=list)  #: [MB], or thousands of blocks

    def note(self, time: float, value: float) -> None:
        """Take one look."""
        self.times.append(time)
        self.values.append(value)

    def growth(self) -> tuple[float, float] | None:
        """Return the slope of the lowest memory in each cycle of the last hour, and its standard deviation [1/h].

        Temporary memory of a cycle - files, windows, queues during a fault - does not count, lasting memory does. None
        if the process has not run that long.
        """
        lows = self.lows()
        if lows is None:
            return None
        hours = np.arange(len(lows)) * CYCLE / HOUR
        (slope, _), covariance = np.polyfit(hours, lows, 1, cov=True)
        return float(slope), float(np.sqrt(covariance[0, 0]))

    def lows(self) -> np.ndarray | None:
        """Return the lowest memory in each cycle of the last hour; None if it has not lived that long."""
        if not self.times:
            return None
        times, values = np.array(self.times), np.array(self.values)
        begin = times[-1] - HOUR
        if times[0] + _SETTLED > begin:
            return None
        number = ((times - begin) // CYCLE).astype(int)
        return np.array([values[number == k].min() for k in range(round(HOUR / CYCLE))])


def judged(seen: list[Series]) -> tuple[list[str], bool | None]:
    """Return a row for each process of the whole last hour, and whether all are flat; None without the first."""
    if seen[0].lows() is None:
        return [], None
    rows: list[str] = []
    judged_so: dict[str, bool] = {}
    for series in seen:
        growth, lows = series.growth(), series.lows()
        if growth is None or lows is None:
            continue
        slope, deviation = growth
        judged_so[series.kind] = judged_so.get(series.kind, True) and slope <= MAX[series.kind]
        stated = ", ".join(f"{low:.1f}" for low in lows)
        rows.append(f"| {series.kind} | {stated} | {slope:+.2f} ± {deviation:.2f} | {MAX[series.kind]:g} |")
    return rows, set(judged_so) == set(MAX) and all(judged_so.values())

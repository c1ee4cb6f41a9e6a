"""Residuals of channels predicted from the others: false exceedances, time until a change is visible, and cost.

Rigs are drawn as in the demo, each with a clock, a gain and a delay of arrival of its own per device. Windows of 40 s
before the change are of the baseline, those after it are changed.

    python benchmarks/monitor/live/residuals.py [--changes 9] [--hours 1] [--seed 101]
"""

import time

import numpy as np

from benchmarks.monitor.live.rigs import options, rigs_with_a_change
from daq import FloatArray
from monitor.results.windows import WindowResult
from monitor.rig import Scenario, draw_t_frame
from monitor.watch.live.residuals import LIMIT, ResidualMonitor
from tests.support.monitor.rig import ORIGIN, rig_blocks, rig_settings

_WINDOW, _BASELINE = 40.0, 12
_CHANGE, _AFTER = 590.3, 40.0  # s
_LIMITS = (4.0, 5.0, LIMIT, 7.0)


def deviations(scenario: Scenario, seconds: float, change: float) -> tuple[FloatArray, FloatArray, float]:
    """Return the times (n,) of the blocks' ends [s], the deviations (n, n_channels), and the cost [cores]."""
    monitor = ResidualMonitor(rig_settings(scenario, window=_WINDOW, baseline_windows=_BASELINE))
    times, values, spent, index = [], [], 0.0, 0
    for block in rig_blocks(scenario, seconds):
        begun = time.process_time()
        for residuals in monitor.push(block):
            times.append((residuals.time - ORIGIN) * 1e-9)
            values.append(list(residuals.deviation.values()))
        end = (index + 1) * _WINDOW
        if block.arrival_time > ORIGIN + round((end + 2) * 1e9):
            start, stop = (ORIGIN + round((index + k) * _WINDOW * 1e9) for k in (0, 1))
            phase = "learning" if end < change else "alarm"
            fields = {"index": index, "start": start, "end": stop, "phase": phase, "channels": [], "modes": []}
            monitor.take(WindowResult.model_validate(fields))
            index += 1
        spent += time.process_time() - begun
    return np.array(times), np.array(values), spent / seconds


def main() -> None:
    """Print a line per rig with a change, and one of the quiet rig."""
    a = options()
    print("| seed | mass g | visible after s | median deviation after | largest before | cost % of a core |")
    print("|---" * 6 + "|", flush=True)
    for seed, scenario, mass in rigs_with_a_change(a.seed, a.changes, _CHANGE):
        at, deviation, cost = deviations(scenario, _CHANGE + _AFTER, _CHANGE)
        largest = deviation.max(1)
        over = at[(largest > LIMIT) & (at > _CHANGE)]
        print(
            f"| {seed} | {1000 * mass:.0f} | {over[0] - _CHANGE if len(over) else np.nan:.1f} "
            f"| {np.median(largest[at > _CHANGE + 2]):.1f} | {largest[at < _CHANGE].max():.1f} | {100 * cost:.2f} |",
            flush=True,
        )
    if a.hours:
        quiet = draw_t_frame("t_structure", a.seed, duration=0, between=None)
        at, deviation, cost = deviations(quiet, 3600 * a.hours, np.inf)
        counts = ", ".join(f"{int((deviation.max(1) > limit).sum())} over {limit:g}" for limit in _LIMITS)
        span = (at[-1] - at[0]) / 3600
        print(f"quiet, seed {a.seed}: {len(at)} blocks in {span:.2f} h, largest {deviation.max():.2f}: {counts}")


if __name__ == "__main__":
    main()

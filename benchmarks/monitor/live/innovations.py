"""Innovations of the modes: false exceedances, time until a change is visible, and cost.

Rigs are drawn as in the demo, each with a clock, a gain and a delay of arrival of its own per device. The whole
analysis runs: windows are identified, and the reference is learned.

    python benchmarks/monitor/live/innovations.py [--changes 9] [--hours 1] [--seed 101]
"""

import time

import numpy as np

from benchmarks.monitor.live.rigs import options, rigs_with_a_change
from daq import FloatArray
from monitor.rig import Scenario, draw_t_frame
from monitor.watch.live.innovations import LIMIT, InnovationMonitor
from monitor.watch.pipeline import Pipeline
from tests.support.monitor.rig import ORIGIN, rig_blocks, rig_settings, t_frame

_WINDOW, _BASELINE = 20.0, 8
_CHANGE, _AFTER = 740.3, 30.0  # s
_LIMITS = (4.0, 5.0, LIMIT, 7.0)


def deviations(scenario: Scenario, seconds: float) -> tuple[FloatArray, FloatArray, float]:
    """Return the times (n,) of the blocks' ends [s], the largest deviations (n,), and the cost [cores]."""
    settings = rig_settings(scenario, window=_WINDOW, baseline_windows=_BASELINE)
    pipeline = Pipeline(t_frame(), settings)
    monitor = InnovationMonitor(settings, lambda: pipeline.reference)
    times, values, spent = [], [], 0.0
    for block in rig_blocks(scenario, seconds):
        begun = time.process_time()
        for found in monitor.push(block):
            times.append((found.time - ORIGIN) * 1e-9)
            values.append(found.largest[0])
        spent += time.process_time() - begun
        for result in pipeline.push(block):
            begun = time.process_time()
            monitor.take(result)
            spent += time.process_time() - begun
    return np.array(times), np.array(values), spent / seconds


def main() -> None:
    """Print a line per rig with a change, and one of the quiet rig."""
    a = options()
    print("| seed | mass g | visible after s | median deviation after | largest before | blocks | cost % of a core |")
    print("|---" * 7 + "|", flush=True)
    for seed, scenario, mass in rigs_with_a_change(a.seed, a.changes, _CHANGE):
        at, largest, cost = deviations(scenario, _CHANGE + _AFTER)
        before, over = at < _CHANGE, at[(largest > LIMIT) & (at > _CHANGE)]
        print(
            f"| {seed} | {1000 * mass:.0f} | {over[0] - _CHANGE if len(over) else np.nan:.1f} "
            f"| {np.median(largest[at > _CHANGE + 1]):.1f} | {largest[before].max():.1f} | {before.sum()} "
            f"| {100 * cost:.2f} |",
            flush=True,
        )
    if a.hours:
        quiet = draw_t_frame("t_structure", a.seed, duration=0, between=None)
        at, largest, _ = deviations(quiet, 3600 * a.hours)
        counts = ", ".join(f"{int((largest > limit).sum())} over {limit:g}" for limit in _LIMITS)
        span = (at[-1] - at[0]) / 3600
        print(f"quiet, seed {a.seed}: {len(at)} blocks in {span:.2f} h, largest {largest.max():.2f}: {counts}")


if __name__ == "__main__":
    main()

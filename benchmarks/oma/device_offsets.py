"""Accuracy of constant delays between devices from the phases of modes, and coverage of their deviations.

Arrival times do not show the least delay of a device. A frame of another finite element code than ours
(tests/examiner/models/frame.py), drawn at random each time, is recorded for ten minutes by six devices with time errors
that are normal draws of 1 ms, and further normal draws in each window, as clocks that are fitted to arrivals wander.
The record goes through `import`, windows, identification, `oma.device_delays` and `updater.learn_delays` as a baseline
does. Only differences of delays are determined: all are less their mean. Stated is their deviation as reported; held:
the number of errors within 1.96 of it.

Usage: python benchmarks/oma/device_offsets.py [DRAWS] [SEED], or make bench-device-offsets
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from daq import FloatArray, load_recordings, write_recording
from monitor.analysis.observation import observe, window_seconds
from tests.examiner.models.specimen import draw_state
from tests.examiner.path import FRAME
from tests.examiner.signals import joined, recorded

DRAWS, SEED = 12, 9000
SPREAD = 1e-3  # s rms between devices
LINES = ((120.0, 0.0), (600.0, 0.0), (600.0, 5e-5))  # length of the record, wander rms [s]


def offsets(seed: int, seconds: float, wander: float) -> tuple[FloatArray, FloatArray]:
    """Return errors of the offsets (n_devices,) and their stated deviations [s]."""
    state = draw_state(seed)
    devices = [sensor.device for sensor in state.sensors]
    names = sorted(set(devices))
    random = np.random.default_rng((seed, 12))
    drawn = dict(zip(names, SPREAD * random.standard_normal(len(names)), strict=True))
    late = state.delay + np.array([drawn[device] for device in devices])
    window = window_seconds(FRAME, seconds)
    parts = []
    for _ in range(round(seconds / window)):
        strays = dict(zip(names, wander * random.standard_normal(len(names)), strict=True))
        stray = np.array([strays[device] for device in devices])
        parts.append(recorded(replace(state, delay=late + stray), window, random))
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        write_recording(log, joined(parts))
        found = observe(load_recordings(log, window_seconds=window)).lateness.delays
    true = np.array([late[devices.index(name)] for name in names])
    seen = np.array([found.seconds[name] for name in names])
    return seen - seen.mean() - (true - true.mean()), np.array([found.std[name] for name in names])


def main() -> None:
    """Print the table."""
    draws, seed = (int(word) for word in (*sys.argv[1:3], *(str(DRAWS), str(SEED))[len(sys.argv[1:3]) :]))
    print("| record [s] | wander [us rms] | draws | error [us rms] | greatest [us] | stated [us rms] | held |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for seconds, wander in LINES:
        found = [offsets(seed + k, seconds, wander) for k in range(draws)]
        error, std = (np.array(part) for part in zip(*found, strict=True))
        held = np.mean(np.abs(error) <= 1.96 * std)
        rms, stated = (1e6 * np.sqrt(np.mean(part**2)) for part in (error, std))
        row = f"| {seconds:g} | {1e6 * wander:g} | {draws} | {rms:.1f} | {1e6 * np.abs(error).max():.1f} |"
        print(f"{row} {stated:.1f} | {100 * held:.0f} % |")


if __name__ == "__main__":
    main()

"""Delays that the rig puts into its devices are the ones that a baseline finds."""

import numpy as np

from daq import Channel, Recording
from daq.drivers import EPSON_SCALE
from monitor.rig import T_DEVICES, make_sources
from monitor.watch.baseline.learned_baseline import learn_tracked_reference
from oma import identify_all
from tests.support.monitor.rig import ORIGIN, nominal, t_frame

LATE = {"col_111": 0.15e-3, "beam_left": 3.4e-3, "beam_right": 2.9e-3}  # s; two are most of a period of the 270 Hz mode
RATE, SECONDS, N_WINDOWS = 1000.0, 40, 3
CHANNELS = tuple(
    Channel(name=f"{name}_{axis}", device=name, axis="xyz".index(axis))
    for name, (_, axes) in T_DEVICES.items()
    for axis in axes
)


def windows(seed: int) -> list[Recording]:
    """Return the measurements of devices of one clock on a frame, those of LATE later than the others."""
    scenario = nominal(seed)
    devices = tuple(d.model_copy(update={"delay": LATE.get(d.name, 0.0)}) for d in scenario.device)
    _, sources = make_sources(t_frame(), scenario.model_copy(update={"device": devices}))
    for source in sources:
        source.start(ORIGIN, RATE)
    n, found = round(SECONDS * RATE), []
    for k in range(N_WINDOWS):
        scans: dict[str, list[np.ndarray]] = {name: [] for name in T_DEVICES}
        for second in range(SECONDS):  # in step, as the world keeps some seconds only
            for name, source in zip(T_DEVICES, sources, strict=True):
                scans[name].append(source.read(k * n + second * 1000, 1000) * EPSON_SCALE)
        data = np.column_stack([np.concatenate(scans[c.device])[:, c.axis] for c in CHANNELS])
        found.append(Recording(channels=CHANNELS, data=data, rate=RATE, start=ORIGIN + k * n * 10**6))
    return found


def test_baseline_estimates_the_delays_of_devices() -> None:
    """Within four of the stated deviations and 5 us: half a degree at 271 Hz, the complexity of shapes by damping."""
    found = [identify_all(recording) for recording in windows(11)]
    tracker, reference = learn_tracked_reference(t_frame(), found, {c.name: c.device for c in CHANNELS})
    delays = reference.delays
    late = np.array([LATE.get(name, 0.0) for name in delays.seconds])
    learnt = np.array(list(delays.seconds.values()))
    std = np.array(list(delays.std.values()))
    assert len(late) == len(T_DEVICES)
    off = (learnt - learnt.mean()) - (late - late.mean())
    assert np.all(np.abs(off) < 4 * std + 5e-6), off
    assert len(tracker.reference.frequency) >= 7

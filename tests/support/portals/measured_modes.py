"""Windows of a portal's modes with the noise of an identification, without signals."""

import numpy as np

from daq import FloatArray
from monitor.analysis.observation import Observation, follow
from oma import ModalEstimate, WindowQuality
from oma.selection import uncertainty_law
from oma.windows import Windows
from tests.support.portals.tube_portal import Portal

SECONDS, DAMPING, SHAPE_STD, N_MODES = 100.0, 0.004, 0.003, 12
START = 1_767_225_600_000_000_000


def observed(
    portal: Portal,
    frequency: FloatArray,
    shape: FloatArray,
    first: int,
    random: np.random.Generator,
    seconds: float = SECONDS,
) -> Observation:
    """Return five windows of the modes of lowest frequency that move the sensors."""
    moves = np.linalg.norm(shape, axis=0)
    seen = np.flatnonzero(moves[:N_MODES] > 0.05 * np.median(moves[:N_MODES]))
    f, exact, channels = frequency[seen], (shape[:, seen] / moves[seen]).T, tuple(portal.sensors())
    std, damping_std = np.array([uncertainty_law(each, DAMPING, seconds) for each in f]).T
    estimates = []
    for window in range(first, first + 5):
        noise = random.standard_normal((2, *exact.shape))
        found = exact + SHAPE_STD * (noise[0] + 1j * noise[1])
        found = found * np.exp(-0.5j * np.angle((found**2).sum(1)))[:, None]
        start = START + round(window * seconds * 1e9)
        estimates.append(
            ModalEstimate(
                channels=channels,
                frequency=f + std * random.standard_normal(len(f)),
                frequency_std=std,
                damping=np.maximum(DAMPING + damping_std * random.standard_normal(len(f)), 1e-4),
                damping_std=damping_std,
                shape=found / np.linalg.norm(found, axis=1, keepdims=True),
                shape_std=np.full(exact.shape, SHAPE_STD),
                support=np.ones(len(f)),
                law_ratio=np.ones(len(f)),
                start=start,
                end=start + round(seconds * 1e9),
            )
        )
    windows = Windows(
        estimates=tuple(estimates),
        harmonics=np.empty(0),
        channels=dict.fromkeys(channels, "ok"),
        quality=(WindowQuality(complete=1.0, rms_variation=0.0, cycles=1000.0),) * len(estimates),
        problems=(),
        start=estimates[0].start,
        end=estimates[-1].end,
        rate=1000.0,
    )
    return follow(windows, dict.fromkeys(channels, "daq"), [(e.start, float("nan"), 0.01) for e in estimates])

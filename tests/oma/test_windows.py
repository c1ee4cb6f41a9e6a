"""Windows that are overwritten give the same modes and faults; read-only ones stay as they are."""

from dataclasses import replace

import numpy as np

from daq import Recording
from oma.windows import identify_windows
from tests.support.oma.structures import chain, simulate

CHAIN = chain(6)


def faulty(seed: int) -> Recording:
    """Return a recording with a late device, spikes, a gap and a channel without signal."""
    random, recording = np.random.default_rng(seed), simulate(CHAIN, 200.0, 400.0, seed=seed)
    data = recording.data.copy()
    data[:, 1] = np.roll(data[:, 1], 3)  # 7.5 ms
    spikes = random.integers(100, len(data) - 100, 8)
    data[spikes, 2] += 60 * data[:, 2].std()
    data[5000:5004, 3] = np.nan
    data[:, 4] = 0.0
    channels = tuple(replace(channel, device=f"d{k}") for k, channel in enumerate(recording.channels))
    return replace(recording, channels=channels, data=data)


def test_overwritten_windows_give_the_same_modes_and_faults() -> None:
    kept = identify_windows([faulty(3), faulty(4)])
    window = faulty(3)
    measured = window.data.copy()
    overwritten = identify_windows([window, faulty(4)], overwrite=True)
    assert not np.array_equal(window.data, measured, equal_nan=True)
    assert kept.channels == overwritten.channels
    assert {name for name, state in kept.channels.items() if state != "ok"} >= {CHAIN.channels[2], CHAIN.channels[4]}
    for one, other in zip(kept.estimates, overwritten.estimates, strict=True):
        assert one.channels == other.channels
        np.testing.assert_allclose(other.frequency, one.frequency, rtol=1e-9)  # rounding of other memory layouts
    assert kept.delays == overwritten.delays
    assert kept.delays[0]["d1"] > 0


def test_read_only_window_is_not_overwritten() -> None:
    window = faulty(3)
    window.data.flags.writeable = False
    measured = window.data.copy()
    assert identify_windows([window], overwrite=True).channels == identify_windows([faulty(3)]).channels
    np.testing.assert_array_equal(window.data, measured)

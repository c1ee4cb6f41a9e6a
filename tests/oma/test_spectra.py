import numpy as np
import pytest
from oma_helpers import frame, simulate

from daq import Channel, Recording
from oma import TooShort, singular_values


def white(seed: int, density: float, rate: float = 200.0, n: int = 100_000) -> Recording:
    data = np.random.default_rng(seed).standard_normal((n, 2)) * np.sqrt(density * rate / 2)
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate("ab"))
    return Recording(channels=channels, data=data, rate=rate, start=0)


@pytest.mark.parametrize("gaps", [False, True])
def test_white_noise_has_its_density(gaps: bool) -> None:
    recording = white(1, density=0.3)
    if gaps:
        recording.data[1000:2000, 0] = np.nan
        recording.data[30_000:55_000, 1] = np.nan
    _, values = singular_values(recording, 256)
    # trace of the spectral matrix: 2 x 0.3, mean of 127 lines x about 700 segments: 0.5 % at most
    assert values[1:-1].sum(axis=1).mean() == pytest.approx(0.6, rel=0.02)


def test_first_singular_value_peaks_at_the_modes() -> None:
    truth = frame()
    frequency, values = singular_values(simulate(truth, 60.0, 1000.0, 2), 4096)
    for f in truth.frequency[2:]:
        near = np.abs(frequency - f) < 3.0
        # resolution: 0.24 Hz a line, half power width up to 1.5 Hz
        assert frequency[near][np.argmax(values[near, 0])] == pytest.approx(f, abs=1.0)


def test_two_singular_values_stand_out_at_two_close_modes() -> None:
    frequency, values = singular_values(simulate(frame(), 60.0, 1000.0, 2), 4096)
    line = np.argmin(np.abs(frequency - 10.9))
    assert values[line, 1] > 30 * values[line, 2]


def test_too_short_a_recording_is_refused() -> None:
    with pytest.raises(TooShort):
        singular_values(white(1, 1.0, n=100), 256)

import numpy as np
import pytest

from daq import Channel, FloatArray, Recording
from oma import IdentificationError, TooShort, singular_values
from oma.spectral import SpectrumAccumulator
from oma.spectral.spectra import spectral_sums
from tests.support.oma.structures import frame, simulate


def white(seed: int, density: float, rate: float = 200.0, n: int = 100_000) -> Recording:
    data = np.random.default_rng(seed).standard_normal((n, 2)) * np.sqrt(density * rate / 2)
    channels = tuple(Channel(name=name, device="d", axis=i) for i, name in enumerate("ab"))
    return Recording(channels=channels, data=data, rate=rate, start=0)


@pytest.mark.parametrize("gaps", [False, True])
def test_spectral_density_of_white_noise_is_correct(gaps: bool) -> None:
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


def test_two_singular_values_are_large_at_two_close_modes() -> None:
    frequency, values = singular_values(simulate(frame(), 60.0, 1000.0, 2), 4096)
    line = np.argmin(np.abs(frequency - 10.9))
    assert values[line, 1] > 30 * values[line, 2]


def test_too_short_recording_is_refused() -> None:
    with pytest.raises(TooShort):
        singular_values(white(1, 1.0, n=100), 256)


def noise(n: int, n_channels: int = 3) -> FloatArray:
    return np.random.default_rng(5).standard_normal((n, n_channels))


@pytest.mark.parametrize("lengths", [[5000], [1, 255, 2744, 2000], [100] * 50, [4999, 1]])
def test_spectrum_is_independent_of_block_lengths(lengths: list[int]) -> None:
    accumulator = SpectrumAccumulator(3, 100.0, 256)
    for block in np.split(noise(5000), np.cumsum(lengths)[:-1]):
        accumulator.add(block)
    whole = spectral_sums(noise(5000), 100.0, 256, 1)
    # single precision in store: 6e-8 of the largest element a block
    assert np.allclose(accumulator.sums.mean(), whole.mean(), rtol=1e-6, atol=1e-6 * np.abs(whole.mean()).max())
    assert np.allclose(accumulator.sums.windows.sum(axis=0), whole.windows[0])
    assert accumulator.n_complete == 5000


def test_rolling_window_equals_new_window() -> None:
    """A segment that began in a block that was dropped is still there: 1024 samples, and the half before them."""
    data = noise(4096)
    rolling = SpectrumAccumulator(3, 100.0, 256)
    for block in np.split(data, 8):
        rolling.add(block)
    rolling.drop(6)
    window = spectral_sums(data[3072 - 128 :], 100.0, 256, 1)
    assert np.allclose(rolling.sums.mean(), window.mean(), rtol=1e-5, atol=1e-6 * np.abs(window.mean()).max())


def test_lines_outside_the_band_are_not_kept() -> None:
    whole = spectral_sums(noise(2000), 100.0, 200, 2)
    part = spectral_sums(noise(2000), 100.0, 200, 2, band=(10.0, 20.0))
    assert np.allclose(part.frequency, np.arange(10.0, 20.25, 0.5))
    assert np.array_equal(part.mean(), whole.mean(slice(20, 41)))


def test_influence_is_first_order_change_on_omitting_a_block() -> None:
    """To first order: (mean - mean without the block) is the influence over the share of the others."""
    sums = spectral_sums(noise(6400), 100.0, 128, 5)
    weight = sums.windows[:, 0]
    for b, influence in enumerate(sums.influences()):
        others = sum(sums.sums[k].astype(np.complex128) for k in range(5) if k != b)
        rows, columns = np.tril_indices(3)
        without = others / (weight.sum() - weight[b]) / 100.0
        change = sums.mean()[:, rows, columns] - without
        assert np.allclose(influence[:, rows, columns], change * (1 - weight[b] / weight.sum()), atol=1e-9)


def test_window_function_includes_effect_of_gaps_and_segments() -> None:
    """The spectrum of a sinusoid's samples is the transform of its correlation times the windows', gaps included."""
    n, line = 64, 9.3
    data = np.sqrt(2) * np.cos(2 * np.pi * line / n * np.arange(20_000) + 1.0)[:, None] * np.ones(2)
    data[np.random.default_rng(3).integers(0, 20_000, 300), 0] = np.nan
    sums = spectral_sums(data, 1.0, n, 4)
    lag = np.arange(n)
    windowed = sums.window * np.cos(2 * np.pi * line / n * lag)
    expected = 2 * np.fft.fft(windowed).real[: n // 2 + 1] - windowed[0]
    # what is left is the phase of the segments that 310 of them do not average out
    assert np.allclose(sums.mean()[:, 0, 1], expected, atol=3 / np.sqrt(310) * expected.max() / 10)


def test_record_without_complete_samples_is_refused() -> None:
    data = noise(1000)
    data[:, 1] = np.nan
    with pytest.raises(IdentificationError, match="gaps leave no complete sample"):
        spectral_sums(data, 100.0, 128, 2)

"""Residuals of channels predicted from the others, on signals of known spectral matrices."""

import numpy as np
import pytest

from daq import FloatArray
from oma.spectral import ChannelPrediction

N = 256
DEVICES = np.array([0, 0, 1, 1, 2])
MEMORY = 1e9


def mixed(random: np.random.Generator, mixing: FloatArray, n: int) -> FloatArray:
    """Return n channels' samples (n, 5): white forces, mixed, and independent noise."""
    return random.standard_normal((n, mixing.shape[1])) @ mixing.T + 0.1 * random.standard_normal((n, len(mixing)))


def learned(random: np.random.Generator, mixing: FloatArray, n_blocks: int) -> ChannelPrediction:
    prediction = ChannelPrediction(N, DEVICES, MEMORY)
    for _ in range(n_blocks):
        prediction.add(prediction.spectrum(mixed(random, mixing, N)))
    return all_learned(prediction)


def all_learned(prediction: ChannelPrediction) -> ChannelPrediction:
    """Learn the held blocks and the newer ones."""
    prediction.learn()
    prediction.learn()
    return prediction


def found(prediction: ChannelPrediction, block: FloatArray) -> FloatArray:
    residuals = prediction.residuals(prediction.spectrum(block))
    assert residuals is not None
    return residuals


@pytest.mark.parametrize("n_blocks", [60, 400])
def test_residual_of_other_blocks_is_one_for_any_number_of_learned_blocks(n_blocks: int) -> None:
    """300 blocks of 100 lines give the mean within 0.006, the learned matrix within 0.1 / sqrt(n); delays take 0.02."""
    random = np.random.default_rng(1)
    mixing = random.standard_normal((5, 2))
    prediction = learned(random, mixing, n_blocks)
    # independent blocks, not overlapping ones: 38 / 36 as many as counted
    n = prediction.n_blocks
    counted = n**2 / ((n - 5) * (n - 4))
    n = n_blocks
    expected = n**2 / ((n - 5) * (n - 4)) / counted
    levels = np.mean([found(prediction, mixed(random, mixing, N)) for _ in range(300)], axis=0)
    assert levels == pytest.approx(expected, abs=0.02 + 3 / np.sqrt(100 * n_blocks))


def test_nothing_is_predicted_before_ten_blocks_per_channel() -> None:
    random = np.random.default_rng(2)
    mixing = random.standard_normal((5, 2))
    block = mixed(random, mixing, N)
    few, enough = learned(random, mixing, 52), learned(random, mixing, 53)
    assert few.residuals(few.spectrum(block)) is None  # 36 / 38 of 52 are less than 50
    assert found(enough, block).shape == (5,)


def test_residual_grows_where_the_shapes_have_changed() -> None:
    """The third channel moves by twice as much: its residual is its former motion, 0.1 of noise."""
    random = np.random.default_rng(3)
    mixing = random.standard_normal((5, 2))
    prediction = learned(random, mixing, 200)
    changed = mixing * np.array([1, 1, 2, 1, 1])[:, None]
    before, after = (found(prediction, mixed(random, m, N)) for m in (mixing, changed))
    assert before.max() < 1.5
    assert after.argmax() == 2
    assert after[2] > 10 * before[2]


def test_delays_of_devices_are_no_residual() -> None:
    """A third of a sample, smoothly: the phase at 0.4 of the rate turns by 0.8 rad."""
    random = np.random.default_rng(4)
    mixing = random.standard_normal((5, 2))
    prediction = learned(random, mixing, 400)
    line = np.fft.rfftfreq(N)[:, None]
    delay = np.array([0.0, 0.0, 0.33, 0.33, -0.2])
    block = mixed(random, mixing, N)
    late = np.fft.irfft(np.fft.rfft(block, axis=0) * np.exp(-2j * np.pi * line * delay), N, axis=0)
    one_clock = ChannelPrediction(N, np.zeros(5, np.intp), MEMORY)
    for _ in range(400):
        one_clock.add(one_clock.spectrum(mixed(random, mixing, N)))
    assert found(all_learned(one_clock), late).max() > 5
    # the taper sees other samples of the same motion
    assert found(prediction, late) == pytest.approx(found(prediction, block), rel=0.15)


def test_memory_forgets_old_blocks() -> None:
    """Batches of 10 blocks, forgotten over 50."""
    random = np.random.default_rng(5)
    mixing = random.standard_normal((5, 2))
    prediction = ChannelPrediction(N, DEVICES, memory=50)
    for matrix in (mixing, -mixing[::-1]):
        for _ in range(40):
            for _ in range(10):
                prediction.add(prediction.spectrum(mixed(random, matrix, N)))
            prediction.learn()
    kept = (1 - 1 / 50) ** 10
    weight, squares = 10 / (1 - kept), 10 / (1 - kept**2)
    assert prediction.n_blocks == pytest.approx(36 / 38 * weight**2 / squares, rel=1e-6)
    assert found(prediction, mixed(random, -mixing[::-1], N)).max() < 1.6


def test_discarded_blocks_are_not_learned() -> None:
    random = np.random.default_rng(6)
    mixing = random.standard_normal((5, 2))
    prediction = learned(random, mixing, 100)
    block = mixed(random, mixing, N)
    before, n = found(prediction, block), prediction.n_blocks
    for _ in range(2):  # held, and newer
        prediction.add(prediction.spectrum(mixed(random, -mixing[::-1], N)))
        prediction.learn()
        prediction.add(prediction.spectrum(mixed(random, -mixing[::-1], N)))
        prediction.discard()
    prediction = all_learned(prediction)
    assert prediction.n_blocks == n
    np.testing.assert_array_equal(found(prediction, block), before)


@pytest.mark.parametrize("silent", [[2, 3], [2], [0, 1, 2, 3, 4]])
def test_channels_without_a_signal_are_no_failure(silent: list[int]) -> None:
    """A device sends zeros, one of its axes does, or all do: in the learned blocks, in a later one, in both."""
    random = np.random.default_rng(7)
    mixing = random.standard_normal((5, 2))
    dead = mixing.copy()
    dead[silent] = 0

    def block(matrix: FloatArray) -> FloatArray:
        return np.where(matrix.any(1), mixed(random, matrix, N), 0.0)

    for before, after in ((dead, dead), (dead, mixing), (mixing, dead)):
        prediction = ChannelPrediction(N, DEVICES, MEMORY)
        for _ in range(100):
            prediction.add(prediction.spectrum(block(before)))
        levels = found(all_learned(prediction), block(after))
        assert np.isfinite(levels).all()
        if after is dead and before is dead:
            assert (levels[silent] == 0).all()
        elif after is mixing:
            assert (levels[silent] > 1e6).all()

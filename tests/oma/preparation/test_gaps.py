import numpy as np
from scipy import signal

from oma.preparation.gaps import ORDER, filled, short_gaps
from tests.support.oma.scenes import SCENES


def test_missing_samples_are_predicted_from_other_channels() -> None:
    whole = SCENES["short"].record(2).data
    missing = np.random.default_rng(2).random(whole.shape) < 0.1
    found = filled(np.where(missing, np.nan, whole))
    assert not np.isnan(found).any()
    assert np.array_equal(found[~missing], whole[~missing])
    # accelerations follow white forces at once: what these add, a fifth of the rms, nothing can tell
    assert np.std((found - whole)[missing]) < 0.25 * np.std(whole)


def test_gaps_in_sum_of_sines_are_filled_to_noise_level() -> None:
    time = np.arange(2000.0)
    whole = np.column_stack([np.sin(0.3 * time), np.sin(0.3 * time + 1) + np.sin(1.1 * time)])
    noise = 1e-3 * np.random.default_rng(0).standard_normal(whole.shape)
    missing = np.random.default_rng(1).random(whole.shape) < 0.1
    found = filled(np.where(missing, np.nan, whole + noise))
    assert np.sqrt(np.mean((found - whole)[missing] ** 2)) < 3e-3


def test_long_gaps_are_not_filled() -> None:
    data = SCENES["short"].record(2).data.copy()
    data[100 : 100 + ORDER, 3] = np.nan
    data[300 : 300 + ORDER + 1, 3] = np.nan
    found = filled(data)
    assert not np.isnan(found[:300]).any()
    assert np.isnan(found[300 : 300 + ORDER + 1, 3]).all()
    assert short_gaps(np.isnan(data)).sum() == ORDER


def test_filling_in_place_needs_no_copy() -> None:
    whole = SCENES["short"].record(2).data
    data = np.where(np.random.default_rng(2).random(whole.shape) < 0.1, np.nan, whole)
    expected = filled(data)
    assert filled(data, in_place=True) is data
    assert np.array_equal(data, expected)


def test_short_recordings_are_not_changed() -> None:
    data = np.ones((20, 3))
    data[4, 1] = np.nan
    assert filled(data) is data


def test_long_record_is_filled_from_blocks_as_well_as_from_all_samples() -> None:
    """The innovation is white noise of 1; 24 coefficients per equation, fitted to a few blocks, add under 1 % to it."""
    random = np.random.default_rng(4)
    innovation = random.standard_normal((60_000, 3))
    whole = signal.lfilter([1.0], [1.0, -1.2, 0.8], innovation, axis=0)
    missing = np.zeros(whole.shape, bool)
    lost = np.arange(500, 59_500, 60)
    missing[lost, random.integers(0, 3, len(lost))] = True
    found = filled(np.where(missing, np.nan, whole))
    best = 1 / np.sqrt(1 + 1.2**2 + 0.8**2)  # deviation of one sample of this autoregression, both sides known
    assert np.isclose(np.std((found - whole)[missing]), best, rtol=4 / np.sqrt(2 * len(lost)) + 0.01)

"""Identification of structures with known modes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from daq import Channel, FloatArray, Recording
from oma import CovarianceSSI, IdentificationError, ModalEstimate, TooShort, identify, identify_all, mac_matrix
from oma.errors import TooFewChannels, TooFewModes
from tests.support.oma.structures import (
    FRAME_CHANNELS,
    Structure,
    anti_aliased,
    chain,
    frame,
    frame_with_higher_modes,
    simulate,
)
from tests.support.thorough import few_of

SEEDS = range(12)


@cache
def window(seed: int) -> Recording:
    return simulate(frame(), 60.0, 1000.0, seed)


@cache
def estimate(seed: int) -> ModalEstimate:
    return identify(window(seed))


def law(truth: Structure, duration: float) -> tuple[FloatArray, FloatArray]:
    cycles = truth.frequency * duration
    return (
        truth.frequency * np.sqrt(truth.damping / (2 * np.pi * cycles)),
        truth.damping / np.sqrt(2 * np.pi * truth.damping * cycles),
    )


def check(found: ModalEstimate, truth: Structure, duration: float, shapes: FloatArray | None = None) -> None:
    """All modes and none false; within 6 standard deviations of a method whose errors are 1.5 times the law's."""
    assert found.n_modes == len(truth.frequency), found.frequency
    frequency_std, damping_std = law(truth, duration)
    assert np.all(np.abs(found.frequency - truth.frequency) < 6 * 1.5 * frequency_std)
    assert np.all(np.abs(found.damping - truth.damping) < 6 * 1.5 * damping_std)
    agreement = np.diag(mac_matrix(found.shape, truth.shapes if shapes is None else shapes))
    # close modes mix by about (error of frequency / separation): 0.01 Hz / 0.19 Hz, squared and doubled for luck
    assert np.all(agreement > 0.9), agreement


@pytest.mark.parametrize("seed", few_of(SEEDS, 5))
def test_all_frame_modes_are_identified_without_false_modes(seed: int) -> None:
    check(estimate(seed), frame(), 60.0)


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_all_chain_modes_are_identified_without_false_modes(seed: int) -> None:
    check(identify(simulate(chain(), 300.0, 50.0, seed)), chain(), 300.0)


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_lower_modes_are_identified_at_half_rate_and_half_duration(seed: int) -> None:
    whole = frame()
    truth = replace(whole, frequency=whole.frequency[:6], damping=whole.damping[:6], shapes=whole.shapes[:6])
    found = identify(simulate(truth, 30.0, 500.0, seed))
    assert found.n_modes == 6
    assert np.all(np.abs(found.frequency - truth.frequency) < 9 * law(truth, 30.0)[0])


@pytest.mark.parametrize("seeds", few_of([SEEDS[:5], SEEDS]), ids=len)
def test_stated_deviations_cover_errors_near_the_uncertainty_law(seeds: range) -> None:
    truth = frame()
    frequency = np.array([estimate(seed).frequency - truth.frequency for seed in seeds])
    damping = np.array([estimate(seed).damping - truth.damping for seed in seeds])
    claimed = np.array([estimate(seed).frequency_std for seed in seeds])
    claimed_damping = np.array([estimate(seed).damping_std for seed in seeds])
    for error, std, limit in zip((frequency, damping), (claimed, claimed_damping), law(truth, 60.0), strict=True):
        # 93 % is what +-2 Student standard deviations of 30 blocks with a little nonlinearity must cover at least
        assert np.sum(np.abs(error) < 2 * std) >= stats.binom.ppf(1e-4, error.size, 0.93)
        # and not by exaggeration: the mean square of standardised errors is chi-square
        assert np.mean((error / std) ** 2) > stats.chi2.ppf(1e-4, error.size) / error.size * 0.9
        # efficiency 1.25 measured on 100 windows
        assert np.mean((error / limit) ** 2) < 1.25**2 * stats.chi2.ppf(1 - 1e-4, error.size) / error.size
        # bias, half the law allowed for: mean of the windows has standard error 1.25 / sqrt(n)
        bias = np.abs(error.mean(axis=0) / limit)
        assert np.all(bias < 0.5 + 4 * 1.25 / np.sqrt(len(seeds)))


@pytest.mark.thorough
def test_stated_shape_deviations_cover_the_errors() -> None:
    truth = frame().shapes
    inside = []
    for seed in SEEDS:
        shape = estimate(seed).shape.real
        shape = shape * np.sign(np.sum(shape * truth, axis=1, keepdims=True))
        inside.append(np.abs(shape - truth) < 2 * estimate(seed).shape_std)
    # components of one shape share their errors, so that 96 modes count, not 1152 components
    assert np.mean(inside) >= stats.binom.ppf(1e-4, 96, 0.93) / 96


def test_identification_is_exactly_repeatable() -> None:
    again = identify(simulate(frame(), 60.0, 1000.0, 0))
    for name in ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "law_ratio"):
        assert np.array_equal(getattr(again, name), getattr(estimate(0), name)), name


def test_results_are_independent_of_data_unit() -> None:
    scaled = identify(replace(window(0), data=window(0).data / 1024))
    # a power of two is exact in floating point: nothing but the data's exponents changes
    assert np.array_equal(scaled.frequency, estimate(0).frequency)
    assert np.array_equal(scaled.shape, estimate(0).shape)


def test_results_are_independent_of_constant_offsets() -> None:
    gravity = window(0).data + 9.81 * (np.arange(12) % 3 == 0)
    # rounding: 9.81 x 2.2e-16 against signals of about 1
    assert np.allclose(identify(replace(window(0), data=gravity)).frequency, estimate(0).frequency, rtol=1e-9)


def test_all_modes_are_identified_from_data_with_gaps() -> None:
    data = window(1).data.copy()
    data[10_000:13_000, 8:10] = np.nan
    data[40_000:40_050, :4] = np.nan
    data[55_000:, 10:] = np.nan
    check(identify(replace(window(1), data=data)), frame(), 60.0)


def test_lost_device_and_constant_channel_are_excluded() -> None:
    data = window(2).data.copy()
    data[:, 8:10] = np.nan
    data[:, 3] = 0.25
    found = identify(replace(window(2), data=data))
    kept = [i for i in range(12) if i not in (3, 8, 9)]
    assert found.channels == tuple(FRAME_CHANNELS[i] for i in kept)
    check(found, frame(), 60.0, frame().shapes[:, kept])


def test_all_modes_are_identified_despite_device_delays() -> None:
    data = window(3).data.copy()
    spectrum = np.fft.rfft(data, axis=0)
    delay = np.repeat([0.0, 0.3e-3, 0.0, 0.3e-3, 0.15e-3, 0.0], 2)
    spectrum *= np.exp(-2j * np.pi * np.fft.rfftfreq(len(data), 1e-3)[:, None] * delay)
    found = identify(replace(window(3), data=np.fft.irfft(spectrum, len(data), axis=0)))
    turned = frame().shapes * np.exp(-2j * np.pi * frame().frequency[:, None] * delay)
    assert found.n_modes == 8
    assert np.all(np.diag(mac_matrix(found.shape, turned)) > 0.9)


@pytest.mark.parametrize("damping", [0.002, 0.01])
@pytest.mark.parametrize("seed", few_of(range(2)))
def test_modes_of_light_and_heavy_damping_are_identified(damping: float, seed: int) -> None:
    truth = frame(damping)
    found = identify(simulate(truth, 60.0, 1000.0, seed))
    assert found.n_modes == 8
    assert np.all(np.abs(found.frequency - truth.frequency) < 9 * law(truth, 60.0)[0])


def test_strong_sensor_noise_causes_no_false_modes() -> None:
    found = identify(simulate(frame(), 60.0, 1000.0, 5, noise=0.5))
    assert found.n_modes == 8


@pytest.mark.parametrize("noise", few_of([1e-5, 1e-3]))
@pytest.mark.parametrize("seed", few_of(range(2)))
def test_all_modes_are_identified_despite_anti_alias_filter(seed: int, noise: float) -> None:
    truth = frame_with_higher_modes()
    found = identify(
        anti_aliased(simulate(truth, 60.0, 4000.0, seed, noise=0.0, forced=slice(4, None, 2)), 4, noise, seed)
    )
    assert found.n_modes == 10
    assert np.all(np.abs(found.frequency - truth.frequency[:10]) < 9 * law(truth, 60.0)[0][:10])


@pytest.mark.parametrize(("frequency", "share"), few_of([(50.0, 0.5), (23.3, 0.5), (150.0, 1.0)], 2))
def test_strong_tone_is_not_reported_as_mode(frequency: float, share: float) -> None:
    shape = np.random.default_rng(9).standard_normal(12)
    tone = np.outer(np.sin(2 * np.pi * frequency * np.arange(60_000) / 1000.0), shape)
    data = window(6).data + share * window(6).data.std() * tone
    found = identify_all(replace(window(6), data=data))
    check(found.estimate, frame(), 60.0)
    assert np.any(np.abs(found.harmonics - frequency) < 0.01)


def test_frequency_band_restricts_the_search() -> None:
    found = identify(window(0), band=(30.0, 100.0))
    assert np.allclose(found.frequency, [38.84, 68.77, 92.53], rtol=0.01)


def test_stabilization_diagram_has_stable_poles_at_each_mode() -> None:
    everything = identify_all(window(4))
    for f in everything.estimate.frequency:
        near = np.abs(everything.poles.frequency / f - 1) < 0.01
        assert np.sum(near & everything.poles.stable) >= 5


def noise(n_samples: int, n_channels: int, rate: float = 100.0) -> Recording:
    data = np.random.default_rng(0).standard_normal((n_samples, n_channels))
    channels = tuple(Channel(name=f"c{i}", device="d", axis=0) for i in range(n_channels))
    return Recording(channels=channels, data=data, rate=rate, start=0)


@pytest.mark.parametrize("n_samples", [0, 1, 10, 500])
def test_short_recordings_are_refused(n_samples: int) -> None:
    with pytest.raises(IdentificationError):
        identify(noise(n_samples, 4))


def test_error_for_short_recording_states_required_length() -> None:
    with pytest.raises(TooShort, match=r"1 s is too short: at least"):
        identify(noise(100, 4))


def test_single_usable_channel_is_refused() -> None:
    recording = noise(6000, 3)
    recording.data[:, 0] = np.nan
    recording.data[:, 1] = 1.0
    with pytest.raises(TooFewChannels, match="c0: 0% of the samples are there; c1: constant") as caught:
        identify(recording)
    assert caught.value.usable == ("c2",)


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_no_modes_are_identified_in_noise(seed: int) -> None:
    recording = noise(60_000, 12, rate=1000.0)
    recording.data[:] = np.random.default_rng(seed).standard_normal(recording.data.shape)
    with pytest.raises(TooFewModes):
        identify(recording)


@pytest.mark.parametrize("band", [(10.0, 5.0), (0.0, 10.0), (1.0, 60.0)])
def test_invalid_bands_are_refused(band: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="band: expected"):
        identify(noise(6000, 4), band=band)


@pytest.mark.parametrize(
    "options",
    [{"block_rows": 1}, {"max_order": 1}, {"max_order": 0}, {"order_step": 0}, {"n_blocks": 2}, {"decimation": 1}],
)
def test_invalid_options_are_refused(options: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="expected"):
        CovarianceSSI(**options)  # type: ignore[arg-type]


def test_close_modes_mixed_in_short_window_are_both_identified() -> None:
    """In 30 s, 0.09 Hz apart and 0.07 Hz wide each, their shapes mix with complex factors."""
    frequency, damping = frame().frequency.copy(), frame().damping.copy()
    frequency[0], damping[:2] = 10.88, (0.006, 0.008)
    truth = replace(frame(), frequency=frequency, damping=damping)
    found = [identify(simulate(truth, 30.0, 1000.0, seed, forced=slice(6, 8)), band=(5.0, 16.0)) for seed in range(10)]
    # 93 % of 40 windows were measured, 60 % with poles of complex shapes left out
    assert np.sum([estimate.n_modes == 2 for estimate in found]) >= 8


@pytest.mark.thorough
def test_more_modes_than_default_model_orders_are_identified() -> None:
    """24 modes at 12 sensors: up to order 50 two of them were not found, and dampings erred by four deviations."""
    every = chain(24, 2.0, 0.005)
    truth = replace(every, shapes=every.shapes[:, ::2], channels=every.channels[::2])
    errors = []
    for seed in range(2):
        found = identify(simulate(truth, 600.0, 160.0, seed))
        assert found.n_modes == 24, found.frequency
        errors += [(found.frequency - truth.frequency) / found.frequency_std]
        errors += [(found.damping - truth.damping) / found.damping_std]
    rms = np.sqrt(np.mean(np.square(errors), axis=1))  # of 24 each, whose scatter over draws is 1 / sqrt(48)
    assert np.all(rms < 1.2 + 4 / np.sqrt(48)), rms

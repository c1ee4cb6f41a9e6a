"""Frequency domain decomposition and its two refinements, tested with structures of known modes."""

from functools import cache

import numpy as np
import pytest
from scipy import signal

from daq import FloatArray, Recording
from oma import EFDD, FDD, FSDD, METHODS, IdentificationError, ModalEstimate, identify, mac_matrix
from oma.preparation import Level
from oma.selection import uncertainty_law
from oma.spectral.bell_fit import Windowed, fit_bell
from oma.spectral.spectra import spectral_sums
from tests.support.oma.structures import Structure, chain, frame, simulate
from tests.support.thorough import few_of

SEEDS = range(4)


@cache
def window(seed: int) -> Recording:
    return simulate(chain(), 300.0, 50.0, seed)


@cache
def estimate(method: str, seed: int) -> ModalEstimate:
    return identify(window(seed), METHODS[method]())


def law(truth: Structure, duration: float) -> FloatArray:
    pairs = zip(truth.frequency, truth.damping, strict=True)
    return np.array([uncertainty_law(f, zeta, duration) for f, zeta in pairs]).T


@pytest.mark.parametrize("method", [FDD, EFDD, FSDD])
@pytest.mark.parametrize("seed", few_of(SEEDS, 2))
def test_all_chain_modes_are_identified_without_false_modes(method: type[FDD], seed: int) -> None:
    found, truth = estimate(method.name, seed), chain()
    assert found.n_modes == 6, found.frequency
    assert np.all(np.diag(mac_matrix(found.shape, truth.shapes)) > 0.99)
    # within five standard deviations as stated
    assert np.all(np.abs(found.frequency - truth.frequency) < 5 * found.frequency_std)
    assert np.all(np.abs(found.damping - truth.damping) < 5 * found.damping_std)


@pytest.mark.parametrize("seeds", few_of([SEEDS[:2], SEEDS]), ids=len)
@pytest.mark.parametrize(("method", "frequency", "damping"), [(FSDD, 1.5, 1.7), (EFDD, 3.0, 3.0), (FDD, 5.0, 1.7)])
def test_errors_relative_to_uncertainty_law_are_within_method_limits(
    method: type[FDD], frequency: float, damping: float, seeds: range
) -> None:
    """Root mean square over the uncertainty law's; 1.05, 1.9, 3.3 and 1.3, 1.9 measured on 40 windows."""
    limits = law(chain(), 300.0)
    errors = [
        ((found.frequency - chain().frequency) / limits[0], (found.damping - chain().damping) / limits[1])
        for found in (estimate(method.name, seed) for seed in seeds)
    ]
    size = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    assert size[0] < frequency
    assert size[1] < damping


@pytest.mark.parametrize("seed", few_of(range(2)))
def test_close_modes_are_separated(seed: int) -> None:
    """A pair 1.7 % apart in 120 s: the bells overlap to half their height."""
    truth = frame()
    found = identify(simulate(truth, 120.0, 1000.0, seed), FSDD(), band=(8.0, 60.0))
    assert found.n_modes == 3
    assert np.all(np.abs(found.frequency - truth.frequency[:3]) < 6 * 1.5 * law(truth, 120.0)[0, :3])
    assert np.all(np.diag(mac_matrix(found.shape, truth.shapes[:3])) > 0.9)


def test_all_modes_are_identified_from_data_with_gaps() -> None:
    recording = simulate(chain(), 400.0, 50.0, 3)
    recording.data[5000:7000, 2] = np.nan
    recording.data[12_000:12_010] = np.nan
    found = identify(recording, FSDD())
    assert found.n_modes == 6
    assert np.all(np.abs(found.frequency - chain().frequency) < 5 * found.frequency_std)


@pytest.mark.parametrize("seed", range(2))
def test_no_modes_are_identified_in_noise(seed: int) -> None:
    recording = window(0)
    quiet = np.random.default_rng(seed).standard_normal(recording.data.shape)
    with pytest.raises(IdentificationError, match=r"is a mode|too short"):
        identify(Recording(channels=recording.channels, data=quiet, rate=50.0, start=0), FSDD())


def test_rolling_window_equals_new_window() -> None:
    """Blocks that were dropped leave no trace but the segment that reaches into the window."""
    level = Level(rate=50.0, band=(1.0, 20.0), noise_lags=0)
    method, data = FSDD(n_fft=512), simulate(chain(), 800.0, 50.0, 1).data
    rolling, fresh = (method.start(chain().channels, level) for _ in range(2))
    for block in np.array_split(data, 32):
        rolling.add(block)
    rolling.drop(16)
    for block in np.array_split(data[20_000:], 16):
        fresh.add(block)
    frequencies = [np.array([m.frequency for m in found.modes]) for x in (rolling, fresh) if (found := x.identify())]
    # half a segment more in 400 s: a hundredth of the data, a tenth of the law
    assert np.all(np.abs(frequencies[0] - frequencies[1]) < 0.3 * law(chain(), 400.0)[0])


def test_damping_is_correct_for_peak_narrower_than_spectral_line() -> None:
    """Of the expected spectrum itself, without chance: the effect of the window is known exactly."""
    pole = complex(-0.004, 0.8)
    n_fft, n = 256, 40_000
    lag = np.arange(n_fft)
    sums = spectral_sums(np.random.default_rng(0).standard_normal((n, 2)), 1.0, n_fft, 2)
    correlation = np.exp(pole.real * lag) * np.cos(pole.imag * lag)
    expected = 2 * np.fft.fft(sums.window * correlation).real - 1
    line = round(0.8 * n_fft / 2 / np.pi)
    lines = slice(line - 12, line + 13)
    fit = fit_bell(expected[lines] + 1e-3, complex(-0.01, 0.81), Windowed(window=sums.window, rate=1.0, lines=lines))
    assert fit is not None
    assert 2 * np.pi / n_fft > 2 * -pole.real  # narrower than a line
    assert fit.pole.imag == pytest.approx(pole.imag, abs=1e-4)
    assert fit.pole.real == pytest.approx(pole.real, rel=0.02)


def test_influence_of_spectral_line_is_derivative_of_pole() -> None:
    rng = np.random.default_rng(2)
    system = signal.cont2discrete((np.array([1.0, 0.0]), np.array([1.0, 0.02, 1.0])), 1.0)
    data = signal.lfilter(system[0].ravel(), system[1], rng.standard_normal((20_000, 1)), axis=0) * np.ones(2)
    sums = spectral_sums(data + 0.1 * rng.standard_normal(data.shape), 1.0, 512, 2)
    lines = slice(60, 105)
    spectrum = sums.mean(lines)[:, 0, 0].real
    seen = Windowed(window=sums.window, rate=1.0, lines=lines)
    fit = fit_bell(spectrum, complex(-0.01, 1.0), seen)
    assert fit is not None
    change = 1e-3 * spectrum * rng.standard_normal(len(spectrum))
    up, down = (fit_bell(spectrum + sign * change, fit.pole, seen) for sign in (1, -1))
    assert up is not None
    assert down is not None
    moved = np.array([(up.pole - down.pole).imag, (up.pole - down.pole).real]) / 2
    # expected for observed curvature of the likelihood: as far as the spectrum scatters about the bell, 1/sqrt(60)
    assert np.allclose(fit.influence @ change, moved, atol=0.3 * np.abs(moved).max())


@pytest.mark.parametrize("options", [{"n_fft": 8}, {"n_blocks": 2}, {"decimation": 1}])
@pytest.mark.parametrize("method", [FDD, EFDD, FSDD])
def test_invalid_options_are_refused(method: type[FDD], options: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="expected at least"):
        method(**options)  # type: ignore[arg-type]

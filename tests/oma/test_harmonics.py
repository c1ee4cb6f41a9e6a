"""Tones against resonances: by the steadiness of their power."""

from dataclasses import replace

import numpy as np
import pytest
from oma_helpers import simulate
from oma_scenes import RATE, SCENES, Tone, tower, with_tone
from scipy import fft, stats

from oma import identify_all
from oma.harmonics import steadiest, steady_modes

N_WINDOWS = 2000


def power_of_resonances(times: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of the power of band-limited Lorentzian noise that forgets so many times; 2000 windows."""
    half_width = times / (2 * np.pi)
    reach = round(max(4 * half_width, 8))
    lines = np.arange(-reach, reach + 1)
    rng = np.random.default_rng(5)
    noise = rng.standard_normal((2, N_WINDOWS, len(lines))) / np.sqrt(1 + (lines / half_width) ** 2)
    power = np.abs(fft.ifft(noise[0] + 1j * noise[1], fft.next_fast_len(4 * len(lines)), axis=1)) ** 2
    return power.mean(axis=1), power.var(axis=1)


@pytest.mark.parametrize("times", [4, 8, 32, 128, 512])
def test_a_resonance_is_as_steady_as_a_tone_once_in_ten_thousand_windows(times: float) -> None:
    mean, variance = power_of_resonances(times)
    variation = variance / mean**2
    assert np.sum(variation < steadiest(times)) <= stats.binom.ppf(1 - 1e-4, N_WINDOWS, 1e-4)
    # nor is the limit lower than need be: the steadiest hundredth is at most three times the steadiest ten-thousandth
    assert np.quantile(variation, 0.01) < 3 * steadiest(times)


def test_too_short_a_window_tells_no_tone() -> None:
    assert steadiest(1.0) == 0.0


@pytest.mark.parametrize("wander", [0.0, 1e-3])
@pytest.mark.parametrize("frequency", [11.5, 9.87])
@pytest.mark.parametrize("seed", range(2))
def test_tones_beside_modes_are_harmonics_and_nothing_else_is(frequency: float, wander: float, seed: int) -> None:
    recording = simulate(tower(), 300.0, RATE, seed)
    found = identify_all(with_tone(recording, Tone(frequency=frequency, share=1.0, wander=wander), seed))
    assert found.estimate.n_modes == 8
    # a wander of 0.1 % forgets in 10 s: 30 independent values, whose mean scatters by 0.02 %
    assert np.all(np.abs(found.harmonics / frequency - 1) < 1e-3)
    assert len(found.harmonics) >= 1


def test_gaps_make_no_tone() -> None:
    recording = SCENES["clean"].record(3)
    data = recording.data.copy()
    data[5000:9000] = np.nan
    estimate = identify_all(replace(recording, data=data)).estimate
    assert not steady_modes(data, RATE, estimate, np.empty(0)).any()


def test_half_a_window_without_data_is_not_judged() -> None:
    recording = SCENES["harmonic"].record(0)
    found = identify_all(recording)
    data = recording.data.copy()
    data[: len(data) // 2 + 1] = np.nan
    tone = replace(found.estimate[np.array([3])], frequency=np.array([11.5]), damping=np.array([0.001]))
    assert not steady_modes(data, RATE, tone, np.empty(0)).any()

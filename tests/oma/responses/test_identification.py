"""Modes of frequency responses: a chain with two close modes, deviations as statistics, and a measured frame."""

import os
from pathlib import Path

import numpy as np
import pytest

from daq import FloatArray
from oma import ComplexArray, IdentificationError, ModalEstimate, fit_resonance, identify_responses, mac_matrix
from tests.measured.three_storeys import BANDS

REAL = os.environ.get("MODALWATCH_REAL_DATA")
FREQUENCY = np.array([5.0, 12.0, 12.3, 20.0, 33.0, 47.0])
DAMPING = np.array([0.01, 0.008, 0.012, 0.01, 0.006, 0.02])
SHAPE = np.linalg.qr(np.random.default_rng(5).standard_normal((6, 6)))[0].T  # a mode a row
LINE: FloatArray = np.linspace(0.05, 60.0, 1200)
CHANNELS = tuple("abcdef")
N_DRAWS = 20


def responses(inputs: tuple[int, ...]) -> ComplexArray:
    """Return accelerances of the chain."""
    found = np.zeros((len(LINE), 6, len(inputs)), np.complex128)
    for frequency, damping, shape in zip(FREQUENCY, DAMPING, SHAPE, strict=True):
        ratio = LINE / frequency
        resonance = -(ratio**2) / (1 - ratio**2 + 2j * damping * ratio)
        found += resonance[:, None, None] * np.outer(shape, shape[list(inputs)])
    return found


def measured(seed: int, inputs: tuple[int, ...] = (0, 3)) -> ModalEstimate:
    random, exact = np.random.default_rng(seed), responses(inputs)
    noise = random.standard_normal(exact.shape) + 1j * random.standard_normal(exact.shape)
    return identify_responses(LINE, exact + 0.01 * np.abs(exact).mean() * noise, CHANNELS, (2.0, 58.0))


@pytest.mark.parametrize("inputs", [(0,), (0, 3), (1, 2, 5)])
def test_exact_responses_give_exact_modes(inputs: tuple[int, ...]) -> None:
    """To a thousandth of the damping: modes outside a fit are a straight line in it."""
    found = identify_responses(LINE, responses(inputs), CHANNELS, (2.0, 58.0))
    np.testing.assert_allclose(found.frequency, FREQUENCY, rtol=1e-4)
    np.testing.assert_allclose(found.damping, DAMPING, rtol=2e-2)
    assert (np.diag(mac_matrix(found.shape, SHAPE.astype(complex))) > 0.999).all()


@pytest.mark.thorough
def test_deviations_state_the_scatter() -> None:
    """Errors over deviations: rms of 0.85 to 1.35 in 60 draws, the largest where a resonance is two lines wide.

    The rms of 20 values has a standard deviation of 16 %.
    """
    draws = [measured(seed) for seed in range(N_DRAWS)]
    assert [found.n_modes for found in draws] == [6] * N_DRAWS
    print(f"seeds 0 to {N_DRAWS - 1}")
    for value, std, truth in (("frequency", "frequency_std", FREQUENCY), ("damping", "damping_std", DAMPING)):
        ratio = np.array([(getattr(found, value) - truth) / getattr(found, std) for found in draws])
        rms = np.sqrt((ratio**2).mean(axis=0))
        assert (rms > 0.85 * (1 - 3 * 0.16)).all(), (value, rms)
        assert (rms < 1.35 * (1 + 3 * 0.16)).all(), (value, rms)
    moved = [
        (found.shape.real - SHAPE * np.sign((found.shape.real * SHAPE).sum(axis=1))[:, None]) / found.shape_std
        for found in draws
    ]
    assert 0.8 < np.sqrt(np.square(moved).mean()) < 1.3


def test_noise_alone_is_no_mode() -> None:
    random = np.random.default_rng(3)
    noise = random.standard_normal((1200, 6, 1)) + 1j * random.standard_normal((1200, 6, 1))
    with pytest.raises(IdentificationError):
        identify_responses(LINE, noise, CHANNELS)


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="response: expected"):
        identify_responses(LINE, responses((0,))[:, :, 0], CHANNELS)
    with pytest.raises(ValueError, match="evenly spaced"):
        identify_responses(LINE**2, responses((0,)), CHANNELS)
    with pytest.raises(IdentificationError, match="expected 60 lines"):
        identify_responses(LINE, responses((0,)), CHANNELS, (10.0, 11.0))


@pytest.mark.skipif(not REAL, reason="MODALWATCH_REAL_DATA names no folder")
def test_measured_frame_has_the_modes_of_single_resonances() -> None:
    folder = Path(REAL or "") / "soton-3storey-frf"
    tests = [np.loadtxt(folder / f"acc_frf_force_floor{k}.csv", delimiter=";", dtype=complex) for k in (1, 2, 3)]
    line = tests[0][:, 0].real
    for test in tests:
        found = identify_responses(line, test[:, 1:, None], ("a", "b", "c"), (4.0, 60.0))
        for band in BANDS:
            one = fit_resonance(line, test[:, 1:], band)
            near = int(np.argmin(np.abs(found.frequency - one.frequency)))
            assert abs(found.frequency[near] - one.frequency) < 2 * found.frequency_std[near]
            assert abs(found.damping[near] - one.damping) < 2 * found.damping_std[near]

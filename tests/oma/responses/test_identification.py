"""Modes of frequency responses: a chain with two close modes, deviations as statistics, and a measured frame."""

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from daq import FloatArray
from oma import (
    ComplexArray,
    IdentificationError,
    ModalEstimate,
    fit_resonance,
    identify_responses,
    identify_responses_all,
    mac_matrix,
)
from oma.responses.lines import Lines
from oma.responses.resonance_fit import fitted_modes
from oma.responses.stable_poles import StablePole
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


def test_lines_and_channels_of_zeros_are_left_out() -> None:
    """As of an analyser that blanks lines, and of a sensor that is not connected."""
    response = responses((0,))
    response[:60], response[400], response[:, 2] = 0.0, 0.0, 0.0
    found = identify_responses_all(LINE, response, CHANNELS)
    assert found.silent == ("c",)
    assert found.estimate.channels == tuple("abdef")
    assert found.record_seconds == pytest.approx(20.0)
    np.testing.assert_allclose(found.estimate.frequency, FREQUENCY, rtol=1e-4)
    shape = np.delete(SHAPE, 2, axis=1).astype(complex)
    assert (np.diag(mac_matrix(found.estimate.shape, shape)) > 0.999).all()
    assert found.agreement.min() > 0.999


def test_response_of_zeros_has_no_agreement() -> None:
    """As of a model whose motion in one plane is not driven by a force in the other."""
    response = responses((0, 3))
    response[:, 1, 0] = 0.0
    agreement = identify_responses_all(LINE, response, CHANNELS, band=(2.0, 25.0)).agreement
    assert np.argwhere(np.isnan(agreement)).tolist() == [[1, 0]]


def test_storage_is_proportional_to_the_lines() -> None:
    """A square matrix of the lines of this mode has 236 MB."""
    line = np.arange(190.0, 310.0, 1 / 32)
    ratio = line / 250
    response = np.array(-(ratio**2) / (1 - ratio**2 + 0.08j * ratio), np.complex128)[:, None, None]
    lines = Lines(
        frequency=line,
        response=response,
        spacing=1 / 32,
        decay=0.0,
        line_noise=np.ones(len(line)),
        response_noise=np.ones((1, 1)),
    )
    tracemalloc.start()
    try:
        (found,) = fitted_modes([StablePole(frequency=250.0, damping=0.04, support=1.0)], lines)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.damping == pytest.approx(0.04, rel=1e-6)
    assert peak < 20e6


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="response: expected"):
        identify_responses(LINE, responses((0,))[:, :, 0], CHANNELS)
    with pytest.raises(ValueError, match="evenly spaced"):
        identify_responses(LINE**2, responses((0,)), CHANNELS)
    with pytest.raises(ValueError, match="expected finite values from 2 to 58 Hz"):
        identify_responses(LINE, responses((0,)) * np.nan, CHANNELS, (2.0, 58.0))
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

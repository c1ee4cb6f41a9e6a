"""Resonances read off frequency responses of a chain that is known, with and without noise."""

import numpy as np
import pytest

from oma import IdentificationError, fit_resonance

LINES = np.arange(0.1, 60, 0.05)  # Hz
MODES = ((10.0, 0.005, (0.1, 0.2)), (18.0, 0.004, (0.2, -0.1)), (31.0, 0.006, (0.1, 0.1)), (52.0, 0.006, (0.1, 0.1)))


def accelerance() -> np.ndarray:
    """Two responses to one force: the sum over modes, nothing left out."""
    w = 2 * np.pi * LINES[:, None]
    each = [
        -(w**2) * np.array(residue) / ((2 * np.pi * f) ** 2 - w**2 + 2j * z * 2 * np.pi * f * w)
        for f, z, residue in MODES
    ]
    return np.asarray(np.sum(each, axis=0))


@pytest.mark.parametrize("mode", range(3))
def test_modes_are_identified_from_noise_free_responses(mode: int) -> None:
    frequency, damping, residue = MODES[mode]
    found = fit_resonance(LINES, accelerance(), (0.8 * frequency, 1.2 * frequency))
    # what other modes' curvature leaves of a straight line over 1.2 Hz: 5e-5 of the resonance
    assert found.frequency == pytest.approx(frequency, rel=1e-6)
    assert found.damping == pytest.approx(damping, rel=1e-4)
    np.testing.assert_allclose(found.residue.real, residue, rtol=1e-3)
    assert found.misfit < 1e-4


def test_stated_deviations_equal_scatter_due_to_noise() -> None:
    random = np.random.default_rng(5)
    frequency, damping, residue = MODES[1]
    clean, z = accelerance(), []
    for _ in range(100):
        noise = random.standard_normal((*clean.shape, 2)) @ np.array([1, 1j])
        found = fit_resonance(LINES, clean + 0.015 * np.abs(clean).max() * noise, (15.0, 22.0))
        z.append(
            [
                (found.frequency - frequency) / found.frequency_std,
                (found.damping - damping) / found.damping_std,
                *(found.residue.real - residue) / found.residue_std,
            ]
        )
    spread = np.std(z, axis=0)
    # 100 draws tell a deviation to 7 %; those stated are of each draw's own noise, and scatter themselves
    assert np.all((spread > 0.7) & (spread < 1.35))
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.4)  # four deviations of a mean of 100


def test_band_without_resonance_is_refused() -> None:
    with pytest.raises(IdentificationError, match="no resonance"):
        fit_resonance(LINES, accelerance(), (33.0, 45.0))


def test_band_of_few_lines_is_refused() -> None:
    with pytest.raises(IdentificationError, match="expected 24 lines"):
        fit_resonance(LINES, accelerance(), (18.0, 18.5))


def test_one_dimensional_response_is_refused() -> None:
    with pytest.raises(ValueError, match="n_responses"):
        fit_resonance(LINES, accelerance()[:, 0], (15.0, 22.0))

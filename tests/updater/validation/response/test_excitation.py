"""Estimate of the excitation: the same as in the information form of the factor model, whatever the rounding."""

import numpy as np
import pytest

from daq import FloatArray
from oma import ComplexArray
from updater.validation.response.excitation import estimate_excitation
from updater.validation.response.modal_system import ModalSystem

_ITERATIONS = 60  # of `estimate_excitation`
_LINES = np.linspace(8.0, 32.0, 97)  # all of them near a resonance: none is thinned out
_SYSTEM = ModalSystem(frequency=np.array([12.0, 19.0, 27.0]), damping=np.array([0.06, 0.05, 0.05]))
_TOLERANCE = 1e-8  # relative: condition of 1e6 at the resonances, times rounding of 1e-16, times 60 steps
_NOISE = 1e-4  # [(m/s2)^2/Hz], a millionth of the signals' densities at the resonances


def _information_form(
    response: ComplexArray, matrices: ComplexArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return forces and noise after as many steps, by the posterior precision F^-1 + H^* N^-1 H of the forces."""
    back = response.conj().swapaxes(1, 2)
    power = share @ np.einsum("lcc->lc", matrices).real
    noise = 0.1 * power
    force = np.eye(response.shape[2]) * power.sum() / (share @ (np.abs(response) ** 2).sum((1, 2)))
    for _ in range(_ITERATIONS):
        posterior = np.linalg.inv(np.linalg.inv(force) + back / noise @ response)
        weight = posterior @ back / noise
        rest = np.eye(len(noise)) - response @ weight
        of_noise = rest @ matrices @ rest.conj().swapaxes(1, 2) + response @ posterior @ back
        moment = weight @ matrices @ weight.conj().swapaxes(1, 2) + posterior
        noise = share @ np.einsum("lcc->lc", of_noise).real
        force = np.tensordot(share, moment.real, 1)
        force = (force + force.T) / 2
    return force, noise


@pytest.mark.parametrize("n_channels", [5, 28])
def test_excitation_is_that_of_the_information_form(n_channels: int) -> None:
    """With few channels, and with more than modes."""
    random = np.random.default_rng(37)
    shape = random.normal(size=(n_channels, len(_SYSTEM.frequency)))
    response = shape * _SYSTEM.accelerance(_LINES)[:, None, :]
    true = np.array([[1.0, 0.3, 0.0], [0.3, 2.0, -0.5], [0.0, -0.5, 1.5]])
    density = response @ true @ response.conj().swapaxes(1, 2) + _NOISE * np.eye(n_channels)
    draws = random.normal(size=(2, len(_LINES), n_channels, 40)) / np.sqrt(2)  # of 40 blocks of a record
    signals = np.linalg.cholesky(density) @ (draws[0] + 1j * draws[1])
    matrices = signals @ signals.conj().swapaxes(1, 2) / draws.shape[-1]
    share = np.ones(len(_LINES))
    share[[0, -1]] = 0.5
    force, noise = _information_form(response, matrices, share / share.sum())
    found = estimate_excitation(_LINES, matrices, _SYSTEM, shape)
    np.testing.assert_allclose(found.force, force, rtol=_TOLERANCE, atol=_TOLERANCE * np.abs(force).max())
    np.testing.assert_allclose(found.noise, noise, rtol=_TOLERANCE)
    np.testing.assert_allclose(np.diag(found.force), np.diag(true), rtol=0.2)

"""Matrices that whiten the signals of a window: those of many channels are not kept in memory."""

import tracemalloc

import numpy as np
import pytest

from updater.validation import nonlinear_part
from updater.validation.nonlinear_part import ModalState, SignalWindow
from updater.validation.response.modal_system import ModalSystem

N_CHANNELS, N_MODES, N_SAMPLES, RATE = 16, 4, 1 << 13, 1000.0


def window() -> tuple[SignalWindow, ModalState]:
    random = np.random.default_rng(12)
    system = ModalSystem(frequency=np.linspace(20.0, 200.0, N_MODES), damping=np.full(N_MODES, 0.01))
    state = ModalState(system, np.eye(N_MODES), (5.0, 400.0))
    shape, data = random.normal(size=(N_CHANNELS, N_MODES)), random.normal(size=(N_SAMPLES, N_CHANNELS))
    return SignalWindow(state, shape, data, RATE), state


def test_matrices_made_anew_give_the_same_response_in_less_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The matrices of 0.79 * 2^12 lines, 8 bytes per element, are what is saved."""
    held, responses = [], []
    window()  # first use of parts of scipy
    for kept in (nonlinear_part._KEPT, 0):
        monkeypatch.setattr(nonlinear_part, "_KEPT", kept)
        tracemalloc.start()
        signals, state = window()
        held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
        responses.append(signals.response(state, np.ones(N_MODES)))
    for one, other in zip(*responses, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-12)
    assert held[0] - held[1] == pytest.approx(8 * 0.79 * N_SAMPLES / 2 * N_CHANNELS**2, rel=0.05)

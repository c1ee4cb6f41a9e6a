"""Sensors predicted from the others, on signals that were made of modes known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray, Recording
from tests.support.oma.structures import frame, simulate
from updater import ModalMean, virtual_sensing
from updater.validation import VirtualSensing

FRAME = frame()
NOISE = 0.02  # of the signals, at every sensor
SEED = 11


def known_modes(shape: FloatArray = FRAME.shapes) -> ModalMean:
    n, unknown = len(FRAME.frequency), np.full(shape.shape, np.nan)
    return ModalMean(
        channels=FRAME.channels,
        n=np.ones(n, np.intp),
        log_frequency=np.log(FRAME.frequency),
        log_frequency_std=np.full(n, 1e-4),
        damping=FRAME.damping,
        damping_std=np.full(n, np.nan),
        shape=shape / np.linalg.norm(shape, axis=1, keepdims=True),
        shape_std=np.full(shape.shape, 1e-3),
        imaginary=unknown,
        imaginary_std=unknown,
    )


@pytest.fixture(scope="module")
def recording() -> Recording:
    print(f"seed {SEED}")
    return simulate(FRAME, 60.0, 800.0, seed=SEED, noise=NOISE)


def heard(recording: Recording, factor: dict[str, float]) -> VirtualSensing:
    gain = np.array([factor.get(c.name, 1.0) for c in recording.channels])
    modes = known_modes()
    return virtual_sensing(replace(recording, data=recording.data * gain), modes, modes)


def test_correct_modes_predict_as_well_as_the_best_linear_filter(recording: Recording) -> None:
    """Within the third that a spectral matrix of a few dozen lines about a resonance leaves open."""
    found = heard(recording, {})
    assert (found.error < 1.35 * found.expected + 0.01).all()
    assert (found.error < 0.5).all()
    np.testing.assert_allclose(
        np.std(found.measured - found.predicted, axis=0) / np.std(found.measured, axis=0), found.error, rtol=1e-6
    )


@pytest.mark.parametrize("channel", ["col_074_y", "beam_left_y"])
def test_gain_error_increases_the_prediction_error_at_its_sensor(recording: Recording, channel: str) -> None:
    """The prediction is the true signal, so that a gain g leaves |1 - g| / g of its own signal."""
    at, right = FRAME.channels.index(channel), heard(recording, {}).error
    error = heard(recording, {channel: 0.7}).error
    assert int(np.argmax(error - right)) == at
    assert error[at] == pytest.approx(np.hypot(0.3 / 0.7, right[at]), rel=0.05)


def test_models_with_different_paired_modes_use_the_same_spectral_lines(recording: Recording) -> None:
    """The fourth mode is missing in one of two models: there it predicts nothing, elsewhere both agree."""
    every = known_modes()
    fewer = every.only(np.delete(np.arange(len(every.log_frequency)), 3))
    alone = virtual_sensing(recording, fewer, every)
    one, other = virtual_sensing(recording, fewer, every, [every]), virtual_sensing(recording, every, every, [fewer])
    assert len(alone.frequency) < len(one.frequency)
    np.testing.assert_array_equal(one.frequency, other.frequency)
    np.testing.assert_array_equal(one.spectrum, other.spectrum)
    ratio = np.sqrt(one.missed.sum(1) / one.spectrum.sum(1))
    near = np.abs(one.frequency / np.exp(every.log_frequency[3]) - 1) < 0.01
    assert near.any()
    np.testing.assert_allclose(ratio[near], 1.0, atol=0.1)


def test_gap_in_the_data_is_left_out(recording: Recording) -> None:
    data = recording.data.copy()
    data[1000:1100, 3] = np.nan
    modes = known_modes()
    found = virtual_sensing(replace(recording, data=data), modes, modes)
    assert found.start == recording.start + round(1100 / recording.rate * 1e9)
    assert np.isfinite(found.predicted).all()


def test_short_records_or_too_few_channels_are_refused(recording: Recording) -> None:
    modes = known_modes()
    short = replace(recording, data=recording.data[:20])
    with pytest.raises(ValueError, match="too short"):
        virtual_sensing(short, modes, modes)
    two = replace(recording, channels=recording.channels[:2], data=recording.data[:, :2])
    with pytest.raises(ValueError, match="expected at least 3, found 2"):
        virtual_sensing(two, modes, modes)

"""Measured compared with simulated modes, as plain values: the drawing agrees with the result."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from daq import Channel, FloatArray, Recording
from monitor.analysis.observation import Observation
from monitor.analysis.trends import trends_beside
from monitor.results.comparison import DiscrepancyResult
from monitor.results.correlation import discrepancy_result
from monitor.results.state_comparison import compare_states
from oma.windows import Windows
from tests.support.monitor import answers
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    DiagnosisResult,
    ModalMean,
    Reference,
    build_model,
    learn_reference,
    stack_tracks,
    virtual_sensing,
)
from updater.validation import modes_before

TRACK = np.arange(8)
BODY = Body(at=(0.2, 0, 1.48), mass=0.3)
SEED = 21


@pytest.fixture(scope="module")
def found() -> tuple[Reference, ModalMean, DiagnosisResult]:
    """A reference, the modes of a true frame with an unknown body, and its structure with the body."""
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    bare = true_model(np.random.default_rng((SEED, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(8)], [TRACK] * 8)
    changed = build_model(bare.structure.with_bodies((BODY,)), shear_flexible=True, mass="consistent")
    measured = reference.mean_of(stack_tracks([measure(changed, random, np.ones(12)) for _ in range(5)], [TRACK] * 5))
    return (
        reference,
        measured,
        DiagnosisResult(answers.diagnosis(), reference.structure.with_bodies((BODY,))),
    )


def signals(modes: ModalMean, random: np.random.Generator) -> Recording:
    """Every mode's own decaying noise at the measured shapes: narrow bands about the resonances."""
    rate, n = 1000.0, 1 << 15
    lines = np.fft.rfftfreq(n, 1 / rate)
    white = random.standard_normal((len(lines), 8)) + 1j * random.standard_normal((len(lines), 8))
    frequency = np.exp(modes.log_frequency)
    response = 1 / (1 - (lines[:, None] / frequency) ** 2 + 2j * modes.damping * lines[:, None] / frequency)
    data: FloatArray = np.fft.irfft((white * response) @ modes.shape, n, axis=0)
    data += 1e-3 * data.std() * random.standard_normal(data.shape)
    channels = tuple(Channel(name=c, device="import", axis=i) for i, c in enumerate(modes.channels))
    return Recording(channels=channels, data=data, rate=rate, start=0)


def test_causes_reduce_all_discrepancies(found: tuple[Reference, ModalMean, DiagnosisResult]) -> None:
    reference, measured, extended = found
    random = np.random.default_rng((SEED, 2))
    shown = discrepancy_result(reference, measured, extended, signals(measured, random))
    assert shown.note == ""
    pairs = [m for m in shown.modes if m.off_percent is not None]
    assert len(pairs) == 8
    before, after = (np.array([getattr(m, name) for m in pairs]) for name in ("off_percent", "off_percent_after"))
    assert np.sqrt((after**2).mean()) < 0.15 * np.sqrt((before**2).mean())
    for name in ("residual", "missed"):
        assert np.mean([getattr(s, name + "_after") for s in shown.sensors]) < 0.6 * np.mean(
            [getattr(s, name) for s in shown.sensors]
        )
    assert len(shown.signals) == 3
    assert shown.balance is not None
    assert shown.balance.log_odds > 5  # a mass it is
    peak = int(np.argmax([-1 if v is None else v for v in shown.balance.added]))
    assert np.linalg.norm(reference.model.nodes[peak] - BODY.at) < 0.185  # half a half wave of mode 8
    assert DiscrepancyResult.model_validate_json(shown.model_dump_json()) == shown


def test_mode_missing_in_the_reference_is_not_compared() -> None:
    random = np.random.default_rng((SEED, 5))
    bare = true_model(np.random.default_rng((SEED, 1)))
    lacking = np.array([0, 1, 2, 4, 5, 6, 7])
    windows = [measure(bare, random, np.ones(12)) for _ in range(13)]
    reference = learn_reference(t_frame(), windows[:8], [lacking] * 8)
    measured = reference.mean_of(stack_tracks(windows[8:], [TRACK] * 5))
    shown = discrepancy_result(reference, measured, DiagnosisResult(answers.diagnosis(), None))
    pairs = [m for m in shown.modes if m.measured is not None and m.simulated is not None]
    assert len(pairs) == 8
    (alone,) = [m for m in pairs if not m.compared]
    assert alone.measured == pytest.approx(float(np.exp(measured.log_frequency[3])))
    whole = learn_reference(t_frame(), windows[:8], [TRACK] * 8)
    assert all(
        m.compared for m in discrepancy_result(whole, measured, DiagnosisResult(answers.diagnosis(), None)).modes
    )


def test_plotted_signal_interpolates_the_measured_samples(
    found: tuple[Reference, ModalMean, DiagnosisResult],
) -> None:
    reference, measured, extended = found
    recording = signals(measured, np.random.default_rng((SEED, 3)))
    signal = discrepancy_result(reference, measured, extended, recording).signals[0]
    over = round(1 / (signal.step * recording.rate))
    first = round(signal.start * recording.rate)
    heard = virtual_sensing(recording, modes_before(reference, 1e9), measured)
    drawn, column = np.array(signal.measured)[::over], heard.channels.index(signal.channel)
    # cut to thrice its length before it is resampled: what is not periodic there spoils a little of it
    error = drawn - heard.measured[first : first + len(drawn), column]
    assert np.abs(error).max() < 0.02 * np.abs(drawn).max()


def test_record_too_short_for_prediction_is_noted(found: tuple[Reference, ModalMean, DiagnosisResult]) -> None:
    reference, measured, extended = found
    recording = signals(measured, np.random.default_rng((SEED, 4)))
    short = replace(recording, data=recording.data[:20])
    shown = discrepancy_result(reference, measured, extended, short)
    assert "too short" in shown.note
    assert not shown.signals
    assert all(s.missed is None for s in shown.sensors)


def test_residual_forces_of_sensor_faults_are_not_shown(
    found: tuple[Reference, ModalMean, DiagnosisResult],
) -> None:
    reference, measured, _ = found
    gain = answers.diagnosis().causes[1]
    only = answers.diagnosis().model_copy(update={"causes": (gain,)})
    shown = discrepancy_result(reference, measured, DiagnosisResult(only, None))
    assert shown.balance is None
    assert "caused by the sensors" in shown.note


def observation(temperature: FloatArray, rms: FloatArray, change: FloatArray) -> Observation:
    """Windows whose first mode changes: change (n_windows,) of its log frequency."""
    random = np.random.default_rng(SEED)
    whole = measure(true_model(np.random.default_rng(SEED)), random, np.ones(12))
    estimates = tuple(
        replace(whole, frequency=whole.frequency * np.exp(np.r_[c, np.zeros(7)]), start=i, end=i + 1)
        for i, c in enumerate(change)
    )
    windows: Any = Windows.__new__(Windows)
    return Observation(
        windows=windows, estimates=estimates, tracks=(TRACK,) * len(change), temperature=temperature, rms=rms
    )


def test_trend_is_estimated_only_over_quantities_that_vary() -> None:
    random = np.random.default_rng(SEED)
    temperature = np.linspace(10, 30, 12)
    noise = 2e-4 * random.standard_normal(12)
    shown = trends_beside(observation(temperature, np.full(12, 0.02), -2e-4 * temperature + noise))
    assert {t.over for t in shown} == {"temperature"}
    first, *others = shown
    assert abs(first.slope + 0.02) < 4 * first.slope_std  # per cent a kelvin
    assert 0 < first.slope_std < 0.005
    assert all(abs(t.slope) < 4 * t.slope_std for t in others)
    still = trends_beside(observation(np.full(12, np.nan), np.full(12, 0.02), noise))
    assert still == ()


def test_trend_over_amplitude_has_its_own_unit() -> None:
    rms = np.linspace(0.01, 0.05, 8)
    shown = trends_beside(observation(np.full(8, 20.0), rms, -0.1 * rms))
    assert {(t.over, t.unit) for t in shown} == {("amplitude", "mm/s²")}
    assert shown[0].slope == pytest.approx(-0.1 * 100 / 1000, rel=1e-6)


def test_shapes_with_the_causes_are_nearer_to_those_measured(
    found: tuple[Reference, ModalMean, DiagnosisResult],
) -> None:
    reference, measured, extended = found
    states = compare_states(reference, measured, extended, None, None)
    assert len(states.shapes) == 8
    frequency = [mode.frequency for mode in states.shapes]
    np.testing.assert_allclose(frequency, np.sort(np.exp(measured.log_frequency)))
    before, after = [], []
    for mode in states.shapes:
        assert np.abs(mode.now).max() == pytest.approx(1.0)
        assert mode.with_causes is not None
        before.append(np.linalg.norm(mode.before - mode.now))
        after.append(np.linalg.norm(mode.with_causes - mode.now))
    assert np.linalg.norm(after) < 0.6 * np.linalg.norm(before)  # as the residuals of the sensors above
    plain = compare_states(reference, measured, DiagnosisResult(answers.diagnosis(), None), None, None)
    assert all(mode.with_causes is None for mode in plain.shapes)

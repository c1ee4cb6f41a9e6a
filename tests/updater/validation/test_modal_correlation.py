"""Modes and sensors compared: closed forms, pure noise, and an extended model with the truth."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    ModalDataError,
    ModalMean,
    build_model,
    correlate_modes,
    learn_reference,
    mean_modes,
    stack_tracks,
)
from updater.structure import Correction
from updater.validation import modes_before, modes_with_causes

TRACK = np.arange(8)
STD = 3e-3


def modes(random: np.random.Generator, n: int = 6, n_channels: int = 9) -> ModalMean:
    """Modes whose shapes are unrelated, with one thing in common: every sensor moves."""
    shape: FloatArray = np.linalg.qr(random.standard_normal((n_channels, n)))[0].T
    estimate = replace(
        measure(true_model(random), random, np.ones(12)),
        channels=tuple(f"s{i}" for i in range(n_channels)),
        frequency=np.geomspace(5, 80, n),
        frequency_std=np.full(n, 0.01),
        damping=np.full(n, 0.01),
        damping_std=np.full(n, 0.001),
        shape=shape.astype(complex),
        shape_std=np.full(shape.shape, STD),
        support=np.ones(n),
        law_ratio=np.ones(n),
    )
    return mean_modes(stack_tracks([estimate], [np.arange(n)]))


def scaled(event: ModalMean, factor: FloatArray) -> ModalMean:
    shape = event.shape * factor
    return replace(event, shape=shape / np.linalg.norm(shape, axis=1, keepdims=True))


@pytest.fixture
def random() -> np.random.Generator:
    print("seed 5")
    return np.random.default_rng(5)


def test_identical_modes_have_no_residual(random: np.random.Generator) -> None:
    same = modes(random)
    found = correlate_modes(same, same)
    assert found.partner.tolist() == list(range(6))
    np.testing.assert_allclose(found.off, 0, atol=1e-12)
    np.testing.assert_allclose(found.comac, 1)
    np.testing.assert_allclose(found.residual, 0, atol=1e-12)
    np.testing.assert_allclose(np.diag(found.mac), 1)


def test_unpaired_modes_are_listed(random: np.random.Generator) -> None:
    every = modes(random)
    found = correlate_modes(every.only(np.array([0, 1, 2, 4, 5])), every.only(np.array([0, 2, 3, 4, 5])))
    assert found.partner.tolist() == [0, -1, 1, 3, 4]
    assert found.unseen.tolist() == [1]
    assert found.extra.tolist() == [2]
    assert np.isnan(found.off[1])


def test_gain_error_appears_in_the_sensor_residual_but_not_comac(random: np.random.Generator) -> None:
    """sum |g phi phi'| squared over the squares does not see a factor g common to all modes, to first order."""
    before = modes(random)
    found = correlate_modes(before, scaled(before, np.where(np.arange(9) == 4, 0.8, 1.0)))
    assert int(np.argmax(found.residual)) == 4
    others = np.delete(found.residual, 4)
    assert found.residual[4] > 3 * others.max()
    assert found.comac[4] > 0.99


def test_sensor_unrelated_to_the_modes_has_the_lowest_comac(random: np.random.Generator) -> None:
    before = modes(random)
    shape = before.shape.copy()
    shape[:, 6] = 0.3 * random.standard_normal(6)
    found = correlate_modes(before, scaled(replace(before, shape=shape), np.ones(9)))
    assert int(np.argmin(found.comac)) == 6


def test_residuals_of_noise_match_their_stated_deviations(random: np.random.Generator) -> None:
    """Thirty draws of six modes at nine sensors: 270 residuals of 5.3 degrees of freedom each, 3 % of their mean."""
    before = replace(modes(random), shape_std=np.full((6, 9), 1e-9))
    rest = []
    for _ in range(30):
        shape = before.shape + STD * random.standard_normal((6, 9))
        now = scaled(replace(before, shape=shape, shape_std=np.full((6, 9), STD)), np.ones(9))
        found = correlate_modes(before, now)
        rest.append((found.residual / found.residual_std) ** 2)
    # unit norm and best scale take one of nine components
    assert np.mean(rest) == pytest.approx(8 / 9, abs=0.12)


def test_fewer_than_two_common_channels_are_refused(random: np.random.Generator) -> None:
    before = modes(random)
    with pytest.raises(ModalDataError, match="expected at least 2 in both, found 0"):
        correlate_modes(before, replace(before, channels=tuple(f"other{i}" for i in range(9))))


def test_extended_model_modes_match_the_changed_structure() -> None:
    """The truth has finer elements, springs and another stiffness; the errors of both models cancel to first order."""
    random = np.random.default_rng(6)
    body = Body(at=(0.2, 0, 1.48), mass=0.3)
    bare = true_model(np.random.default_rng(7))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(8)], [TRACK] * 8)
    changed = build_model(bare.structure.with_bodies((body,)), shear_flexible=True, mass="consistent")
    measured = mean_modes(stack_tracks([measure(changed, random, np.ones(12)) for _ in range(8)], [TRACK] * 8))
    expected = modes_before(reference, float(np.exp(measured.log_frequency.max())))
    before = correlate_modes(expected, measured)
    extended = reference.structure.with_bodies((body,))
    after = correlate_modes(modes_with_causes(reference, extended, expected), measured)
    assert not len(after.extra)
    error = [float(np.sqrt(np.nanmean(d.off**2))) for d in (before, after)]
    assert error[1] < 0.1 * error[0]  # 3 to 5 % before; modal truncation and the frame's own errors leave 0.1 %
    assert after.residual.max() < 0.5 * before.residual.max()


def test_mode_without_model_partner_is_compared_with_the_baseline() -> None:
    """For a portal it was reported as 163 standard deviations from the model's nearest, where nothing had changed."""
    random = np.random.default_rng(8)
    bare = true_model(np.random.default_rng(9))
    windows = [measure(bare, random, np.ones(12)) for _ in range(16)]
    modes = mean_modes(stack_tracks(windows[8:], [TRACK] * 8))
    reference = learn_reference(t_frame(), windows[:8], [TRACK] * 8)
    last = np.arange(8) == 7
    calibration = reference.calibration.only(~last)
    baseline, lone = reference.baseline.only(np.flatnonzero(~last)), reference.baseline.only(np.flatnonzero(last))
    far = np.where(last, 0.1, 0.0)  # of ln f: what the model is off by
    reference = replace(
        reference,
        calibration=calibration,
        baseline=baseline,
        unpaired_modes=replace(lone, log_frequency=lone.log_frequency + 0.1),
    )
    modes = replace(modes, log_frequency=modes.log_frequency + far)
    found = correlate_modes(modes_before(reference, float(np.exp(modes.log_frequency.max()))), modes)
    row = int(np.flatnonzero(found.partner == 7)[0])
    assert abs(found.off[row]) < 4 * found.off_std[row]
    assert not len(found.extra)
    assert not len(found.unseen)


def test_expected_shapes_of_exchanged_channels_are_exchanged() -> None:
    """The difference between two models left a MAC of 0.53 for a portal whose exchanged channels were found."""
    random = np.random.default_rng(10)
    bare = true_model(np.random.default_rng(11))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(4)], [TRACK] * 4)
    expected = modes_before(reference, 1e3)
    one, other = expected.channels[0], expected.channels[-1]
    exchanged = {one: Correction(channel=other), other: Correction(channel=one)}
    found = modes_with_causes(reference, reference.structure.model_copy(update={"sensors": exchanged}), expected)
    assert found.channels == expected.channels
    order = [11, *range(1, 11), 0]
    np.testing.assert_allclose(np.abs(found.shape), np.abs(expected.shape[:, order]), atol=1e-9)

"""Errors of shapes relative to the baseline's, where they are known."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import scipy.linalg

from daq import FloatArray
from oma import ComplexArray
from tests.support.updater.diagnosis_data import CHANNELS, TRACK, Change, learnt
from updater import Body
from updater.inference import beside
from updater.inference.shape_covariance import (
    along_changed_modes,
    foreign_modes,
    mixed_by_change,
    own_phases,
    shape_whiteners,
    turned_back,
    turned_by_noise,
)
from updater.modal_data.device_delays import split_shape
from updater.reference import Reference


@pytest.mark.parametrize("seed", range(3))
def test_rotation_of_shape_residuals_keeps_lengths_and_angles(seed: int) -> None:
    """A rotation, to rounding; for any sign and size of the prediction."""
    random = np.random.default_rng(seed)
    base = random.standard_normal((4, 12))
    base /= np.linalg.norm(base, axis=1, keepdims=True)
    shape = -3.0 * (base + 0.3 * random.standard_normal((5, 4, 12)))
    rest = beside(random.standard_normal((5, 4, 12)), shape)
    other = beside(random.standard_normal((5, 4, 12)), shape)
    turned, as_well = turned_back(rest, shape, base), turned_back(other, shape, base)
    np.testing.assert_allclose((turned * base).sum(-1), 0, atol=1e-12)
    np.testing.assert_allclose((turned * as_well).sum(-1), (rest * other).sum(-1), atol=1e-12)


def test_residual_of_a_rotated_mode_lies_along_the_other_mode() -> None:
    """By half a radian; the cosine's 12 % of its own shape are in the rotation, not in the rest."""
    own, other = np.eye(12)[[2]], np.eye(12)[[7]]
    shape = np.cos(0.5) * own + np.sin(0.5) * other
    rest = turned_back(beside(own, shape), shape, own)
    assert np.linalg.norm(rest - (rest * other).sum() * other) < 1e-12
    assert abs((rest * other).sum()) == pytest.approx(np.sin(0.5))


@pytest.mark.parametrize("degrees", [0.0, 60.0, 80.0, 99.0])
def test_shape_deviation_grows_with_phase_uncertainty(degrees: float) -> None:
    """One of two channels late by about a quarter period; 4000 times tell a deviation to 1 / sqrt(8000) = 1.1 %."""
    random, noise = np.random.default_rng(9), 1e-3
    exact: ComplexArray = np.array([0.7, 0.7, 0.1]) * np.exp(-1j * np.radians([0.0, degrees, 0.0]))
    off = noise * (random.standard_normal((4000, 3)) + 1j * random.standard_normal((4000, 3)))
    shape, imaginary = (part[:1] for part in split_shape(exact[None]))
    size = np.linalg.norm(exact) / np.sqrt(1 + (imaginary**2).sum())  # of the real part, which is given unit norm
    found = split_shape(exact + off)[0]
    rest = turned_back(beside(found * np.sign(found @ shape[0])[:, None], shape[0]), shape, shape)
    variance = np.full((1, 3), (noise / size) ** 2)
    turn = own_phases(shape, imaginary, variance, shape)[0, 0]
    along = turn / np.linalg.norm(turn) if degrees else np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    expected = np.hypot(turn @ along, noise / size)
    assert (rest @ along).std() == pytest.approx(expected, rel=4 * 0.011)


def test_noise_mixes_close_modes() -> None:
    """By a frequency's deviation over their distance; then by all that is stated of their shapes."""
    reference, _, _ = learnt(612)
    f, at_channels = reference.frequency, reference.at_channels(CHANNELS)
    gap = abs(np.log(f[1] / f[0]))
    assert gap < 0.03
    assert abs(np.log(f[2] / f[0])) > 1

    def share(frequency_std: float, shape_std: float) -> FloatArray:
        mean = replace(
            reference.baseline,
            log_frequency_std=np.full(8, frequency_std),
            shape_std=np.full((8, 12), shape_std / np.sqrt(12)),
        )
        turned = turned_by_noise(reference, TRACK, np.zeros(len(f)), at_channels, (mean, mean))
        return np.asarray(np.linalg.norm(turned, axis=2))

    little = share(1e-4, 0.01)[0]
    assert little[0] == 0
    louder = np.linalg.norm(at_channels[:, 1]) / np.linalg.norm(at_channels[:, 0])
    assert little[1] == pytest.approx(louder * np.sqrt(2) * 1e-4 / gap, rel=0.05)
    assert (little[2:] < 3e-4).all()
    assert share(0.3 * gap, 0.2)[0, 1] == pytest.approx(min(0.5, np.sqrt(2) * np.hypot(0.3, 0.2)) * louder, rel=0.05)


@pytest.mark.parametrize("turned", [0.0, 0.3, 0.6])
def test_modes_mix_along_their_changed_shapes(turned: float) -> None:
    """A change alters one of two modes by 0.2 rad; then noise turns both, whose share has the deviation 0.5.

    The residual of a right prediction is that rotation, sin(turned) / 0.5 deviations, along the other mode as it is
    now. Its two parts count as independent: chi-square is at most twice as large. Without the altered part the
    residual is also sin(0.2) sin(turned) over the channels' deviation, up to 56 here.
    """
    own, other, altered = np.eye(12)[[2, 7, 9]]
    base, now = np.array([own, other]), np.array([own, np.cos(0.2) * other + np.sin(0.2) * altered])
    cos, sin = np.cos(turned), np.sin(turned)
    measured = np.array([[cos, sin], [-sin, cos]]) @ now
    share, at_channels = 0.5 * (1 - np.eye(2)), 3.0 * base.T
    foreign = share[:, :, None] * base
    rest = turned_back(beside(measured, now), now, base)

    def chi_square(errors: FloatArray) -> FloatArray:
        whitener = shape_whiteners(np.full((2, 12), 2e-3**2), base, errors)
        return np.asarray((np.einsum("ijk,ik->ij", whitener, rest) ** 2).sum(1))

    extra = along_changed_modes(share, np.arange(2), at_channels, base, measured)
    np.testing.assert_allclose((extra * base[:, None]).sum(-1), 0, atol=1e-12)
    found = chi_square(np.concatenate([foreign, extra], axis=1))
    print(found, chi_square(foreign))
    assert (found < 2 * (sin / 0.5) ** 2 + 1e-3).all()
    if turned:
        assert chi_square(foreign).max() > 100


@pytest.mark.parametrize("known", [True, False])
def test_error_of_a_shape_by_a_mode_that_comes_close_without_being_measured(known: bool) -> None:
    """A model whose modes are turned into each other by 0.01 rad, and a spring that shifts the second one by 12 %.

    The first mode remains as it was: its predicted shape turns by the model's error. The stated deviation is the root
    mean square of that, but for the flexibility, of which the first order in the shift is stated and as if both modes
    had one frequency. Without the shift of the second mode the stated deviation is far smaller.
    """
    gap, shift, error = 0.15, -0.12, 0.01
    frequency = np.array([100.0, 100.0 * np.exp(gap)])
    flexibility = (2 * np.pi * frequency) ** -2.0
    added = flexibility[1] * (np.exp(-2 * shift) - 1)
    random = np.random.default_rng(5)
    turns = []
    for turn in error * random.standard_normal(200):
        spring = np.array([-np.sin(turn), np.cos(turn)])  # on the second mode alone, in the modes of the model
        vector = np.linalg.eigh(np.diag(flexibility) + added * np.outer(spring, spring))[1]
        first = vector[:, np.argmax(np.abs(vector[0]))]
        turns.append(np.arctan(first[1] / first[0]))
    reference = cast("Reference", SimpleNamespace(frequency=frequency, paired=np.arange(2)))
    ratio = np.array([0.0, shift if known else np.nan])
    stated = np.linalg.norm(foreign_modes(reference, np.arange(1), ratio, np.eye(2), np.full(2, error))[0], axis=1)
    print("rms", np.sqrt(np.mean(np.square(turns))), "stated", stated)
    assert stated[0] == 0
    if known:
        exact = np.expm1(-2 * shift) * np.exp(-2 * gap) / (-2 * shift)
        of_rms = 3 / np.sqrt(2 * len(turns))
        assert exact * stated[1] == pytest.approx(np.sqrt(np.mean(np.square(turns))), rel=of_rms)
    else:
        assert stated[1] < 1e-3


def test_poor_reference_has_larger_model_error_factor() -> None:
    """400 g that the model lacks: its frequencies are 1.6 % off after calibration."""
    plain, _, _ = learnt(611)
    laden, _, _ = learnt(611, Change(bodies=(Body(at=(0, 0, 0.7), mass=0.4),)))
    assert plain.model_error_factor == 1.0
    assert laden.model_error_factor > 2.0


@pytest.mark.parametrize("gap", [0.05, 0.1, 0.3])
def test_mode_mixing_by_a_body_matches_the_two_mode_solution(gap: float) -> None:
    """Unit modal displacements at the body: exact modes of K b = omega^2 (1 + m J) b, where they turn little."""
    frequency, mass = np.array([10.0, 10.0 * (1 + gap)]), 0.004
    stiffness = np.diag((2 * np.pi * frequency) ** 2)
    value, vector = scipy.linalg.eigh(stiffness, np.eye(2) + mass)
    ratio = np.log(np.sqrt(value) / (2 * np.pi) / frequency)
    reference = cast("Reference", SimpleNamespace(frequency=frequency, paired=np.arange(2)))
    found = mixed_by_change(reference, np.arange(2), ratio)
    turned = vector / np.linalg.norm(vector, axis=0)
    np.testing.assert_allclose(found, [turned[1, 0] ** 2, turned[0, 1] ** 2], rtol=0.35)


def test_only_changed_close_modes_may_mix_completely() -> None:
    reference = cast("Reference", SimpleNamespace(frequency=np.array([10.0, 10.05, 40.0]), paired=np.arange(3)))
    tracks = np.arange(3)
    changed = mixed_by_change(reference, tracks, np.array([-0.01, -0.01, -0.01]))
    np.testing.assert_allclose(changed[:2], 1.0)
    assert changed[2] < 1e-3
    np.testing.assert_allclose(mixed_by_change(reference, tracks, np.zeros(3)), 0.0)

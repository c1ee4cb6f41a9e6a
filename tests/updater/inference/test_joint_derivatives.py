"""Derivatives of joint hypotheses, each cause moved by itself, against finite differences of all together."""

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, build_model, learn_reference, matched, stack_tracks
from updater.causes import JointHypothesis, SelectedCause
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare, evaluate, slopes

TRACK, GAIN = np.arange(8), np.ones(12)
NAMES = ("added_mass", "local_stiffness", "attached_oscillator", "sensor_gain", "sensor_delay")
H = 1e-3  # step of the central differences, in prior standard deviations
# relative to the largest derivative of a parameter: forward steps of 1e-4 and central ones of 1e-3 deviations leave
# 1e-4 and 1e-6 of the curvature relative to the slope, which is up to some tens near a start
TOLERANCE = 5e-3


@pytest.fixture(scope="module")
def weighing() -> EvidenceComparison:
    random, model = np.random.default_rng(981), true_model(np.random.default_rng(982))
    reference = learn_reference(t_frame(), [measure(model, random, GAIN) for _ in range(8)], [TRACK] * 8)
    heavier = model.structure.with_bodies([Body(at=(0.25, 0.0, 1.48), mass=0.3)])
    changed = build_model(heavier, shear_flexible=True, mass="consistent")
    windows = stack_tracks([measure(changed, random, GAIN) for _ in range(5)], [TRACK] * 5)
    return EvidenceComparison(
        reference, compare(reference, matched(reference.baseline, reference.mean_of(windows))), allowed=NAMES
    )


def middle(weighing: EvidenceComparison, name: str) -> SelectedCause:
    """Return the middle alternative of a cause, somewhat away from its start."""
    cause = weighing.causes[name]
    row = len(cause.log_prior) // 2
    return SelectedCause(cause, row, cause.start[row] + 0.05 * cause.prior_std)


@pytest.mark.parametrize("other", NAMES)
@pytest.mark.parametrize(
    ("free", "neutral"),
    [
        (name, neutral)
        for name in NAMES
        for neutral in (True, False)
        if (name, neutral) != ("attached_oscillator", True)
    ],
)
def test_derivatives_of_joint_hypotheses(weighing: EvidenceComparison, free: str, other: str, neutral: bool) -> None:
    """At a common start, where derivatives by other causes' parameters are computed once, and away from it."""
    hypothesis = JointHypothesis(weighing.causes[free], (middle(weighing, other),), start_neutral=neutral)
    every, std, data = np.arange(len(hypothesis.start)), hypothesis.prior_std, weighing.data
    theta = hypothesis.start + (0.0 if neutral else 0.05) * std
    rows = every[:: max(len(every) // 4, 1)]
    found = slopes(data, hypothesis, evaluate(data, hypothesis, theta, every), rows)
    for k, step in enumerate(H * std):
        ahead, behind = (evaluate(data, hypothesis, _moved(theta[rows], k, d), rows).residual for d in (step, -step))
        expected = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(found[:, :, k], expected, atol=TOLERANCE * np.abs(expected).max())


def _moved(theta: FloatArray, parameter: int, step: float) -> FloatArray:
    moved = theta.copy()
    moved[:, parameter] += step
    return moved

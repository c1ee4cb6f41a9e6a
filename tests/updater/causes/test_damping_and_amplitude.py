"""Damping that has changed, and joints that soften as the frame shakes harder."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from daq import FloatArray
from oma import ModalEstimate
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Circumstances,
    Diagnosis,
    Model,
    Reference,
    build_model,
    diagnose,
    learn_reference,
    match_modes,
    matched,
    stack_tracks,
)
from updater.modal_data import trend_of

TRACK = np.arange(8)
GAIN = np.ones(12)


@pytest.fixture(scope="module")
def learnt() -> tuple[Reference, Model]:
    random = np.random.default_rng(951)
    bare = true_model(np.random.default_rng(952))
    return learn_reference(t_frame(), [measure(bare, random, GAIN) for _ in range(8)], [TRACK] * 8), bare


@lru_cache(maxsize=16)  # windows of one level have their model in common
def softened(model: Model, share: float) -> Model:
    """The frame with its foot's bending and joint's springs at a share of their stiffness."""
    parts: dict[str, object] = {}
    for name in ("support", "joint"):
        (part,) = getattr(model.structure, name)
        stiffness = {axis: k * share for axis, k in part.stiffness.items()}
        parts[name] = (part.model_copy(update={"stiffness": stiffness}),)
    return build_model(model.structure.model_copy(update=parts), shear_flexible=True, mass="consistent")


def judged(reference: Reference, windows: list[ModalEstimate], circumstances: Circumstances | None = None) -> Diagnosis:
    event = reference.mean_of(stack_tracks(windows, [TRACK] * len(windows)))
    known = circumstances or Circumstances()
    return diagnose(reference, matched(reference.baseline, event), circumstances=known).diagnosis


def named(diagnosis: Diagnosis) -> list[str]:
    return [cause.cause for cause in diagnosis.causes]


@pytest.mark.parametrize(("modes", "factor"), few_of([(range(8), 1.7), ([2], 3.0), (range(8), 0.6)]))
def test_damping_change_is_diagnosed_with_its_factor(
    learnt: tuple[Reference, Model], modes: range | list[int], factor: float
) -> None:
    reference, bare = learnt
    random = np.random.default_rng(961)
    change = np.ones(8)
    change[list(modes)] = factor
    windows = [measure(bare, random, GAIN) for _ in range(5)]
    diagnosis = judged(reference, [replace(w, damping=w.damping * change) for w in windows])
    assert (diagnosis.verdict, named(diagnosis)) == ("explained", ["damping_change"])
    (cause,) = diagnosis.causes
    assert abs(cause.parameters["factor"].value - factor) < 4 * cause.parameters["factor"].std
    assert ("frequency" in cause.parameters) == (len(modes) == 1)
    if len(modes) == 1:
        assert cause.parameters["frequency"].value == pytest.approx(bare.modes(3).frequency[2], rel=0.01)


def test_frequency_bias_from_damping_is_no_second_cause(learnt: tuple[Reference, Model]) -> None:
    """Analysis puts frequencies up to a tenth of the half bandwidth too high; damping of 0.4 % has become 1.2 %."""
    reference, bare = learnt
    random = np.random.default_rng(962)
    share = random.uniform(0.03, 0.1, 8)
    windows = [measure(bare, random, GAIN) for _ in range(5)]
    wider = [replace(w, damping=3 * w.damping, frequency=w.frequency * (1 + share * 2 * w.damping)) for w in windows]
    diagnosis = judged(reference, wider)
    assert (diagnosis.verdict, named(diagnosis)) == ("explained", ["damping_change"])


def levels(
    reference: Reference, bare: Model, random: np.random.Generator, rms: FloatArray, loss: float
) -> tuple[list[ModalEstimate], Circumstances]:
    """Windows of a frame whose springs lose a share `loss` of their stiffness per m/s2 of rms."""
    windows = [measure(softened(bare, 1 - loss * level), random, GAIN) for level in rms.tolist()]
    tracked = stack_tracks(windows, [TRACK] * len(windows))
    found = match_modes(reference.baseline, reference.mean_of(tracked))
    trend = trend_of(tracked.tracks(found), rms, (reference.windows, np.full(8, 0.02)))
    return windows, Circumstances(trend=trend)


def test_amplitude_softening_is_diagnosed_with_its_slope(learnt: tuple[Reference, Model]) -> None:
    """Springs of foot and joint at 60 % of their values at rest where the level is highest."""
    reference, bare = learnt
    rms = np.linspace(0.02, 0.5, 8)
    windows, known = levels(reference, bare, np.random.default_rng(971), rms, 0.8)
    diagnosis = judged(reference, windows, known)
    assert (diagnosis.verdict, named(diagnosis)) == ("explained", ["amplitude_softening"])
    true = [np.log(softened(bare, 1 - 0.8 * r).modes(8).frequency) for r in rms.tolist()]
    slope = float(np.polyfit(rms, np.array(true), 1)[0].mean())
    found = diagnosis.causes[0].parameters["slope"]
    assert slope < 0
    assert abs(found.value - slope) < 4 * found.std


@pytest.mark.parametrize("seed", few_of([981, 982]))
def test_level_variation_without_softening_is_no_change(learnt: tuple[Reference, Model], seed: int) -> None:
    print(f"seed {seed}")
    reference, bare = learnt
    windows, known = levels(reference, bare, np.random.default_rng(seed), np.linspace(0.02, 0.5, 8), 0.0)
    assert known.trend is not None
    assert judged(reference, windows, known).verdict == "nothing_to_explain"


@pytest.mark.thorough
def test_amplitude_trend_already_in_the_baseline_is_no_change(learnt: tuple[Reference, Model]) -> None:
    """The same softening in the baseline's windows, at the same levels."""
    _, bare = learnt
    random, rms = np.random.default_rng(991), np.linspace(0.02, 0.5, 8)
    both = [[measure(softened(bare, 1 - 0.6 * r), random, GAIN) for r in rms.tolist()] for _ in range(2)]
    reference = learn_reference(t_frame(), both[0], [TRACK] * 8)
    tracked = stack_tracks(both[1], [TRACK] * 8)
    found = match_modes(reference.baseline, reference.mean_of(tracked))
    trend = trend_of(tracked.tracks(found), rms, (reference.windows, rms))
    assert trend is not None
    assert trend.excess == pytest.approx(0)
    assert judged(reference, both[1], Circumstances(trend=trend)).verdict == "nothing_to_explain"


def test_constant_level_or_few_windows_give_no_trend(learnt: tuple[Reference, Model]) -> None:
    assert trend_of(learnt[0].windows, np.full(8, 0.3) + 0.001 * np.arange(8)) is None
    assert trend_of(learnt[0].windows.windows(np.arange(3)), np.array([0.1, 0.3, 0.5])) is None

"""New modes of a log, and uncertain ones."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from tests.examiner.designs import BRIDGE
from tests.examiner.models.specimen import State
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import ModalMean, Reference, learn_reference
from updater.reference import matched_and_new, matched_surely

SEED = 71


def _windows(n: int, keep: np.ndarray) -> tuple[Reference, ModalMean]:
    """Return a reference of the kept modes, and the results of later windows for all eight."""
    random, model = np.random.default_rng(SEED), true_model(np.random.default_rng(1))
    windows = [measure(model, random, np.ones(12)) for _ in range(2 * n)]
    reference = learn_reference(t_frame(), windows[:n], [keep] * n)
    return reference, learn_reference(t_frame(), windows[n:], [np.arange(8)] * n).baseline


def test_model_mode_missing_in_the_baseline_is_not_new() -> None:
    """The first two lie 2 % apart and are not always distinguished; one elsewhere is new."""
    reference, event = _windows(5, np.arange(1, 8))
    found, new = matched_and_new(reference, event)
    np.testing.assert_array_equal(found, np.arange(1, 8))
    assert not len(new)
    shift = np.log(20.0) - event.log_frequency[0]
    higher = replace(event, log_frequency=event.log_frequency + shift * (np.arange(8) == 0))
    np.testing.assert_array_equal(matched_and_new(reference, higher)[1], [0])


def test_second_mode_close_to_a_paired_mode_is_new() -> None:
    """An attached part may split a mode in two similar ones."""
    reference, event = _windows(5, np.arange(8))
    double = event.only(np.array([2]))
    double = replace(double, log_frequency=double.log_frequency - 0.02)
    found, new = matched_and_new(reference, event.joined(double))
    np.testing.assert_array_equal(found, np.arange(8))
    np.testing.assert_array_equal(new, [8])


@lru_cache
def _bridge() -> tuple[State, Reference]:
    """Return a bridge on two bearings and its reference."""
    state = BRIDGE.draw(SEED)
    before = observation(state, estimated(state, 8, np.random.default_rng(SEED), noise="law"))
    tracks, delays = before.tracks, before.lateness.delays
    return state, learn_reference(structure_of("bridge: "), before.estimates, tracks, delays)


def test_baseline_mode_with_two_possible_partners_is_not_compared() -> None:
    """A bearing that keeps 15 % of its stiffness takes the fifth bending mode half of the way to the next one."""
    state, reference = _bridge()
    first, last = state.frame.grounds
    soft = replace(last, along=(*last.along[:2], 0.15 * last.along[2]))
    after = state.of_frame(replace(state.frame, grounds=(first, soft)))
    windows = observation(after, estimated(after, 5, np.random.default_rng(SEED + 1), noise="law"))
    event = reference.mean_of(windows.modes)
    found, new = matched_and_new(reference, event)
    fifth = int(np.argmin(np.abs(np.exp(reference.baseline.log_frequency) - 137)))
    np.testing.assert_array_equal(np.flatnonzero(found < 0), [fifth])
    assert not len(new)
    followed = np.exp(event.log_frequency[np.setdiff1d(np.arange(len(event.n)), found)])
    print(f"left out: {np.exp(reference.baseline.log_frequency[fifth]):.1f} Hz before, {followed.round(1)} Hz after")
    assert len(followed) == 2


@pytest.mark.parametrize("away", [-0.01, 0.01])
def test_bending_mode_and_similar_torsion_mode_are_not_compared(away: float) -> None:
    """The bridge twists at 110.8 Hz, which its sensors, all on its axis, only see where that mixes with bending."""
    _, reference = _bridge()
    event = reference.baseline
    (bending,) = np.flatnonzero(np.abs(np.exp(event.log_frequency) - 112) < 2)
    assert reference.ambiguous_tracks[bending]
    twist = event.only(np.array([bending]))
    both = event.joined(replace(twist, log_frequency=twist.log_frequency + away))
    found, new = matched_and_new(reference, both)
    assert found[bending] == -1
    assert not len(new)
    reported = matched_surely(reference, both)
    assert np.isnan(reported.log_frequency[bending])
    np.testing.assert_array_equal(np.delete(reported.log_frequency, bending), np.delete(event.log_frequency, bending))

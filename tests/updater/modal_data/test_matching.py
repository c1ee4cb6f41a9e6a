"""Modes of two logs are paired whatever happened between."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, ModalMean, match_modes, matched, mean_modes, stack_tracks
from updater.modal_data import without_fault

CHANNELS = t_frame().channels


def mean(seed: int, body: Body | None = None) -> ModalMean:
    random = np.random.default_rng(seed)
    model = true_model(np.random.default_rng(1), body)
    return mean_modes(stack_tracks([measure(model, random, np.ones(12)) for _ in range(3)], [np.arange(8)] * 3))


def reordered(modes: ModalMean, order: np.ndarray) -> ModalMean:
    return modes.only(order)


def test_matching_does_not_depend_on_order_or_missing_modes() -> None:
    order = np.array([3, 1, 0, 7, 5, 6])
    found = match_modes(mean(1), reordered(mean(2), order))
    np.testing.assert_array_equal(found, [2, 1, -1, 0, -1, 4, 5, 3])


@pytest.mark.parametrize("pair", [(0, 6), (1, 9), (9, 11), (2, 3)])
def test_modes_with_exchanged_channels_are_matched(pair: tuple[int, int]) -> None:
    event = mean(3)
    shape = event.shape.copy()
    shape[:, list(pair)] = shape[:, list(pair[::-1])]
    spoilt = ModalMean(**(vars(event) | {"shape": shape}))
    np.testing.assert_array_equal(match_modes(mean(4), spoilt), np.arange(8))
    np.testing.assert_array_equal(without_fault(mean(4), spoilt).shape, event.shape)
    assert without_fault(mean(4), event) is event


def test_modes_changed_and_crossed_by_a_heavy_body_are_matched() -> None:
    event = mean(5, Body(at=(0.38, 0, 1.48), mass=0.5, inertia=(1e-4, 1e-4, 1e-4)))
    assert (match_modes(mean(6), event) >= 0).sum() >= 7


def test_mean_of_mixed_modes_is_not_matched_with_similar_mode() -> None:
    """Windows that mix the lowest two modes with either sign have a mean similar to the second, with a message."""
    event = mean(11)
    first, second = event.shape[:2]
    mixture = np.outer((-0.9, 0.8, 0.1), first) + second
    unsure = replace(
        event,
        log_frequency=event.log_frequency + 0.03 + np.r_[0.0, 0.01, np.zeros(6)],
        shape=np.vstack([mixture.mean(0) / np.linalg.norm(mixture.mean(0)), event.shape[1:]]),
        shape_std=np.vstack([np.abs(first) * 0.5, event.shape_std[1:]]),
    )
    baseline = mean(12).only(np.arange(1, 8))  # in which the first was not seen
    np.testing.assert_array_equal(match_modes(baseline, unsure), np.arange(1, 8))
    well_known = replace(unsure, shape_std=event.shape_std)
    assert match_modes(baseline, well_known)[0] == 0


def test_matched_modes_are_in_baseline_order_with_gaps() -> None:
    event = matched(mean(7), reordered(mean(8), np.array([5, 2])))
    assert np.flatnonzero(np.isfinite(event.log_frequency)).tolist() == [2, 5]
    assert event.n.tolist() == [0, 0, 3, 0, 0, 3, 0, 0]


def test_unmeasured_mode_is_not_matched() -> None:
    event = matched(mean(13), reordered(mean(14), np.array([5, 2, 7])))
    np.testing.assert_array_equal(match_modes(mean(15), event), [-1, -1, 2, -1, -1, 5, -1, 7])


def test_channels_missing_in_one_record_are_left_out() -> None:
    event = mean(9).at(CHANNELS[:7])
    found = matched(mean(10), event)
    assert found.channels == CHANNELS[:7]
    assert np.isfinite(found.log_frequency).sum() >= 6


def test_poorly_identified_close_mode_does_not_take_the_partner_of_the_other() -> None:
    """The lower of two close modes is mixed with the upper one, with one sign in the baseline, the other in the event.

    The sum of costs is least with both paired crosswise, though the upper mode has the same shape in both.
    """
    baseline, event = mean(21), mean(22)
    first, second = baseline.shape[:2]
    mixed = [0.82 * second + sign * np.sqrt(1 - 0.82**2) * first for sign in (1, -1)]
    known = replace(baseline, shape=np.vstack([mixed[0], baseline.shape[1:]]))
    poor = replace(event, shape=np.vstack([mixed[1], event.shape[1:]]))
    np.testing.assert_array_equal(match_modes(known, poor)[1:], np.arange(1, 8))


def test_event_without_modes_has_no_partners() -> None:
    assert (match_modes(mean(23), mean(24).only(np.array([], int))) == -1).all()
    assert not len(match_modes(mean(23).only(np.array([], int)), mean(24)))

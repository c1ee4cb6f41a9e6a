"""Modes that cannot be right are refused by name: in the baseline, in an event, in a window."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.updater.frames import t_frame, t_truth, unmoved
from updater import (
    ModalDataError,
    ModalMean,
    Reference,
    diagnose,
    learn_reference,
    locate_mass,
    matched,
    mean_modes,
    nominal_reference,
    stack_tracks,
)
from updater.modal_data import doubles

Spoil = Callable[[ModalEstimate], ModalEstimate]


def windows(n: int, seed: int) -> list[ModalEstimate]:
    truth = t_truth(3)
    model = truth.model()
    return truth.windows(model.modes(8), model.sensor_rows, n, seed)


@pytest.fixture(scope="module")
def reference() -> Reference:
    return learn_reference(t_frame(), windows(8, 1), unmoved(8))


@pytest.fixture(scope="module")
def event(reference: Reference) -> ModalMean:
    return reference.mean_of(stack_tracks(windows(4, 2), unmoved(4)))


def in_unit(factor: float) -> Spoil:
    return lambda e: replace(e, frequency=factor * e.frequency, frequency_std=factor * e.frequency_std)


def with_mode(mode: int, **values: object) -> Spoil:
    def spoil(estimate: ModalEstimate) -> ModalEstimate:
        columns = {name: getattr(estimate, name).copy() for name in values}
        for name, value in values.items():
            columns[name][mode] = value
        return replace(estimate, **columns)

    return spoil


@pytest.mark.parametrize(("factor", "unit"), [(2 * np.pi, "rad/s"), (1e-3, "kHz"), (60.0, "revolutions a minute")])
def test_baseline_in_a_wrong_unit_is_refused(factor: float, unit: str) -> None:
    with pytest.raises(ModalDataError, match=f"expected hertz.*in {unit}"):
        learn_reference(t_frame(), [in_unit(factor)(e) for e in windows(3, 1)], unmoved(3))


@pytest.mark.parametrize(("factor", "unit"), [(2 * np.pi, "rad/s"), (1e-3, "kHz"), (60.0, "revolutions a minute")])
def test_event_in_a_wrong_unit_is_refused(reference: Reference, factor: float, unit: str) -> None:
    wrong = reference.mean_of(stack_tracks([in_unit(factor)(e) for e in windows(3, 2)], unmoved(3)))
    with pytest.raises(ModalDataError, match=f"expected hertz.*are they in {unit}"):
        locate_mass(reference, wrong)
    with pytest.raises(ModalDataError, match=unit):
        diagnose(reference, wrong)


def test_wrong_unit_is_refused_before_modes_are_matched(reference: Reference) -> None:
    tracked = stack_tracks([in_unit(2 * np.pi)(e) for e in windows(3, 2)], unmoved(3))
    with pytest.raises(ModalDataError, match="in rad/s"):
        matched(reference.baseline, reference.mean_of(tracked))
    with pytest.raises(ModalDataError, match="in rad/s"):
        nominal_reference(t_frame(), tracked)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (with_mode(2, shape=0.0), "window 1, mode 2: the shape at .* Hz is zero at every channel"),
        (with_mode(0, frequency=0.0), "window 1, mode 0: expected a frequency over 0 Hz, found 0"),
        (with_mode(0, frequency=np.nan), "window 1, mode 0: expected a frequency over 0 Hz, found nan"),
        (with_mode(5, shape=np.nan), "window 1, mode 5: .* has no value at channel col_037_x"),
    ],
)
def test_window_with_an_invalid_mode_is_refused(spoil: Spoil, message: str) -> None:
    first, second = windows(2, 1)
    with pytest.raises(ModalDataError, match=message):
        stack_tracks([first, spoil(second)], unmoved(2))


def test_one_mode_on_two_tracks_is_refused() -> None:
    tracks = np.array([0, 1, 2, 2, 4, 5, 6, 7])
    with pytest.raises(ModalDataError, match="window 0: mode 2 is on more than one track"):
        stack_tracks(windows(1, 1), [tracks])


def doubled(estimate: ModalEstimate) -> ModalEstimate:
    """Return the third mode in the place of the fourth as well."""
    order = np.array([0, 1, 2, 2, 4, 5, 6, 7])
    return estimate[order]


def test_duplicate_mode_is_refused_in_baseline_and_event(reference: Reference) -> None:
    with pytest.raises(ModalDataError, match="tracks 2 and 3 are one mode twice"):
        learn_reference(t_frame(), [doubled(e) for e in windows(3, 1)], unmoved(3))
    event = reference.mean_of(stack_tracks([doubled(e) for e in windows(3, 2)], unmoved(3)))
    with pytest.raises(ModalDataError, match="tracks 2 and 3 are one mode twice"):
        locate_mass(reference, event)


def test_less_certain_of_two_equal_modes_is_the_duplicate() -> None:
    twice = mean_modes(stack_tracks([doubled(e) for e in windows(3, 1)], unmoved(3)))
    assert doubles(twice).tolist() == [2]
    wide = np.where(np.arange(8)[:, None] == 3, 2.0, 1.0) * twice.shape_std
    assert doubles(replace(twice, shape_std=wide)).tolist() == [3]
    assert not len(doubles(mean_modes(stack_tracks(windows(3, 1), unmoved(3)))))


def test_frequency_without_standard_deviation_is_refused(reference: Reference, event: ModalMean) -> None:
    std = np.where(np.arange(8) == 4, np.nan, event.log_frequency_std)
    with pytest.raises(ModalDataError, match="track 4: expected a standard deviation"):
        locate_mass(reference, replace(event, log_frequency_std=std))


def test_valid_event_is_accepted(reference: Reference, event: ModalMean) -> None:
    assert len(locate_mass(reference, event).tracks) == len(event.log_frequency) == 8

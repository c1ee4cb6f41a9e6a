"""Modes without motion at the channels, and modes without deviations: no datum, instead of a singular covariance."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.diagnosis_data import CHANNELS, TOP, Change, learnt
from updater import Body, Circumstances, ModalMean, diagnose
from updater.inference import compare
from updater.modal_data import KnownMass

_BODY = Body(at=(0.2, 0.0, TOP), mass=0.2)


def test_any_two_channels_are_compared() -> None:
    """The modes of a T-frame move along x or along y: two channels of one direction have no part of the others."""
    reference, _, event = learnt(1)
    now = event(Change((_BODY,)))
    for two in itertools.combinations(CHANNELS, 2):
        data = compare(reference, now.at(two))
        assert np.isfinite(data.shape_whitener).all()
        assert np.isfinite(data.imaginary_whitener).all()


@pytest.mark.parametrize("two", [("col_037_x", "col_074_x"), ("col_037_y", "beam_left_y")])
def test_body_is_found_with_channels_of_one_direction(two: tuple[str, str]) -> None:
    """Or its mirror image, where both channels move alike."""
    reference, _, event = learnt(1)
    diagnosis = diagnose(reference, event(Change((_BODY,))).at(two)).diagnosis
    assert {cause.cause for cause in diagnosis.causes} == {"added_mass"}
    places = [cause.where.position for cause in diagnosis.causes if cause.where and cause.where.position]
    assert min(abs(place[0] - _BODY.at[0]) for place in places) < 0.01
    assert diagnosis.failed == ()


def test_mode_without_motion_at_the_channels_has_any_shape() -> None:
    """As in a table of three digits, where a component of 0.0004 is zero."""
    reference, _, event = learnt(1)
    some, now = CHANNELS[:3], event(Change((_BODY,)))
    blind = np.isin(np.arange(8), [2, 6])[:, None] & np.isin(CHANNELS, some)

    def rounded(modes: ModalMean) -> ModalMean:
        return replace(modes, shape=np.where(blind, 0.0, modes.shape), imaginary=np.where(blind, 0.0, modes.imaginary))

    at_some = rounded(now).at(some)
    np.testing.assert_allclose(np.linalg.norm(at_some.shape, axis=1), 1.0)
    assert (at_some.shape_std[[2, 6]] == 1).all()
    before = replace(reference, baseline=rounded(reference.baseline))
    causes = diagnose(before, at_some, only=("added_mass",)).diagnosis.causes
    assert [cause.cause for cause in causes] == ["added_mass"] * len(causes) != []


@pytest.mark.parametrize(
    ("cause", "known"), few_of([("global_stiffness", True), ("added_mass", True), ("added_mass", False)])
)
def test_modes_without_deviations_are_compared(cause: str, *, known: bool) -> None:
    """As computed modes are, also with a known mass that shifts nothing: their covariance is no longer singular."""
    reference, _, event = learnt(1)
    exact = {name: np.zeros_like(getattr(reference.baseline, name)) for name in ("log_frequency_std", "shape_std")}
    same = replace(event(Change()), log_frequency=reference.baseline.log_frequency, **exact)
    before = replace(reference, baseline=replace(reference.baseline, **exact))
    masses = (KnownMass(mass=0.15, position=(0.3, 0.0, TOP), modes=same),) if known else ()
    found = diagnose(before, same, circumstances=Circumstances(known_masses=masses), only=(cause,)).diagnosis
    assert found.failed == ()
    assert [test.p_value < 1e-6 for test in found.mass_tests] == [True] * known


def test_search_for_a_cause_without_effect_ends_without_a_name() -> None:
    """Neither a body nor no change fits dampings that are twice as large and known exactly."""
    reference, _, event = learnt(1)
    now = event(Change())
    damped = replace(now, damping=4 * reference.baseline.damping, damping_std=np.zeros(8))
    assert diagnose(reference, damped, only=("added_mass",)).diagnosis.verdict == "unexplained"

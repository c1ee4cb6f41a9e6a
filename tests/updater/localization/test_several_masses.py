"""Number and positions of masses: none, one, two or three bodies on a truth of another model."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.support.updater.mass_counts import frame_with_masses
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    MassChange,
    ModalMean,
    Reference,
    build_model,
    learn_reference,
    locate_masses,
    matched,
    stack_tracks,
)

TRACK = np.arange(8)
Loaded = tuple[Reference, Callable[[tuple[Body, ...]], ModalMean]]


@pytest.fixture(scope="module")
def loaded() -> Loaded:
    """A reference from eight windows, and the result of five windows of the frame with bodies on it."""
    random = np.random.default_rng(301)
    gain = 1 + 0.005 * random.standard_normal(12)
    bare = true_model(np.random.default_rng((301, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, gain) for _ in range(8)], [TRACK] * 8)

    def event(bodies: tuple[Body, ...]) -> ModalMean:
        model = build_model(bare.structure.with_bodies(bodies), shear_flexible=True, mass="consistent")
        random = np.random.default_rng((301, 2, len(bodies)))  # its own: tests run in any order
        windows = [measure(model, random, gain) for _ in range(5)]
        return matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))

    return reference, event


def place(change: MassChange) -> np.ndarray:
    return t_frame().member_named(change.member).point(change.distance)


@pytest.mark.parametrize(
    "bodies",
    [
        pytest.param((), id="none", marks=pytest.mark.thorough),
        pytest.param((Body(at=(0, 0, 0.92), mass=0.152, offset=(0.01, 0, 0)),), id="one", marks=pytest.mark.thorough),
        pytest.param((Body(at=(0.25, 0, 1.48), mass=0.304), Body(at=(0, 0, 0.92), mass=0.152)), id="two"),
        pytest.param(
            (Body(at=(0.3, 0, 1.48), mass=0.3), Body(at=(-0.25, 0, 1.48), mass=0.2), Body(at=(0, 0, 0.7), mass=0.25)),
            id="three",
            marks=pytest.mark.thorough,
        ),
    ],
)
def test_number_positions_and_masses_of_bodies_are_found(loaded: Loaded, bodies: tuple[Body, ...]) -> None:
    """Within four standard deviations and 2 mm of rounding; each at least determined to 0.1 m."""
    reference, event = loaded
    found = locate_masses(reference, event(bodies), most=max(len(bodies), 2))
    assert found.number == len(bodies)
    assert found.probability.sum() == pytest.approx(1)
    assert found.probability.argmax() == len(bodies)
    assert found.p_value > 1e-3
    for change in found.masses:
        body = min(bodies, key=lambda b: float(np.linalg.norm(place(change) - b.at)))
        off = np.linalg.norm(place(change) - body.at)
        assert off < min(4 * change.distance_std + 0.002, 0.1)
        assert abs(change.mass - body.mass) < 4 * change.mass_std
    assert len({change.mass for change in found.masses}) == len(bodies)


@pytest.mark.thorough
def test_moved_mass_is_one_removed_and_one_added_mass() -> None:
    """200 g were at (0.3, 0, 1.48) while the reference learned, and are at (0, 0, 0.8) now."""
    random = np.random.default_rng(302)
    gain = 1 + 0.005 * random.standard_normal(12)
    before = true_model(np.random.default_rng((302, 1)), Body(at=(0.3, 0, 1.48), mass=0.2))
    after = true_model(np.random.default_rng((302, 1)), Body(at=(0, 0, 0.8), mass=0.2))
    reference = learn_reference(t_frame(), [measure(before, random, gain) for _ in range(8)], [TRACK] * 8)
    windows = [measure(after, random, gain) for _ in range(5)]
    event = matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))
    found = locate_masses(reference, event, most=2)
    assert found.number == 2
    removed, added = sorted(found.masses, key=lambda change: change.mass)
    assert abs(removed.mass + 0.2) < 4 * removed.mass_std
    assert abs(added.mass - 0.2) < 4 * added.mass_std
    assert np.linalg.norm(place(removed) - [0.3, 0, 1.48]) < 4 * removed.distance_std + 0.002
    assert np.linalg.norm(place(added) - [0, 0, 0.8]) < 4 * added.distance_std + 0.002


def test_number_of_masses_is_limited_to_the_given_maximum(loaded: Loaded) -> None:
    reference, event = loaded
    bodies = (Body(at=(0.25, 0, 1.48), mass=0.304), Body(at=(0, 0, 0.92), mass=0.152))
    found = locate_masses(reference, event(bodies), most=1)
    assert found.number == 1
    assert len(found.probability) == 2


@pytest.mark.thorough
def test_three_masses_are_not_reported_as_certainly_two() -> None:
    """Three masses on a frame of the examiner's, one of which hardly shows; two were stated with 0.97."""
    case = frame_with_masses(3, "coarse", np.random.default_rng((11, 1, 3, 3)))
    found = locate_masses(case.reference, case.event)
    print(found.probability)
    assert found.probability[3] > 0.1
    assert found.number == 3 or found.probability.max() < 0.9

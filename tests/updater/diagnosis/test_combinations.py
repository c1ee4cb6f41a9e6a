"""Two causes found at once, to first order, where the likeliest one alone may be neither."""

from collections.abc import Sequence

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Model, Reference, build_model, learn_reference, matched, stack_tracks
from updater.causes import AddedMass, SelectedCause
from updater.diagnosis.combinations import Compositions, likeliest_pair
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare

TRACK = np.arange(8)
GAIN = np.ones(12)


@pytest.fixture(scope="module")
def learnt() -> tuple[Reference, Model]:
    random = np.random.default_rng(971)
    bare = true_model(np.random.default_rng(972))
    return learn_reference(t_frame(), [measure(bare, random, GAIN) for _ in range(8)], [TRACK] * 8), bare


def pair_of(
    learnt: tuple[Reference, Model], bodies: tuple[Body, ...], gain: np.ndarray, seed: int
) -> list[SelectedCause]:
    print(f"seed {seed}")
    reference, bare = learnt
    model = build_model(bare.structure.with_bodies(bodies), shear_flexible=True, mass="consistent")
    windows = [measure(model, np.random.default_rng((seed, k)), gain) for k in range(5)]
    event = matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))
    found = likeliest_pair(EvidenceComparison(reference, compare(reference, event)))
    assert found is not None
    return list(found)


def test_each_fit_is_announced_with_the_number_of_fits(learnt: tuple[Reference, Model]) -> None:
    reference, model = learnt
    windows = [measure(model, np.random.default_rng((971, k)), GAIN) for k in range(3)]
    data = compare(reference, matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 3))))
    announced: list[tuple[Sequence[str], int, int]] = []
    names = ("added_mass", "sensor_gain")
    weighing = EvidenceComparison(reference, data, lambda *fit: announced.append(fit), allowed=names)
    singles = weighing.singles()
    assert announced == [((name,), done, 2) for done, name in enumerate(names)]
    announced.clear()
    Compositions(weighing).rank_by_linear_prediction(singles[:1])
    first = singles[0].names
    assert [fit[0] for fit in announced[:2]] == [(*first, name) for name in names]
    assert [done for _, done, _ in announced] == list(range(len(announced)))
    assert {planned for _, _, planned in announced} == {len(announced)}


def test_a_joint_fit_with_the_same_alternatives_is_not_repeated(learnt: tuple[Reference, Model]) -> None:
    reference, bare = learnt
    model = build_model(
        bare.structure.with_bodies([Body(at=(0.25, 0.0, 1.48), mass=0.3)]), shear_flexible=True, mass="consistent"
    )
    windows = [measure(model, np.random.default_rng((973, k)), GAIN) for k in range(3)]
    data = compare(reference, matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 3))))
    weighing = EvidenceComparison(reference, data, allowed=("added_mass", "sensor_gain"))
    several = Compositions(weighing)
    found = several.coordinate_fit(tuple(candidate.chosen[0] for candidate in weighing.singles()))
    for _ in range(3):
        assert found is not None
        before, found = found, several.coordinate_fit(found.chosen)
    assert found is not None
    number = len(weighing.joint)
    again = several.coordinate_fit(found.chosen)
    assert again is not None
    assert len(weighing.joint) == number
    assert again.log_evidence == found.log_evidence == before.log_evidence


def place(chosen: SelectedCause) -> np.ndarray:
    assert isinstance(chosen.cause, AddedMass)
    member = t_frame().member[chosen.cause.member[chosen.row]]
    return np.array(member.point(float(chosen.cause.position[chosen.row])))


@pytest.mark.parametrize("seed", few_of(range(973, 981), 3))
def test_two_bodies_on_beam_and_column_are_located(learnt: tuple[Reference, Model], seed: int) -> None:
    """Of 100 to 300 g, drawn anywhere but where nothing moves; to first order they are placed to 5 cm."""
    random = np.random.default_rng(seed)
    at = (random.uniform(-0.35, 0.35), 0.0, 1.48), (0.0, 0.0, random.uniform(0.5, 1.2))
    bodies = tuple(Body(at=each, mass=random.uniform(0.1, 0.3)) for each in at)
    found = pair_of(learnt, bodies, GAIN, seed)
    beam, column = sorted(found, key=lambda each: -place(each)[2])
    assert np.linalg.norm(place(beam) - at[0]) < 0.05
    assert np.linalg.norm(place(column) - at[1]) < 0.05
    for chosen, body in zip((beam, column), bodies, strict=True):
        assert chosen.theta[0] == pytest.approx(body.mass, rel=0.3)


@pytest.mark.parametrize("channel", [3, 9])
def test_body_and_sensor_gain_error_are_found_together(learnt: tuple[Reference, Model], channel: int) -> None:
    gain = GAIN.copy()
    gain[channel] = 1.15
    found = pair_of(learnt, (Body(at=(0.2, 0.0, 1.48), mass=0.2),), gain, 981)
    body, sensor = sorted(found, key=lambda each: each.cause.name)
    assert (body.cause.name, sensor.cause.name) == ("added_mass", "sensor_gain")
    assert np.linalg.norm(place(body) - [0.2, 0, 1.48]) < 0.05
    assert sensor.row == channel

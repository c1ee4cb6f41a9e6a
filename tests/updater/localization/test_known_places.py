"""Bodies removed at known positions, identified from several records of a beam with other positions each time.

The truth is the Ritz model of a tapered beam, unknown to the structure file; mounting changes each frequency by 0.8 %,
a third of a body's effect, noise by 0.02 %.
"""

from dataclasses import replace

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.updater.ritz_cantilever import BEAM, LENGTH, Clamp, frequencies, structure_file
from updater import ModalDataError, Reference, learn_reference, matched, parse_structure, stack_tracks
from updater.localization import BodyRecord, select_bodies

NOISE, SCATTER = 2e-4, 8e-3  # of a frequency
MASS = 0.03 * BEAM
TRUTH, FILE = Clamp(taper=0.04), Clamp(mass=0.45)
PLACES = np.array([0.06, 0.13, 0.2, 0.28]) + np.array(
    [[0.0, 0, 0, 0], [0.012, -0.01, 0.015, 0], [-0.01, 0.01, 0, 0.02]]
)
TRACK = np.arange(5)


def estimate(frequency: np.ndarray) -> ModalEstimate:
    """Return frequencies with a cantilever's shapes at two sensors, in place of shapes that were not measured."""
    shape = np.array([[1, 0.3], [1, -0.7], [1, -0.02], [1, 0.7], [1, 0.0]], complex)
    std = NOISE * frequency
    return ModalEstimate(
        channels=("tip_z", "middle_z"),
        frequency=frequency,
        frequency_std=std,
        damping=np.full(5, 0.005),
        damping_std=np.full(5, 0.001),
        shape=shape / np.linalg.norm(shape, axis=1, keepdims=True),
        shape_std=np.full(shape.shape, 0.02),
        support=np.ones(5),
        law_ratio=np.ones(5),
        start=0,
        end=0,
    )


@pytest.fixture(scope="module")
def references() -> list[Reference]:
    random, found = np.random.default_rng(2901), []
    for places in PLACES:
        structure = parse_structure(structure_file([(x, MASS) for x in places], FILE))
        before = frequencies([(x, MASS) for x in places], TRUTH) * np.exp(NOISE * random.standard_normal(5))
        found.append(learn_reference(structure, [estimate(before)], [TRACK], stated=True, shaped=False))
    return found


def records(references: list[Reference], off: tuple[int, ...], seed: int) -> list[BodyRecord]:
    random, found = np.random.default_rng((2902, seed)), []
    for reference, places in zip(references, PLACES, strict=True):
        left = [(x, MASS) for k, x in enumerate(places) if k not in off]
        error = np.hypot(NOISE, SCATTER) * random.standard_normal(5)
        modes = stack_tracks([estimate(frequencies(left, TRUTH) * np.exp(error))], [TRACK])
        event = matched(reference.baseline, reference.mean_of(modes)).without_shapes()
        position = np.column_stack([places, np.zeros((4, 2))])
        found.append(BodyRecord(reference=reference, event=event, position=position))
    return found


def test_stated_probabilities_of_removed_bodies_match_the_hit_rate(references: list[Reference]) -> None:
    """Over none, one and two bodies the right answers are as many as their stated probabilities add up to."""
    masses, std = np.full(4, -MASS), np.full(4, 0.1 * MASS)
    stated, right, alone, alone_right = [], [], [], []
    for seed, off in enumerate([(), (0,), (2,), (3,), (0, 2), (1, 3), (0, 1), (2, 3)]):
        found = select_bodies(records(references, off, seed), masses, std, most=2)
        stated.append(found.probability.max())
        right.append(found.best == off)
        alone += found.per_record.max(axis=1).tolist()
        alone_right += [found.sets[k] == off for k in found.per_record.argmax(axis=1)]
        if found.best == off:
            assert (np.abs(found.mass - [-MASS * (k in off) for k in range(4)]) < 4 * found.mass_std + 1e-9).all()
        print(off, found.best, round(float(found.probability.max()), 3), found.per_record.max(axis=1).round(2))
    print(f"together {np.mean(right):.2f} right at {np.mean(stated):.2f} stated")
    print(f"alone {np.mean(alone_right):.2f} right at {np.mean(alone):.2f} stated")
    for probability, hits in ((stated, right), (alone, alone_right)):
        p = np.array(probability)
        assert abs(p.sum() - sum(hits)) < 3 * max(np.sqrt((p * (1 - p)).sum()), 1.0)
    assert np.mean(right) > np.mean(alone_right)


def test_more_records_increase_probability_and_determine_the_scatter(references: list[Reference]) -> None:
    every = records(references, (1,), 11)
    found = select_bodies(every, np.full(4, -MASS), np.full(4, 0.1 * MASS), most=2)
    assert found.best == (1,)
    row = found.sets.index((1,))
    assert found.probability[row] > np.median(found.per_record[:, row])
    assert found.candidate_probability[1] > 0.95
    assert found.per_record.shape == (3, len(found.sets))
    # fifteen deviations of four sizes: each to a third
    assert np.exp(np.log(found.scatter).mean()) == pytest.approx(SCATTER, rel=0.7)


def test_missing_or_inconsistent_records_are_refused(references: list[Reference]) -> None:
    found = records(references, (), 12)
    with pytest.raises(ModalDataError, match="expected at least one"):
        select_bodies([], np.full(4, -MASS), np.full(4, MASS))
    with pytest.raises(ValueError, match="record 2: expected positions of 4 candidates"):
        select_bodies([found[0], replace(found[1], position=np.zeros((3, 3)))], np.full(4, -MASS), np.full(4, MASS))
    with pytest.raises(ValueError, match="mass_std: expected 4 positive"):
        select_bodies(found, np.full(4, -MASS), np.zeros(4))
    assert np.max(PLACES) < LENGTH

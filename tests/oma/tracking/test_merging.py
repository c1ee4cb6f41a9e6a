import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from daq import FloatArray, read_data
from daq.files import differentiated
from oma import ModalEstimate, NoCommonModes, identify, mac_matrix, match_setups, merge, normalise
from tests.support.oma.structures import Structure, chain, simulate

TOWER = chain(8, first=1.0, damping=0.008)
REFERENCES = ("mass_8", "mass_3")
MOVED = (("mass_1", "mass_2"), ("mass_4", "mass_5"), ("mass_6", "mass_7"))
ORDER = [7, 2, 0, 1, 3, 4, 5, 6]


def at(structure: Structure, names: tuple[str, ...]) -> Structure:
    return replace(structure, shapes=structure.shapes[:, [structure.channels.index(n) for n in names]], channels=names)


def measured(structure: Structure, sigma: FloatArray, seed: int) -> ModalEstimate:
    """Return the modes of a set-up: shapes of unit norm and any sign, with noise of the stated deviation."""
    rng = np.random.default_rng(seed)
    n, n_channels = structure.shapes.shape
    norm = np.linalg.norm(structure.shapes, axis=1, keepdims=True) * rng.choice([-1, 1], (n, 1))
    shape = structure.shapes / norm + rng.standard_normal((n, n_channels)) * sigma
    return ModalEstimate(
        channels=structure.channels,
        frequency=structure.frequency * (1 + 1e-3 * rng.standard_normal(n)),
        frequency_std=1e-3 * structure.frequency,
        damping=structure.damping * (1 + 0.1 * rng.standard_normal(n)),
        damping_std=0.1 * structure.damping,
        shape=shape.astype(np.complex128),
        shape_std=np.broadcast_to(sigma, shape.shape),
        support=np.ones(n),
        law_ratio=np.ones(n),
        start=seed,
        end=seed + 1,
    )


def setups(first_seed: int, sigma: float = 0.01) -> list[ModalEstimate]:
    # what the channels of a set-up are good for differs: the second reference is worse than the first
    return [
        measured(at(TOWER, (*REFERENCES, *moved)), sigma * np.array([1.0, 3.0, 1.0, 2.0]), first_seed + k)
        for k, moved in enumerate(MOVED)
    ]


def test_noise_free_setups_merge_to_the_exact_shape() -> None:
    merged = merge(setups(1, sigma=0.0), REFERENCES)
    assert merged.channels == tuple(TOWER.channels[i] for i in ORDER)
    np.testing.assert_allclose(merged.shape, normalise(TOWER.shapes[:, ORDER]), atol=1e-12)
    assert (merged.start, merged.end) == (1, 4)


@pytest.mark.parametrize("first_seed", [1000])
def test_stated_deviations_of_merged_modes_equal_their_scatter(first_seed: int) -> None:
    exact = normalise(TOWER.shapes[:, ORDER]).real
    shape, frequency, damping = [], [], []
    for run in range(100):
        merged = merge(setups(first_seed + 3 * run), REFERENCES)
        turned = merged.shape.real * np.sign(np.sum(merged.shape.real * exact, axis=1))[:, None]
        shape.append((turned - exact) / merged.shape_std)
        frequency.append((merged.frequency - TOWER.frequency) / merged.frequency_std)
        damping.append((merged.damping - TOWER.damping) / merged.damping_std)
    # of 800 independent normal values the root mean square is 1 +- 0.025; tau^2 from three set-ups can only add to
    # the variance, and does by a fifth in the mean (2 degrees of freedom)
    assert 0.93 < np.sqrt(np.mean(np.square(shape))) < 1.07
    assert 0.8 < np.sqrt(np.mean(np.square(frequency))) < 1.05
    assert 0.8 < np.sqrt(np.mean(np.square(damping))) < 1.05
    # each channel and mode by itself, 100 values: 1 +- 0.07, so four of these deviations
    assert np.abs(np.sqrt(np.mean(np.square(shape), axis=0)) - 1).max() < 0.28


def test_uncertain_reference_channel_gets_less_weight() -> None:
    """Scales by the good reference alone are nearly as sure as by both; by the poor one alone, three times less."""
    (first, *_) = setups(5)
    both = merge(setups(5), REFERENCES).shape_std[0, -1]
    good = merge([without(e, "mass_3") for e in setups(5)], ("mass_8",)).shape_std[0, -1]
    poor = merge([without(e, "mass_8") for e in setups(5)], ("mass_3",)).shape_std[0, -1]
    assert first.channels[:2] == REFERENCES
    assert both < 1.2 * good < poor


def without(estimate: ModalEstimate, name: str) -> ModalEstimate:
    kept = [i for i, c in enumerate(estimate.channels) if c != name]
    return replace(
        estimate,
        channels=tuple(estimate.channels[i] for i in kept),
        shape=estimate.shape[:, kept],
        shape_std=estimate.shape_std[:, kept],
    )


def only(estimate: ModalEstimate, modes: list[int]) -> ModalEstimate:
    names = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")
    return replace(estimate, **{name: getattr(estimate, name)[modes] for name in names})


def test_scatter_between_setups_increases_stated_deviation() -> None:
    calm = setups(7)
    warm = [replace(e, frequency=e.frequency * f) for e, f in zip(calm, (0.995, 1.0, 1.005), strict=True)]
    still, drifted = merge(calm, REFERENCES), merge(warm, REFERENCES)
    # 0.5 % between set-ups beside 0.1 % of their own: 0.5 / sqrt(3) % of the mean, known to a half by three values
    assert (drifted.frequency_std / drifted.frequency > 0.0015).all()
    assert (still.frequency_std / still.frequency < 0.0015).all()


def test_modes_are_matched_across_setups_with_missing_modes() -> None:
    found = setups(9)
    found[1], found[2] = only(found[1], [0, 2, 3, 4, 5, 6, 7]), only(found[2], [0, 1, 2, 3, 4, 6, 7])
    assert match_setups(found, REFERENCES).tolist() == [
        [0, 0, 0], [2, 1, 2], [3, 2, 3], [4, 3, 4], [6, 5, 5], [7, 6, 6],
    ]  # fmt: skip
    assert merge(found, REFERENCES).n_modes == 6


def test_close_modes_with_crossing_frequencies_are_matched_by_shape() -> None:
    close = replace(TOWER, frequency=np.append(TOWER.frequency[:6], [5.0, 5.02]))
    swapped = replace(close, frequency=np.append(TOWER.frequency[:6], [5.03, 4.99]))
    sigma = np.full(4, 0.01)
    found = [measured(at(s, (*REFERENCES, *m)), sigma, 11) for s, m in zip((close, swapped), MOVED[:2], strict=True)]
    assert match_setups(found, REFERENCES)[-2:].tolist() == [[6, 6], [7, 7]]


def test_incompatible_setups_are_refused() -> None:
    first, second, third = setups(13)
    with pytest.raises(ValueError, match="set-up 2: expected the references mass_8, mass_3, lacks mass_3"):
        merge([first, without(second, "mass_3"), third], REFERENCES)
    with pytest.raises(ValueError, match="channel mass_3: expected in one set-up, or among the references"):
        merge([first, second], ("mass_8",))
    with pytest.raises(ValueError, match="expected two set-ups and a reference, found 1 and 2"):
        merge([first], REFERENCES)
    with pytest.raises(NoCommonModes, match=r"none of the modes \(2, 3\) is identified in all 2 set-ups"):
        merge([only(first, [0, 1]), only(second, [2, 3, 4])], REFERENCES)


@pytest.mark.parametrize("seed", [30])
def test_simulated_setups_merge_to_the_shapes_of_the_structure(seed: int) -> None:
    names = [(*REFERENCES, *moved) for moved in MOVED]
    found = []
    for k, channels in enumerate(names):
        whole = simulate(TOWER, 400.0, 40.0, seed + k)
        place = [TOWER.channels.index(n) for n in channels]
        found.append(
            identify(replace(whole, channels=tuple(whole.channels[i] for i in place), data=whole.data[:, place]))
        )
    merged = merge(found, REFERENCES)
    assert merged.n_modes == 8
    z = (merged.frequency - TOWER.frequency) / merged.frequency_std
    assert np.abs(z).max() < 4
    assert mac_matrix(merged.shape, TOWER.shapes[:, ORDER]).diagonal().min() > 0.995


REAL = os.environ.get("MODALWATCH_REAL_DATA")
PUBLISHED = np.array([1.2283, 1.4358, 2.1000, 4.0175, 4.7704, 6.6824, 7.6157, 9.6653, 12.1663, 12.5979, 13.8545])  # Hz


@pytest.mark.skipif(not REAL, reason="MODALWATCH_REAL_DATA names no folder")
def test_measured_steel_frame_setups_merge_to_published_modes() -> None:
    found, references = [], ("ref_x", "ref_y", "ref_z")
    for k in range(1, 6):
        recording = read_data(Path(REAL or "") / "weimar-steel-frame" / f"measurement_{k:02d}.npz")
        lasers = [f"laser_{beam}_{k}" for beam in ("left", "right", "top")]
        names = (*lasers, *references)
        channels = tuple(replace(c, name=n) for c, n in zip(recording.channels, names, strict=True))
        found.append(identify(differentiated(replace(recording, channels=channels), lasers)))
        below = found[-1].frequency[found[-1].frequency < 15]
        np.testing.assert_allclose(below, PUBLISHED, rtol=3e-3)  # each of them, and nothing else
    merged = merge(found, references)
    np.testing.assert_allclose(merged.frequency[merged.frequency < 15], PUBLISHED, rtol=1e-3)
    assert all(a < b for a, b in pairwise(merged.frequency))
    # the reference at the top corner moves in x, in y, and in both when the frame twists
    first = np.abs(merged.shape[:3, :2])
    assert first[0, 0] > 5 * first[0, 1]
    assert first[1, 1] > 5 * first[1, 0]
    assert 0.8 < first[2, 0] / first[2, 1] < 1.25

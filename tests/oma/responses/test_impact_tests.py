"""Modes of simulated impact tests with noise and windows: all found, none false, deviations as statistics."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from daq import FloatArray
from oma import identify_responses_all
from oma.errors import InputError
from tests.support.oma.impact_test import CHANNELS, DISTURBED, REFERENCES, SCENES, ImpactTest, tower

TRUTH = tower()
MASS = 1 / np.sum(TRUTH.shape**2, axis=1)
FORCES = tuple(CHANNELS[k] for k in REFERENCES)
N_COHERENT = 7
N_TESTS = 25
WINDOWED = SCENES["exponential window, noise 2 %"]


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors over their standard deviations, (n_tests, n_modes)."""

    frequency: FloatArray
    damping: FloatArray
    modal_mass: FloatArray
    shape: FloatArray  # (n_tests, n_modes, n_channels)


def errors(test: ImpactTest, seeds: range) -> Errors:
    """Return the errors of tests, of which all must have the eight modes and no other."""
    print(f"seeds {seeds.start} to {seeds.stop - 1}")
    unit = TRUTH.shape / np.linalg.norm(TRUTH.shape, axis=1, keepdims=True)
    rows = []
    for seed in seeds:
        found = identify_responses_all(*test.h1(TRUTH, seed), CHANNELS, FORCES, (2.0, 75.0), test.decay)
        modes = found.estimate
        np.testing.assert_allclose(modes.frequency, TRUTH.frequency, rtol=1e-3)
        turned = unit * np.sign(np.sum(unit * modes.shape.real, axis=1))[:, None]
        rows.append(
            (
                (modes.frequency - TRUTH.frequency) / modes.frequency_std,
                (modes.damping - TRUTH.damping) / modes.damping_std,
                (found.modal_mass - MASS) / found.modal_mass_std,
                (modes.shape.real - turned) / modes.shape_std,
            )
        )
    return Errors(*(np.array(column) for column in zip(*rows, strict=True)))


def test_all_modes_of_a_test_with_an_exponential_window_are_found() -> None:
    """16 values: the rms of normal ones is below 1.6 but for a chance of 6e-4; deviations may be 1.3 too small."""
    found = errors(SCENES["exponential window, noise 10 %"], range(2))
    for name, values in vars(found).items():
        assert np.sqrt(np.mean(np.square(values))) < 1.3 * 1.6, name


@pytest.mark.thorough
@pytest.mark.parametrize("name", SCENES)
def test_deviations_state_the_errors(name: str) -> None:
    """Rms of errors over deviations, of 200 values: 5 % scatter by chance.

    Measured in 60 tests of each scene: docs/validation/identification/impact_tests.md. Deviations of shapes are
    those of independent residues: the noise of a force is in all of them, and in no shape.
    """
    found = errors(SCENES[name], range(N_TESTS))
    for field, low, high in (
        ("frequency", 0.8, 1.5),
        ("damping", 0.8, 1.5),
        ("modal_mass", 0.8, 1.7),
        ("shape", 0.5 if name == "noise of the force in the whole record" else 0.8, 1.3),
    ):
        assert low < np.sqrt(np.mean(np.square(getattr(found, field)))) < high, field


@pytest.mark.thorough
def test_coherences_reduce_the_errors() -> None:
    """One of eight sensors has ten times the noise of the others: no mode is lost, most have smaller errors."""
    print(f"seeds 0 to {N_COHERENT - 1}")
    test = DISTURBED["a sensor with ten times the noise"]
    errors: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(N_COHERENT):
        line, response, coherence = test.h1_with_coherence(TRUTH, seed, REFERENCES[:1])
        for known in (None, coherence):
            found = identify_responses_all(line, response, CHANNELS, FORCES[:1], (2.0, 75.0), test.decay, known)
            assert found.weighted is (known is not None)
            frequency = found.estimate.frequency
            near = np.abs(frequency[:, None] - TRUTH.frequency).argmin(axis=1)
            errors[found.weighted] += np.abs(frequency / TRUTH.frequency[near] - 1).tolist()
        assert len(errors[True]) == len(errors[False])
    print(np.median(errors[True]), np.median(errors[False]))
    assert np.median(errors[True]) < np.median(errors[False])


def test_coherence_of_a_single_blow_is_not_used() -> None:
    line, response, coherence = replace(WINDOWED, hits=1).h1_with_coherence(TRUTH, 3, REFERENCES[:1])
    found = identify_responses_all(line, response, CHANNELS, FORCES[:1], (2.0, 75.0), WINDOWED.decay, coherence)
    assert not found.weighted
    with pytest.raises(InputError, match="coherence: expected numbers from 0 to 1"):
        identify_responses_all(line, response, CHANNELS, FORCES[:1], (2.0, 75.0), WINDOWED.decay, coherence + 1)
    with pytest.raises(InputError, match="coherence: expected the shape of the responses"):
        identify_responses_all(line, response, CHANNELS, FORCES[:1], coherence=coherence[1:])


@pytest.mark.thorough
@pytest.mark.parametrize("name", SCENES)
def test_frequencies_and_damping_ratios_have_no_bias(name: str) -> None:
    """Mean over 25 tests of a mode: below 4 sigma of the mean; eight modes and five scenes are tried.

    Records of 4 s that are cut have a bias, of up to about one standard deviation of a single test.
    """
    found, cut = errors(SCENES[name], range(N_TESTS, 2 * N_TESTS)), float(name == "records of 4 s")
    for values in (found.frequency, found.damping):
        allowed = cut + 4 * values.std(axis=0, ddof=1) / np.sqrt(N_TESTS)
        assert (np.abs(values.mean(axis=0)) < allowed).all(), values.mean(axis=0)


def test_window_that_is_not_stated_is_damping() -> None:
    """The decay of the window adds decay over omega."""
    test = SCENES["exponential window, noise 2 %"]
    assert test.decay
    line, response = test.h1(TRUTH, 7, REFERENCES[:1])
    stated = identify_responses_all(line, response, CHANNELS, FORCES[:1], (2.0, 36.0), test.decay).estimate
    silent = identify_responses_all(line, response, CHANNELS, FORCES[:1], (2.0, 36.0)).estimate
    for frequency in (11.1725, 30.57):
        one, other = (e.damping[np.argmin(np.abs(e.frequency - frequency))] for e in (stated, silent))
        assert other - one == pytest.approx(1 / (test.decay * 2 * np.pi * frequency), rel=0.02)

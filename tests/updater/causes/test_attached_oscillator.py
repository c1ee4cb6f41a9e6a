"""Bodies on springs attached to a frame of another model: a new mode, and its information."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Circumstances,
    DiagnosisResult,
    ModalMean,
    Model,
    Reference,
    build_model,
    diagnose,
    learn_reference,
    match_modes,
    matched,
    nominal_reference,
    stack_tracks,
)
from updater.causes import AddedMass
from updater.diagnosis.next_measurement import next_measurement
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare

GAIN = np.ones(12)
ONLY = ("attached_oscillator", "added_mass", "local_stiffness")  # an additional mode is an oscillator's, or nobody's


@pytest.fixture(scope="module")
def learnt() -> tuple[Reference, Model]:
    random = np.random.default_rng(851)
    bare = true_model(np.random.default_rng(852))
    return learn_reference(t_frame(), [measure(bare, random, GAIN) for _ in range(8)], [np.arange(8)] * 8), bare


def hung(model: Model, at: tuple[float, float, float], axis: int, mass: float, frequency: float) -> Model:
    """Append a particle that moves absolutely along one axis on its spring, and with the frame along the others."""
    rows = model.read(np.array(at))[:3]
    spring = mass * (2 * np.pi * frequency) ** 2
    n = model.n_dofs
    pull = np.append(rows[axis], -1.0)
    ride = [sparse.csc_array(np.outer(np.append(r, 0.0), np.append(r, 0.0))) for i, r in enumerate(rows) if i != axis]
    own = sparse.csc_array(([mass], ([n], [n])), shape=(n + 1, n + 1))
    grown = [sparse.block_diag([matrix, sparse.csc_array((1, 1))]) for matrix in (model.stiffness, model.mass)]
    stiffness = grown[0] + spring * sparse.csc_array(np.outer(pull, pull))
    return replace(
        model,
        stiffness=sparse.csc_array(stiffness),
        mass=sparse.csc_array(grown[1] + own + mass * (ride[0] + ride[1])),
    )


def event_of(reference: Reference, model: Model, seed: int, n_modes: int = 9) -> tuple[ModalMean, Circumstances]:
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    windows = [measure(model, random, GAIN, n_modes=n_modes) for _ in range(5)]
    event = reference.mean_of(stack_tracks(windows, [np.arange(n_modes)] * 5))
    extra = np.setdiff1d(np.arange(n_modes), match_modes(reference.baseline, event))
    known = Circumstances(extra=event.only(extra) if len(extra) else None)
    return matched(reference.baseline, event), known


def explained(learnt: tuple[Reference, Model], model: Model, seed: int, n_modes: int = 9) -> DiagnosisResult:
    event, known = event_of(learnt[0], model, seed, n_modes)
    return diagnose(learnt[0], event, circumstances=known)


@pytest.mark.parametrize(
    ("seed", "at", "axis", "mass", "frequency"),
    few_of(
        [
            (865, (0.0, 0.0, 1.25), 0, 0.05, 10.9),  # beside the first mode, which it splits
            (863, (-0.27, 0.0, 1.48), 2, 0.25, 30.0),
            (864, (0.31, 0.0, 1.48), 1, 0.1, 110.0),
        ]
    ),
)
def test_attached_oscillator_has_correct_position_mass_and_frequency(
    learnt: tuple[Reference, Model], seed: int, at: tuple[float, float, float], axis: int, mass: float, frequency: float
) -> None:
    found = explained(learnt, hung(learnt[1], at, axis, mass, frequency), seed)
    diagnosis = found.diagnosis
    assert (diagnosis.verdict, [c.cause for c in diagnosis.causes]) == ("explained", ["attached_oscillator"])
    (cause,) = diagnosis.causes
    assert cause.where is not None
    assert cause.where.position is not None
    assert cause.where.position_std is not None
    assert np.linalg.norm(np.subtract(cause.where.position, at)) < max(0.015, 4 * cause.where.position_std)
    assert abs(cause.parameters["mass"].value - mass) < 4 * cause.parameters["mass"].std
    assert cause.parameters["frequency"].value == pytest.approx(frequency, rel=2e-3)
    assert abs(cause.parameters["damping"].value - 0.004) < 4 * cause.parameters["damping"].std
    assert found.extended is not None
    (written,) = found.extended.oscillator
    assert abs(written.direction[axis]) == pytest.approx(1)
    extended = build_model(found.extended, shear_flexible=True, mass="consistent").modes(4).frequency
    true = hung(learnt[1], at, axis, mass, frequency).modes(4).frequency
    np.testing.assert_allclose(extended, true, rtol=5e-3)


@pytest.mark.parametrize(("seed", "frequency"), few_of([(866, 75.0), (867, 98.0)], 0))
def test_oscillator_with_unmeasured_mode_is_found_by_the_shifted_mode(
    learnt: tuple[Reference, Model], seed: int, frequency: float
) -> None:
    """A twelfth of the mode's frequency above or below: each of the two is half the oscillator's, and one is seen.

    Nor does the mixture of two close modes pass for the missing mode.
    """
    reference, bare = learnt
    at, mass = (0.0, 0.0, 1.04), 0.06
    event, _ = event_of(reference, hung(bare, at, 1, mass, frequency), seed)
    split = reference.baseline.log_frequency
    print(np.exp(event.log_frequency), np.exp(split))
    mixed = event.only(np.array([0]))
    mixed = replace(mixed, log_frequency=mixed.log_frequency - 0.003, shape_std=np.full((1, 12), 0.2))
    (cause,) = diagnose(reference, event, circumstances=Circumstances(extra=mixed)).diagnosis.causes
    assert cause.cause == "attached_oscillator"
    assert cause.where is not None
    assert cause.where.position is not None
    assert np.linalg.norm(np.subtract(cause.where.position, at)) < 0.03
    assert cause.parameters["frequency"].value == pytest.approx(frequency, rel=0.03)
    assert cause.parameters["mass"].value == pytest.approx(mass, rel=0.15)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [869])
def test_poorly_determined_oscillator_frequency_has_a_large_deviation(
    learnt: tuple[Reference, Model], seed: int
) -> None:
    """Across its spring 214 g ride with the frame; along it, near the column, no mode moves them."""
    reference, bare = learnt
    at, mass, frequency = (0.0877, 0.0, 1.48), 0.2136, 19.1
    event, _ = event_of(reference, hung(bare, at, 2, mass, frequency), seed)
    (cause,) = diagnose(reference, event).diagnosis.causes
    stated, weighed = cause.parameters["frequency"], cause.parameters["mass"]
    assert cause.cause == "attached_oscillator"
    assert stated.std > 0.2 * stated.value
    assert abs(np.log(stated.value / frequency)) < 2 * stated.std / stated.value
    assert abs(weighed.value - mass) < 3 * weighed.std


@pytest.mark.parametrize("seed", few_of([871, 872]))
def test_spurious_mode_of_random_shape_is_ignored(learnt: tuple[Reference, Model], seed: int) -> None:
    """Something that identification took for a mode: at a random frequency, of a random shape."""
    reference, bare = learnt
    event, _ = event_of(reference, bare, seed, 8)
    random = np.random.default_rng((seed, 1))
    shape = random.standard_normal((1, 12))
    stray = replace(
        event.only(np.array([2])),
        log_frequency=np.log(random.uniform(15.0, 140.0, 1)),
        shape=shape / np.linalg.norm(shape),
    )
    diagnosis = diagnose(reference, event, circumstances=Circumstances(extra=stray), only=ONLY).diagnosis
    assert diagnosis.verdict == "nothing_to_explain"


def test_model_mode_missing_in_the_baseline_is_no_change(learnt: tuple[Reference, Model]) -> None:
    """The ninth of the frame, which the baseline lacks and the reference's model has."""
    event, known = event_of(learnt[0], learnt[1], 881, 9)
    assert known.extra is not None
    found = diagnose(learnt[0], event, circumstances=known, only=ONLY)
    assert found.diagnosis.verdict == "nothing_to_explain"
    assert "attached_oscillator" not in {r.cause for r in found.rejected}


@pytest.mark.parametrize(("seed", "mode", "off"), few_of([(891, 1, 0.004), (892, 3, -0.012)]))
def test_mode_identified_twice_is_no_change(learnt: tuple[Reference, Model], seed: int, mode: int, off: float) -> None:
    """Identification split one mode in two, the second a little off the first and with its shape."""
    reference, bare = learnt
    event, _ = event_of(reference, bare, seed, 8)
    twice = event.only(np.array([mode]))
    twice = replace(twice, log_frequency=twice.log_frequency + off)
    diagnosis = diagnose(reference, event, circumstances=Circumstances(extra=twice), only=ONLY).diagnosis
    assert diagnosis.verdict == "nothing_to_explain"


@pytest.mark.thorough
def test_extended_model_with_oscillator_needs_no_further_cause(learnt: tuple[Reference, Model]) -> None:
    """Fresh modes of the same frame, against the structure file with the oscillator written in, taken at its word."""
    model = hung(learnt[1], (-0.27, 0.0, 1.48), 2, 0.25, 30.0)
    extended = explained(learnt, model, 863).extended
    assert extended is not None
    random = np.random.default_rng(913)
    windows = stack_tracks([measure(model, random, GAIN, n_modes=9) for _ in range(5)], [np.arange(9)] * 5)
    reference = nominal_reference(extended, windows)
    fresh = reference.mean_of(windows)
    assert (match_modes(reference.baseline, fresh) >= 0).sum() == 9
    assert diagnose(reference, matched(reference.baseline, fresh)).diagnosis.verdict == "nothing_to_explain"


@pytest.mark.thorough
def test_light_oscillator_is_found_by_its_own_mode(learnt: tuple[Reference, Model]) -> None:
    """A mode that the baseline lacks is no drift, and the advice states how to be surer of it."""
    found = explained(learnt, hung(learnt[1], (0.3, 0.0, 1.48), 2, 0.006, 120.0), 871)
    assert found.diagnosis.verdict != "nothing_to_explain"
    assert "attached_oscillator" in [cause.cause for cause in found.diagnosis.causes]
    assert found.next_measurement


@pytest.mark.thorough
def test_next_measurement_compares_oscillator_with_added_mass(learnt: tuple[Reference, Model]) -> None:
    """Hypotheses with and without motions of their own are set against each other."""
    reference, bare = learnt
    event, known = event_of(reference, hung(bare, (0.3, 0.0, 1.48), 2, 0.05, 120.0), 872)
    weighing = EvidenceComparison(reference, compare(reference, event, circumstances=known))
    singles = {c.names: c.chosen for c in weighing.singles()}
    open_ones = [singles[("attached_oscillator",)], singles[("added_mass",)]]
    bodies = weighing.causes["added_mass"]
    assert isinstance(bodies, AddedMass)
    reported = next_measurement(reference, event, weighing.data, bodies, open_ones, np.full(2, 0.5))
    assert reported.hypotheses == (("attached_oscillator",), ("added_mass",))
    assert reported.measurements or reported.inseparable

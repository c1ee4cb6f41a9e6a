"""One factor on all frequencies: its cause, where data other than the modes determine it."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Circumstances,
    Diagnosis,
    DiagnosisResult,
    Model,
    Reference,
    build_model,
    diagnose,
    learn_reference,
    matched,
    stack_tracks,
)
from updater.modal_data import tone_ratios

TRACK = np.arange(8)
EVERYTHING = {"global_stiffness", "global_density", "temperature", "sampling_clock"}
GAIN = np.ones(12)


@pytest.fixture(scope="module")
def learnt() -> tuple[Reference, Model]:
    random = np.random.default_rng(801)
    bare = true_model(np.random.default_rng(802))
    return learn_reference(t_frame(), [measure(bare, random, GAIN) for _ in range(8)], [TRACK] * 8), bare


def warmed(model: Model, kelvin: float) -> Model:
    """The true frame, its steel softer by 3.6e-4 a kelvin and longer by 1.2e-5, its joints and feet as they were."""
    structure = model.structure
    steel = structure.material["steel"]
    softer = {key: getattr(steel, key) * (1 - 3.6e-4 * kelvin) for key in ("youngs_modulus", "shear_modulus")}
    thinner = {"density": steel.density * (1 - 3 * 1.2e-5 * kelvin)}
    material = {"steel": steel.model_copy(update=softer | thinner)}
    return build_model(structure.model_copy(update={"material": material}), shear_flexible=True, mass="consistent")


def denser(model: Model, factor: float) -> Model:
    steel = model.structure.material["steel"]
    material = {"steel": steel.model_copy(update={"density": steel.density * factor})}
    return replace(model, structure=model.structure.model_copy(update={"material": material}), mass=model.mass * factor)


def found(
    learnt: tuple[Reference, Model], model: Model, circumstances: Circumstances, seed: int, clock: float = 1.0
) -> DiagnosisResult:
    reference, random = learnt[0], np.random.default_rng(seed)
    print(f"seed {seed}")
    windows = [measure(model, random, GAIN) for _ in range(5)]
    read = [replace(w, frequency=w.frequency * clock, frequency_std=w.frequency_std * clock) for w in windows]
    event = matched(reference.baseline, reference.mean_of(stack_tracks(read, [TRACK] * 5)))
    return diagnose(reference, event, circumstances=circumstances)


def named(diagnosis: Diagnosis) -> set[str]:
    return {name for cause in diagnosis.causes for name in (cause.cause, *cause.cannot_be_told_from)}


@pytest.mark.thorough
def test_density_change_is_ambiguous_from_modes_alone(learnt: tuple[Reference, Model]) -> None:
    diagnosis = found(learnt, denser(learnt[1], 1.02), Circumstances(), 811).diagnosis
    assert diagnosis.verdict == "ambiguous"
    assert named(diagnosis) == EVERYTHING
    assert len(diagnosis.causes) == 1
    assert diagnosis.causes[0].probability > 0.95


def test_measured_warming_identifies_temperature_as_cause(learnt: tuple[Reference, Model]) -> None:
    """30 K by two sensors of half a kelvin: the law's 14 % leaves a shift that no other maker has to have."""
    warm = Circumstances(warmer=30.0, warmer_std=0.5)
    diagnosis = found(learnt, warmed(learnt[1], 30.0), warm, 821).diagnosis
    assert (diagnosis.verdict, named(diagnosis)) == ("explained", {"temperature"})
    softening = diagnosis.causes[0].parameters["softening"]
    assert abs(softening.value - (3.6e-4 - 3 * 1.2e-5)) < 4 * softening.std  # frequencies see stiffness over mass


@pytest.mark.thorough
def test_constant_measured_temperature_excludes_temperature_as_cause(learnt: tuple[Reference, Model]) -> None:
    still = Circumstances(warmer=0.1, warmer_std=0.5)
    diagnosis = found(learnt, denser(learnt[1], 1.02), still, 831).diagnosis
    assert diagnosis.verdict == "ambiguous"
    assert named(diagnosis) == EVERYTHING - {"temperature"}


def test_shifted_tones_identify_a_sampling_clock_error(learnt: tuple[Reference, Model]) -> None:
    """Mains and its third harmonic, which wandered by 2e-4, read by a clock 0.6 % off."""
    tones = tone_ratios(np.array([50.0, 150.0]), np.array([50.0, 150.0]) * 1.0002 * 1.006)
    assert tones == pytest.approx(np.log(1.0002 * 1.006))
    explained = found(learnt, learnt[1], Circumstances(tones=tones), 841, clock=1.006)
    diagnosis = explained.diagnosis
    assert (diagnosis.verdict, named(diagnosis)) == ("explained", {"sampling_clock"})
    error = diagnosis.causes[0].parameters["error"]
    assert abs(error.value - 0.006) < 4 * error.std
    assert explained.extended is not None
    assert explained.extended.recorder is not None
    assert explained.extended.recorder.clock == pytest.approx(1 + error.value, abs=2 * error.std)


@pytest.mark.parametrize(
    "tones", few_of([[0.0, -0.0003, 0.02], [0.0001]]), ids=["mains and a machine that slowed", "mains"]
)
def test_unshifted_tones_exclude_a_sampling_clock_error(learnt: tuple[Reference, Model], tones: list[float]) -> None:
    still: FloatArray = np.array(tones)
    diagnosis = found(learnt, denser(learnt[1], 1.02), Circumstances(tones=still), 851).diagnosis
    assert diagnosis.verdict == "ambiguous"
    assert named(diagnosis) == EVERYTHING - {"sampling_clock"}


def test_tones_far_apart_are_not_paired() -> None:
    assert not len(tone_ratios(np.array([50.0]), np.array([60.0])))
    assert not len(tone_ratios(np.empty(0), np.array([60.0])))

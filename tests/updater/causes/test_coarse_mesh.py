"""A structure file whose mesh is too coarse, with modes of the same frame on a fine one."""

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    DiagnosisResult,
    Model,
    Structure,
    build_model,
    diagnose,
    learn_reference,
    matched,
    nominal_reference,
    stack_tracks,
)
from updater.causes.model.coarse_mesh import propose_mesh_error
from updater.inference import compare

TRACK = np.arange(8)
GAIN = np.ones(12)
OF_FILES = ("mesh_error", "model_parameters", "support_stiffness", "joint_stiffness")


def coarse(elements: int) -> Structure:
    structure = t_frame()
    members = tuple(m.model_copy(update={"elements": elements}) for m in structure.member)
    return structure.model_copy(update={"member": members})


def asked(structure: Structure, truth: Model, seed: int, *only: str) -> DiagnosisResult:
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    windows = stack_tracks([measure(truth, random, GAIN) for _ in range(5)], [TRACK] * 5)
    reference = nominal_reference(structure, windows)
    return diagnose(reference, matched(reference.baseline, reference.mean_of(windows)), only=only)


@pytest.fixture(scope="module")
def truth() -> Model:
    return build_model(t_frame().with_mesh(0.01), shear_flexible=True, mass="consistent")


@pytest.mark.parametrize("only", few_of([[*OF_FILES, "added_mass", "global_stiffness"], []]), ids=len)
def test_three_elements_per_member_are_diagnosed_as_mesh_error(truth: Model, only: list[str]) -> None:
    """Among the errors that a file may have and two other causes; `make thorough`: among all."""
    found = asked(coarse(3), truth, 911, *only)
    assert (found.diagnosis.verdict, [c.cause for c in found.diagnosis.causes]) == ("explained", ["mesh_error"])
    assert found.extended is not None
    again = asked(found.extended, truth, 912, "mesh_error", "model_parameters")
    assert again.diagnosis.verdict == "nothing_to_explain"


def test_forty_elements_per_member_give_no_mesh_error(truth: Model) -> None:
    found = asked(coarse(40), truth, 921)
    assert found.diagnosis.verdict == "nothing_to_explain"
    assert "mesh_error" not in {r.cause for r in found.rejected}


def test_mesh_error_prediction_matches_the_refined_model() -> None:
    """In the coarse model's thirty modes: the compared ones to 1e-3, of which the coarse mesh is up to 3e-2 off."""
    random = np.random.default_rng(931)
    structure = coarse(4)
    refined = build_model(coarse(16), shear_flexible=True, mass="consistent")
    windows = stack_tracks([measure(refined, random, GAIN) for _ in range(5)], [TRACK] * 5)
    reference = nominal_reference(structure, windows, n_modes=20)
    data = compare(reference, matched(reference.baseline, reference.mean_of(windows)))
    cause = propose_mesh_error(reference, data)
    assert cause is not None
    found = np.linalg.eigvalsh(np.diag((2 * np.pi * data.frequency) ** -2.0) + cause.flexibility)[::-1]
    exact = refined.modes(8).frequency
    np.testing.assert_allclose(found[:8] ** -0.5 / (2 * np.pi), exact, rtol=1e-3)
    assert np.abs(data.frequency[:8] / exact - 1).max() > 5e-3


def test_mesh_error_is_not_proposed_for_a_measured_baseline() -> None:
    random = np.random.default_rng(941)
    bare = true_model(np.random.default_rng(942))
    reference = learn_reference(coarse(3), [measure(bare, random, GAIN) for _ in range(5)], [TRACK] * 5)
    event = stack_tracks([measure(bare, random, GAIN) for _ in range(3)], [TRACK] * 3)
    data = compare(reference, matched(reference.baseline, reference.mean_of(event)))
    assert propose_mesh_error(reference, data) is None

"""Errors of external matrices without a learned reference: factors of all, of groups, and springs of the file.

The model is made of OpenSees' ShellMITC4 elements of 0.05 m, the measured table of scikit-fem's Morley triangles.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.support.opensees import needs_opensees
from tests.support.thorough import few_of
from tests.support.updater.frames import unmoved
from tests.support.updater.moved_parameters import Differenced, Moved
from tests.support.updater.plates import CHANNELS, FEET, FOOT, N_MODES, Table, windows, write_table
from tests.support.updater.written_models import file_error
from updater import (
    Reference,
    Structure,
    build_model,
    diagnose,
    dump_structure,
    load_structure,
    matched,
    nominal_reference,
    parse_structure,
    stack_tracks,
)
from updater.causes import ModelParameters, SelectedCause, prediction, propose_model_parameters
from updater.inference import Comparison, compare, linearised

pytestmark = needs_opensees

#: mesh, feet as springs of the file, hidden factors, parameters that are named, largest error of feet
CASES: list[tuple[int, bool, dict[str, float], set[str], float]] = [
    (15, True, {"foot_ne": 0.5, "panel_10": 0.9}, {"support 3.z"}, 0.1),
    (30, False, {"panel_10": 0.85, "foot_ne": 0.6}, {"panel_10.K", "foot_ne.K"}, 0.05),
    (30, True, {"foot_sw": 0.5, "foot_ne": 1.6}, {"support 0.z", "support 3.z"}, 0.05),
    (
        *(30, False, {"foot_sw": 0.5, "foot_ne": 0.5, "panel_01": 0.8, "panel_21": 0.8, "panel_11": 0.8}),
        *({"foot_sw.K", "foot_ne.K"}, 0.05),
    ),
]
ONLY = ("model_parameters", "local_stiffness", "support_stiffness", "added_mass", "global_stiffness")


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> tuple[Reference, Comparison, ModelParameters]:
    """The file of a coarse table with two feet as groups and as springs, and modes that are its own."""
    file = write_table(tmp_path_factory.mktemp("coarse"), supports=True)
    structure, random = load_structure(file), np.random.default_rng(5)
    model = build_model(structure, mass="consistent")
    modes = model.modes(N_MODES)
    own = windows((modes.frequency, (model.sensor_rows @ modes.shape).T), 3, random)
    tracked = stack_tracks(own, unmoved(3))
    reference = nominal_reference(structure, tracked)
    data = compare(reference, matched(reference.baseline, reference.mean_of(tracked)))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    return reference, data, cause


@pytest.mark.parametrize("whole", [0.0, 0.2])
def test_predicted_modes_agree_with_those_of_the_written_file(
    coarse: tuple[Reference, Comparison, ModelParameters], whole: float
) -> None:
    """All panels and springs at once, with the factor of all: the group's own factor is multiplied by it."""
    reference, data, cause = coarse
    random = np.random.default_rng(951)
    theta = np.array([0.3 if knob.of_group else 0.5 * knob.mean for knob in cause.knobs])
    theta = theta * random.uniform(-1, 1, len(theta))
    theta[[knob.of_matrices for knob in cause.knobs]] = whole
    modes = build_model(cause.extend(reference.structure, 0, theta), mass="consistent").modes(20)
    found = data.frequency[data.paired] * np.exp(prediction(data, [SelectedCause(cause, 0, theta)]).log_ratio[0])
    assert np.abs(np.log(found / data.frequency[data.paired])).max() > 0.02
    assert np.abs(np.log(found[:, None] / modes.frequency)).min(1).max() < 1e-3


def test_exact_derivatives_match_finite_differences(coarse: tuple[Reference, Comparison, ModelParameters]) -> None:
    _, data, cause = coarse
    assert len(cause.compliance_increments(cause.start)) == len(cause.knobs) - 1  # but for the factor of all
    (rest, exact), (same, differenced) = (linearised(data, of(**vars(cause))) for of in (Moved, Differenced))
    np.testing.assert_array_equal(rest, same)
    exact, differenced = exact * cause.prior_std, differenced * cause.prior_std
    assert np.abs(exact).max() > 1
    np.testing.assert_allclose(exact, differenced, rtol=0, atol=1e-3 * np.abs(exact).max())


@pytest.mark.timeout(600)
@pytest.mark.parametrize(("along", "supports", "factors", "named", "tolerance"), few_of(CASES, 1))
def test_wrong_stiffness_of_a_file_is_found_and_written(
    *, tmp_path: Path, along: int, supports: bool, factors: dict[str, float], named: set[str], tolerance: float
) -> None:
    """The written file is loaded from its text, and compared and diagnosed with the held-out windows.

    Up to 13 % off: modes are paired again on the way. The coarse model's mesh has an error of 0.4 to 2 % of frequency,
    which the fit leaves to the mesh in part: 0.62 % remain (measured). With the right parameters it would be 1.6 %, the
    root mean square of the mesh's own errors, which is the bound.
    """
    file = write_table(tmp_path, along=along, across=8 * along // 15, panels=0.1, supports=supports)
    structure, random = load_structure(file), np.random.default_rng(1)
    truth = Table(factors=factors).modes()
    used, others = (stack_tracks(windows(truth, 3, random), unmoved(3)) for _ in range(2))
    reference = nominal_reference(structure, used)
    measured, heldout = (matched(reference.baseline, reference.mean_of(w)) for w in (used, others))
    found = diagnose(reference, measured, heldout=heldout, only=ONLY)
    print(found.diagnosis.verdict, [(c.cause, c.parameters) for c in found.diagnosis.causes], found.diagnosis.gain)
    (cause,) = found.diagnosis.causes
    assert cause.cause == "model_parameters"
    assert named <= set(cause.parameters)
    assert found.extended is not None
    written = parse_structure(dump_structure(found.extended, file.read_text(encoding="utf-8")), tmp_path / "new.toml")
    for name, stiffness in _feet(written).items():  # the factor of all is free within its prior: the product counts
        assert stiffness == pytest.approx(factors.get(name, 1.0), rel=tolerance)
    gain = found.diagnosis.gain
    assert gain is not None
    assert gain.heldout
    assert gain.frequency_error_percent.before is not None
    assert gain.frequency_error_percent.before > 3
    error = file_error(written, CHANNELS, np.exp(heldout.log_frequency), heldout.shape)
    assert error == pytest.approx(gain.frequency_error_percent.after, rel=1e-6)
    assert file_error(written, CHANNELS, *truth) < (0.2 if along > 15 else 1.6)
    again = nominal_reference(written, others)
    rest = diagnose(again, matched(again.baseline, again.mean_of(others)), only=ONLY)
    assert rest.diagnosis.verdict == "nothing_to_explain"


def _feet(structure: Structure) -> dict[str, float]:
    """Return the stiffness of the feet along z over that of the file."""
    assert structure.external is not None
    if structure.support:
        return {name: s.stiffness["z"] / FOOT for name, s in zip(FEET, structure.support, strict=True)}
    return {name: structure.external.factor * structure.external.group[name].factor for name in FEET}

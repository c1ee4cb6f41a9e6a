"""Choice of updated parameters: fixed or bounded, causes left out; and the parameters' sensitivities."""

import numpy as np
import pytest

from tests.support.updater.diagnosis_data import Change, learnt
from updater import Body, StructureError, calibrate, diagnose, dump_structure, parse_structure, t_structure_toml
from updater.diagnosis import allowed_causes
from updater.reference import best_model, parameter_sensitivities
from updater.structure import ModelParameter, apply_parameters, model_parameters_of, nominal_parameters, with_springs

FRAME = t_structure_toml()
ROUNDING = 1e-7  # relative change by a step, of eigenvalues that are known to 1e-9


def _keys(text: str) -> list[str]:
    return [knob.key for knob in model_parameters_of(parse_structure(text))]


def _knob(text: str, key: str) -> ModelParameter:
    return next(knob for knob in model_parameters_of(parse_structure(text)) if knob.key == key)


def test_parameters_are_fixed_by_name_pattern_or_member() -> None:
    assert {"steel.E", "support 0.ry", "crossbeam.rz", "crossbeam.weld"} <= set(_keys(FRAME))
    assert "steel.E" not in _keys(FRAME + '[updating]\nfixed = ["steel.E"]\n')
    assert "steel.E" not in _keys(FRAME + '[updating]\nfixed = ["column.E"]\n')
    assert not any(key.startswith("support") for key in _keys(FRAME + '[updating]\nfixed = ["support*"]\n'))
    assert _keys(FRAME + '[updating]\nfixed = ["*"]\n') == []


def test_bounds_are_given_in_physical_units() -> None:
    text = FRAME + '[updating.bounds]\n"steel.E" = [200e9, 215e9]\n"support 0.ry" = [5e5, 1e9]\n'
    modulus, foot = _knob(text, "steel.E"), _knob(text, "support 0.ry")
    np.testing.assert_allclose(np.exp([modulus.lower, modulus.upper]), [200 / 210, 215 / 210])
    softest = apply_parameters(parse_structure(FRAME), [foot], np.array([foot.upper])).support[0]
    np.testing.assert_allclose(softest.stiffness["ry"], 5e5)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('fixed = ["steal.E"]', ["steal.E", "steel.E"]),
        ('bounds = {"steel.E" = [220e9, 230e9]}', ["steel.E", "2.1e+11"]),
        ('bounds = {"steel.E" = [215e9, 205e9]}', ["steel.E", "least"]),
        ('fix = ["steel.E"]', ["fix", "fixed"]),
    ],
)
def test_invalid_updating_entry_gives_one_clear_error(entry: str, words: list[str]) -> None:
    with pytest.raises(StructureError) as error:
        parse_structure(f"{FRAME}[updating]\n{entry}\n", "frame.toml")
    assert str(error.value).startswith("frame.toml")
    for word in words:
        assert word in str(error.value)


def test_updating_entries_are_written_and_read_back() -> None:
    structure = parse_structure(
        FRAME + '[updating]\nfixed = ["*.weld"]\n[updating.bounds]\n"steel.E" = [2e11, 2.2e11]\n'
    )
    assert parse_structure(dump_structure(structure)) == structure
    assert parse_structure(dump_structure(structure, FRAME)) == structure


def test_calibration_keeps_fixed_parameters_and_respects_bounds() -> None:
    """The truth's E is off by a per cent or two, its foot and joint give; without parameters nothing is fitted."""
    baseline = learnt(31)[0].baseline

    def calibrated(entry: str) -> float:
        structure = parse_structure(f"{FRAME}[updating]\n{entry}\n")
        return calibrate(structure, baseline).structure.material["steel"].youngs_modulus

    modulus = calibrated("")
    assert abs(modulus / 210e9 - 1) > 1e-3
    assert calibrated('fixed = ["steel.E"]') == 210e9
    assert calibrated('fixed = ["*"]') == 210e9
    bound = 210e9 * (1 + 0.3 * (modulus / 210e9 - 1))
    limits = sorted([bound, 210e9 + (210e9 - bound)])
    assert calibrated(f'bounds = {{"steel.E" = {limits}}}') == pytest.approx(bound, rel=1e-4)


def test_a_diagnosis_can_be_limited_to_some_causes() -> None:
    """The command's tests cover causes that are left out."""
    reference, _, event = learnt(202)
    current = event(Change(bodies=(Body(at=(0.2, 0, 1.48), mass=0.3),)))
    only = diagnose(reference, current, only=("added_mass", "local_stiffness"))
    assert [cause.cause for cause in only.diagnosis.causes] == ["added_mass"]
    assert {c.cause for c in only.rejected} == {"local_stiffness"}


def test_unknown_cause_is_refused_with_a_suggestion() -> None:
    with pytest.raises(ValueError, match=r"added_mas.*did you mean 'added_mass'"):
        allowed_causes(without=("added_mas",))
    with pytest.raises(ValueError, match="no cause is left"):
        allowed_causes(only=("added_mass",), without=("added_mass",))


def test_sensitivities_match_recomputed_models() -> None:
    """Compared with models solved again with a hundredth of each step; 1 % of the largest, for second-order effects.

    A wall's thickness changes stiffness and mass alike, so that only rounding of the eigenvalues is left.
    """
    structure = parse_structure(FRAME)
    frequency, found = parameter_sensitivities(structure, 8)
    knobs, sprung = model_parameters_of(structure, of_file=True), with_springs(structure)
    assert [one.name for one in found] == [knob.key for knob in knobs]
    for i, (knob, one) in enumerate(zip(knobs, found, strict=True)):
        start, moved = nominal_parameters(knobs), nominal_parameters(knobs)
        moved[i] += 0.01 * (-knob.prior if knob.kind in {"stiffness", "section"} else knob.prior)
        if knob.kind == "weld":
            start[i] = 1e-6
        before, after = (best_model(apply_parameters(sprung, knobs, x)).modes(8).frequency for x in (start, moved))
        change = 100 * np.log(after / before)
        tolerance = 0.01 * np.abs(change).max() + ROUNDING
        np.testing.assert_allclose(one.change, change, atol=tolerance, err_msg=knob.key)
    np.testing.assert_allclose(frequency[:2], [10.78, 10.97], rtol=1e-3)
    assert found[0].nominal == 210e9
    assert np.isinf(next(one for one in found if one.name == "support 0.ry").nominal)

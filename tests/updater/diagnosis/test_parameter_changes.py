"""Model parameters as a diagnosis reports and writes them: places, units, before and after, digits that are known."""

import numpy as np
import pytest

from daq.notebook import number_text
from monitor.analysis.explanation import explain
from monitor.text.causes import cause_text, change_texts
from tests.examiner.cases import draw
from tests.examiner.path import FRAME, after, stiffer
from tests.support.updater.diagnosis_data import Change, learnt
from updater import DiagnosisResult, build_model, diagnose, dump_structure, parse_structure, t_structure_toml
from updater.causes import ModelParameters
from updater.quantities import ParameterChange

TOO_STIFF = 1.2
MIN_FLEXIBILITY = 1.5e-5  # c E I / L under which a connection is written as rigid


def _of_a_stiff_file(seed: int, *only: str) -> DiagnosisResult:
    case = draw("built frame: nothing", seed)
    random = np.random.default_rng((case.seed, 6))
    measured, heldout = (after(case, random) for _ in range(2))
    return explain(stiffer(FRAME, TOO_STIFF), None, measured, heldout, only=only).explained


@pytest.fixture(scope="module")
def found() -> DiagnosisResult:
    return _of_a_stiff_file(961, "model_parameters")


def _changes(found: DiagnosisResult) -> dict[str, ParameterChange]:
    return {change.name: change for cause in found.diagnosis.causes for change in cause.changes}


def test_each_change_has_position_unit_and_both_values(found: DiagnosisResult) -> None:
    changes = _changes(found)
    modulus = changes["steel.E"]
    assert (modulus.unit, modulus.position, modulus.quantity) == ("Pa", None, "Young's modulus")
    assert modulus.before == pytest.approx(TOO_STIFF * 210e9)
    assert abs(modulus.after / 210e9 - 1) < 0.05  # the specimen's own differs by some per cents
    for name, change in changes.items():
        if name.startswith("support"):
            assert (change.unit, change.position, change.before) == ("N m/rad", (0.0, 0.0, 0.0), None)
        if name.startswith("crossbeam"):
            assert change.position == (0.0, 0.0, 1.48)
    assert [cause.where for cause in found.diagnosis.causes] == [None]


def test_every_changed_parameter_is_stated_and_the_significant_ones_first(found: DiagnosisResult) -> None:
    """A connection's flexibility, which the file has as 0, has the relative deviation of its stiffness."""
    (cause,) = found.diagnosis.causes
    significant = [change.significant for change in cause.changes]
    assert significant == sorted(significant, reverse=True)
    assert significant[0]
    assert not significant[-1]
    for change in cause.changes:
        away = change.after if change.before is None else abs(change.after - change.before)
        assert (away > 2 * change.std) == change.significant, change
    assert found.extended is not None
    springs = {f"support 0.{axis}" for axis in found.extended.support[0].stiffness}
    springs |= {f"crossbeam.{axis}" for joint in found.extended.joint for axis in joint.stiffness}
    assert springs
    assert springs <= _changes(found).keys(), "written and not stated"


def test_cause_text_uses_engineering_units(found: DiagnosisResult) -> None:
    text = cause_text(found.diagnosis.causes[0])
    assert "Young's modulus of steel 252 -> 2" in text
    assert " GPa (-1" in text
    assert "L/(E I)" not in text


def test_written_file_has_few_digits_and_no_redundant_entries(found: DiagnosisResult) -> None:
    assert found.extended is not None
    text = dump_structure(found.extended, t_structure_toml())
    written = parse_structure(text)
    unit = written.material["steel"].youngs_modulus * 9.3e-8 / 1.48
    springs = [k for support in written.support for k in support.stiffness.values()]
    springs += [k for joint in written.joint for k in joint.stiffness.values()]
    assert springs
    assert all(unit / k >= MIN_FLEXIBILITY for k in springs)
    factors = [(segment.stiffness, *segment.bending, segment.torsion) for segment in written.segment]
    assert all(max(abs(factor - 1) for factor in of) >= 1e-4 for of in factors)
    for value in (*springs, *(factor for of in factors for factor in of)):
        assert len(f"{value:.12g}".strip("0").replace(".", "").strip("0")) <= 5, value


def test_rounding_changes_frequencies_by_less_than_0_1_per_cent(found: DiagnosisResult) -> None:
    """Frequencies scatter by 0.02 to 0.07 % in a window; the file's are compared with the fit's own prediction."""
    assert found.extended is not None
    own = build_model(found.extended, shear_flexible=True, mass="consistent").modes(40).frequency
    for mode in found.diagnosis.modes:
        if mode.frequency.after and mode.frequency.measured:
            assert np.abs(np.log(own / mode.frequency.after)).min() < 1e-3


def test_loosened_foot_is_reported_with_values_before_and_after() -> None:
    reference, _, event = learnt(41, Change(foot={"rx": 0.7}))  # a stiffer foot is as good as rigid, as far as known
    found = diagnose(reference, event(Change(foot={"rx": 0.21})))
    (cause,) = found.diagnosis.causes
    assert cause.cause == "support_stiffness"
    (change,) = (change for change in cause.changes if change.name == "support 0.rx")
    before = dict(reference.structure.support[0].stiffness)["rx"]
    assert change.before == before
    assert change.after == cause.parameters["stiffness_rx"].value
    assert change.after < before
    assert change.place == "foot of the column"
    added, std = change.added_flexibility
    assert change.overlaps  # the foot's own stiffness is hardly known, what was added to its flexibility is
    assert added > 50 * std
    shown = number_text(1e6 * added, 1e6 * std, sign=True)
    assert f"rotational flexibility about x {shown} mrad per kN m (" in cause_text(cause)
    structure = reference.structure
    column = next(member for member in structure.member if member.name == "column")
    end = 4 * structure.material[column.material].youngs_modulus * 9.3e-8 / column.length  # a square tube
    assert change.member == "column"
    assert change.member_stiffness == pytest.approx(end)


def test_parameter_at_its_bound_is_listed_without_a_deviation() -> None:
    """The file is 20 % too stiff, and the modulus may be 5 % lower at most: a deviation of this value means nothing."""
    case = draw("built frame: nothing", 961)
    least = 0.95 * TOO_STIFF * 210e9
    structure = stiffer(FRAME, TOO_STIFF)
    bounds = structure.updating.model_copy(update={"bounds": {"steel.E": (least, 1.1 * TOO_STIFF * 210e9)}})
    structure = structure.model_copy(update={"updating": bounds})
    measured = after(case, np.random.default_rng((case.seed, 6)))
    data = explain(structure, None, measured, only=("model_parameters",)).explained
    part = data.parts[0] if data.parts else None
    print(data.diagnosis.verdict)
    assert part is not None
    cause = part.hypotheses
    assert isinstance(cause, ModelParameters)
    (modulus,) = (change for change in cause.changes(part) if change.name == "steel.E")
    assert (modulus.at_bound, modulus.listed, modulus.significant, modulus.std) == (True, True, False, 0.0)
    assert modulus.after == pytest.approx(least)
    assert change_texts(modulus)[1] == "239.4 GPa (-5 %), at its bound"

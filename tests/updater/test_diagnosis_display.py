"""Short description and table of a diagnosis in a notebook."""

from updater import Cause, Diagnosis, DiagnosisResult
from updater.quantities import Quantity, Where

MASS = Cause(
    cause="added_mass",
    probability=0.9999,
    where=Where(member="crossbeam", position=(0.1568, 0.0, 1.48), position_std=0.0042),
    parameters={"mass": Quantity(value=0.1971, std=0.0032, unit="kg")},
)
FAULT = Cause(cause="sensor_gain", probability=0.75, where=Where(channels=("top_x", "top_y")), parameters={})
WARM = Cause(cause="temperature", probability=0.5, where=None, parameters={})
EXPLAINED = Diagnosis(verdict="explained", causes=(MASS, FAULT, WARM), modes=(), gain=None)


def test_diagnosis_is_described_by_its_causes() -> None:
    text = "Diagnosis(explained: added_mass > 0.99, sensor_gain 0.750, temperature 0.500)"
    assert repr(EXPLAINED) == str(EXPLAINED) == text
    none = Diagnosis(verdict="nothing_to_explain", causes=(), modes=(), gain=None)
    assert repr(none) == "Diagnosis(nothing_to_explain)"
    assert repr(DiagnosisResult(EXPLAINED, None)) == f"DiagnosisResult({text})"


def test_table_has_a_row_per_cause() -> None:
    shown = DiagnosisResult(EXPLAINED, None)._repr_html_()
    assert shown == EXPLAINED._repr_html_()
    row = "<td>added mass</td><td>&gt; 0.99</td><td>mass 0.197 ± 0.003 kg</td><td>crossbeam</td>"
    assert row + "<td>0.157, 0.000, 1.480 ± 0.004</td>" in shown
    assert "<td>sensor gain</td><td>0.750</td><td></td><td>top_x, top_y</td><td></td>" in shown
    assert "<td>temperature</td>" in shown

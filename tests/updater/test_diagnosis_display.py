"""Short description, table and figure of a diagnosis in a notebook."""

import numpy as np
import pytest

from updater import Cause, Diagnosis, DiagnosisResult
from updater.diagnosis import FrequencyFit, ModeFit, Pair, Rejected
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


def refused(cause: str, log_evidence: float) -> Rejected:
    return Rejected(cause=cause, log_evidence=log_evidence, reason="less_probable", p_value=0.5)


def test_figure_has_a_bar_per_cause() -> None:
    found = Diagnosis(verdict="explained", causes=(MASS,), modes=(), gain=None)
    (axes,) = DiagnosisResult(found, None, rejected=(refused("b", -300.0), refused("sensor_dead", -5.0))).plot().axes
    assert [bar.get_width() for bar in axes.patches] == [0.0, -5.0, -20.0]  # type: ignore[attr-defined]
    names = ["added mass: accepted", "-5.0", "dead sensor", "-300", "b"]
    assert [text.get_text() for text in axes.texts] == names
    assert axes.xaxis.get_majorticklabels()[0].get_fontsize() == axes.xaxis.label.get_fontsize()


def test_figure_has_the_errors_of_each_mode_without_and_with_the_causes() -> None:
    fit = FrequencyFit(measured=10.0, std=0.01, before=10.2, after=10.0)
    unpaired = FrequencyFit(measured=30.0, std=0.01, before=None, after=None)
    modes = (
        ModeFit(frequency=fit, mac=Pair(before=0.9, after=0.99)),
        ModeFit(frequency=unpaired, mac=Pair(before=None, after=None)),
    )
    frequency, shape, evidence = EXPLAINED.model_copy(update={"modes": modes}).plot().axes
    before, after = (line for line in frequency.lines if line.get_marker() == "o")
    np.testing.assert_allclose(np.asarray(before.get_ydata(), float), [2.0, np.nan])
    np.testing.assert_allclose(np.asarray(after.get_ydata(), float), [0.0, np.nan], atol=1e-12)
    errors = [np.asarray(line.get_ydata(), float)[0] for line in shape.lines]
    np.testing.assert_allclose(sorted(errors), [0.01, 0.1])
    assert len(evidence.patches) == 1


def test_diagnosis_without_content_is_not_drawn() -> None:
    with pytest.raises(ValueError, match="expected compared modes or weighed causes, found none"):
        Diagnosis(verdict="nothing_to_explain", causes=(), modes=(), gain=None).plot()

"""Figures for notebooks: what they show, and that nothing is shown on a screen."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from daq import Recording
from monitor.results.comparison import DiagnosisAnswer, RejectedCause
from monitor.views.plots import plot_evidence, plot_mac, plot_shapes, plot_spectrum, plot_stabilization
from oma import Identification, identify_all, mac_matrix
from tests.support.oma.structures import chain, simulate
from updater import Cause, parse_structure, t_structure_toml

CHAIN = chain(4, first=2.0, damping=0.01)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(CHAIN, 200.0, 40.0, seed=23)


@pytest.fixture(scope="module")
def found(recording: Recording) -> Identification:
    return identify_all(recording)


def test_stabilization_diagram_needs_the_identification_alone(found: Identification) -> None:
    upper, lower = plot_stabilization(found).axes
    shown = np.concatenate([np.asarray(line.get_xdata(), float) for line in upper.lines if line.get_marker() == "."])
    assert sorted(shown) == sorted(found.poles.frequency)
    assert lower.get_xlabel() == "frequency [Hz]"


def test_spectrum_has_a_line_per_channel_and_a_mark_per_mode(recording: Recording, found: Identification) -> None:
    (plain,) = plot_spectrum(recording).axes
    assert len(plain.lines) == len(recording.channels)
    assert plain.get_xlim() == (0, recording.rate / 2)
    (marked,) = plot_spectrum(recording, found).axes
    at = [np.asarray(line.get_xdata(), float)[0] for line in marked.lines[len(recording.channels) :]]
    np.testing.assert_allclose(at, [*found.estimate.frequency, *found.harmonics])


def test_mac_of_two_estimates(recording: Recording, found: Identification) -> None:
    estimate = found.estimate
    part = estimate[np.array([2, 0])]
    drawn = plot_mac(estimate, part).axes[0].images[0].get_array()
    np.testing.assert_allclose(np.asarray(drawn, float), mac_matrix(estimate.shape, part.shape))
    np.testing.assert_allclose(np.diag(np.asarray(plot_mac(estimate).axes[0].images[0].get_array(), float)), 1)
    with pytest.raises(ValueError, match="b: expected the channels"):
        plot_mac(estimate, replace(estimate, channels=("a", "b", "c", "d")))


def test_shapes_with_and_without_a_structure(found: Identification) -> None:
    structure = parse_structure(t_structure_toml(), "t")
    assert len(plot_shapes(found.estimate).axes) == found.estimate.n_modes
    with pytest.raises(ValueError, match="structure: expected a sensor of"):
        plot_shapes(found.estimate, structure)


def test_evidence_has_a_bar_per_cause() -> None:
    mass = Cause(cause="added_mass", probability=0.99, where=None, parameters={})
    refused = tuple(RejectedCause(cause=name, log_evidence=e, why="") for name, e in (("b", -300.0), ("a", -5.0)))
    answer = DiagnosisAnswer(
        verdict="explained", causes=(mass,), modes=(), gain=None, rejected=refused, next_measurement=""
    )
    (axes,) = plot_evidence(answer).axes
    assert [bar.get_width() for bar in axes.patches] == [0.0, -5.0, -20.0]  # type: ignore[attr-defined]
    assert [text.get_text() for text in axes.texts] == ["added mass: accepted", "-5.0", "a", "-300", "b"]
    assert axes.xaxis.get_majorticklabels()[0].get_fontsize() == axes.xaxis.label.get_fontsize()
    nothing = answer.model_copy(update={"causes": (), "rejected": ()})
    with pytest.raises(ValueError, match="expected weighed causes, found none"):
        plot_evidence(nothing)


def test_oma_does_not_load_matplotlib_and_plots_do_not_load_pyplot() -> None:
    script = (
        "import sys, oma; assert 'matplotlib' not in sys.modules\n"
        "import monitor.views.plots; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)

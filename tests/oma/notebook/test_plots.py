"""Figures of estimates: their content, and that nothing is shown on a screen."""

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

from daq import FloatArray, Recording
from oma import Identification, ModalEstimate, identify, identify_all, mac_matrix, plot_spectrum, plot_tracks
from tests.support.oma.structures import chain, simulate

Vector = tuple[float, float, float]
CHAIN = chain(4, first=2.0, damping=0.01)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(CHAIN, 200.0, 40.0, seed=23)


@pytest.fixture(scope="module")
def found(recording: Recording) -> Identification:
    return identify_all(recording)


def test_stabilization_diagram_of_an_estimate_has_the_poles_of_its_recording(
    recording: Recording, found: Identification
) -> None:
    estimate = identify(recording)
    upper, lower = estimate.plot_stabilization().axes
    shown = np.concatenate([np.asarray(line.get_xdata(), float) for line in upper.lines if line.get_marker() == "."])
    assert sorted(shown) == sorted(found.poles.frequency)
    assert lower.get_xlabel() == "frequency [Hz]"
    part = estimate[np.array([1])].plot_stabilization().axes[0]
    assert [text.get_text() for text in part.texts] == ["1"]
    with pytest.raises(ValueError, match="poles: expected those of one recording"):
        found.estimate.plot_stabilization()


def test_stabilization_diagram_with_the_recording_has_its_spectrum(recording: Recording, found: Identification) -> None:
    assert len(found.plot_stabilization().axes) == 2
    assert len(found.plot_stabilization(recording).axes) == 3
    short = replace(recording, data=recording.data[:32])
    assert len(found.plot_stabilization(short).axes) == 2


def test_spectrum_has_a_line_per_channel_and_a_mark_per_mode(recording: Recording, found: Identification) -> None:
    (plain,) = plot_spectrum(recording).axes
    assert len(plain.lines) == len(recording.channels)
    assert plain.get_xlim() == (0, recording.rate / 2)
    (marked,) = found.plot_spectrum(recording).axes
    at = [np.asarray(line.get_xdata(), float)[0] for line in marked.lines[len(recording.channels) :]]
    np.testing.assert_allclose(at, [*found.estimate.frequency, *found.harmonics])


def test_mac_of_two_estimates(found: Identification) -> None:
    estimate = found.estimate
    part = estimate[np.array([2, 0])]
    drawn = estimate.plot_mac(part).axes[0].images[0].get_array()
    np.testing.assert_allclose(np.asarray(drawn, float), mac_matrix(estimate.shape, part.shape))
    np.testing.assert_allclose(np.diag(np.asarray(estimate.plot_mac().axes[0].images[0].get_array(), float)), 1)
    with pytest.raises(ValueError, match="other: expected the channels"):
        estimate.plot_mac(replace(estimate, channels=("a", "b", "c", "d")))


@dataclass(frozen=True)
class Column:
    """A column with sensors, as `plot_shapes` requires it of a structure."""

    channels: tuple[str, ...]

    @property
    def axis_lines(self) -> FloatArray:
        return np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 4.0]]])

    @property
    def measuring_axes(self) -> dict[str, tuple[Vector, Vector]]:
        return {name: ((0.0, 0.0, k + 1.0), (2.0, 0.0, 0.0)) for k, name in enumerate(self.channels)}


def test_shapes_are_bars_or_arrows_at_the_sensors(found: Identification) -> None:
    estimate = found.estimate
    bars = estimate.plot_shapes().axes
    assert len(bars) == estimate.n_modes
    heights = [bar.get_height() for bar in bars[1].patches]  # type: ignore[attr-defined]
    np.testing.assert_allclose(heights, estimate.shape[1].real)
    arrows = estimate.plot_shapes(Column(estimate.channels[:2])).axes
    assert [len(axes.collections) for axes in arrows] == [3] * estimate.n_modes  # one of the lines, one per sensor
    with pytest.raises(ValueError, match="structure: expected a sensor of"):
        estimate.plot_shapes(Column(("another",)))


def test_tracks_are_in_the_order_of_time(found: Identification) -> None:
    windows = [moved(found.estimate, start) for start in (40, 0, 80, 120)]
    (axes,) = plot_tracks(windows).axes
    assert len(axes.lines) == 1 + found.estimate.n_modes  # rare ones, and one line per mode
    np.testing.assert_allclose(np.asarray(axes.lines[1].get_xdata(), float), [20 / 60, 1, 100 / 60, 140 / 60])
    with pytest.raises(ValueError, match="estimates: expected at least one window"):
        plot_tracks([])


def moved(estimate: ModalEstimate, seconds: int) -> ModalEstimate:
    start = seconds * 1_000_000_000
    return replace(estimate, start=start, end=start + 40_000_000_000)


def test_packages_do_not_load_matplotlib_and_plots_do_not_load_pyplot() -> None:
    script = (
        "import sys, oma.windows, updater.diagnosis.schema; assert 'matplotlib' not in sys.modules\n"
        "import oma.plots; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)

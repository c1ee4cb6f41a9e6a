"""Modes of a window in one picture: stabilization diagram, spectrum and shapes."""

from pathlib import Path

from daq import Recording
from oma import Identification, ModalEstimate
from oma.plots import draw_poles, draw_spectrum_behind, figure_of_modes, highest_shown, mark_modes
from oma.spectral import drawn_spectrum


def draw_modes(path: Path, recording: Recording, found: Identification, estimate: ModalEstimate) -> None:
    """Write a PNG.

    Parameters
    ----------
    path : of the picture
    recording, found : a window and its identification: spectrum and poles
    estimate : the modes to mark, of this window or of many
    """
    figure, diagram = figure_of_modes(estimate)
    highest = highest_shown(estimate)
    draw_poles(diagram, found.poles, highest)
    if (spectrum := drawn_spectrum(recording)) is not None:
        draw_spectrum_behind(diagram, spectrum, highest)
    mark_modes(diagram, estimate, found.harmonics, highest)
    figure.savefig(path, dpi=110)

"""Recordings for the rerun viewer (.rrd). Only this package imports rerun."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from rerun import RecordingStream

from daq.log import report_progress
from monitor.results.run_results import RunResults, thin
from monitor.views.viewer.cards import write_cards, write_reference
from monitor.views.viewer.diagnosis.recording import write_diagnosis as write_diagnosis
from monitor.views.viewer.increments import draw_increments
from monitor.views.viewer.layout.blueprint import layout
from monitor.views.viewer.modes.mac_matrix import draw_auto_mac
from monitor.views.viewer.modes.shapes import draw_shapes, draw_window_shapes
from monitor.views.viewer.modes.trends import draw_legend, draw_trends
from monitor.views.viewer.posterior import draw_answers
from monitor.views.viewer.primitives import recording_file
from monitor.views.viewer.scene import draw_structure
from monitor.views.viewer.signals.channels import draw_rms, draw_temperatures, write_channels
from monitor.views.viewer.signals.spectra import draw_channel_spectra
from monitor.views.viewer.signals.spectrogram import draw_spectrogram
from monitor.views.viewer.signals.traces import draw_signals
from monitor.views.viewer.spectrum import draw_spectra
from monitor.views.viewer.state_lanes import draw_states, write_events


def write_recording(path: Path, run_results: RunResults) -> None:
    """Write an .rrd file with its views laid out; absent results have no view.

    The file appears under its name when it is complete; an existing one is replaced.

    Parameters
    ----------
    path : of the new file
    run_results : the results of a run, and the signals whose last ten seconds are drawn

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with recording_file(path, f"{run_results.name}-{run_results.start}", layout(run_results)) as recording:
        recording.send_recording_name(run_results.name)
        steps = list(_steps(recording, run_results))
        for number, draw in enumerate(steps, 1):
            draw()
            report_progress(path, number, len(steps))


def _steps(recording: RecordingStream, run_results: RunResults) -> Iterator[Callable[[], None]]:
    """Yield functions that each draw a part."""
    for draw in (
        draw_structure,
        draw_spectra,
        draw_trends,
        draw_legend,
        draw_rms,
        draw_temperatures,
        draw_states,
        write_events,
        draw_answers,
        draw_increments,
        write_cards,
    ):
        yield partial(draw, recording, run_results)
    if run_results.spectra:
        yield partial(draw_spectrogram, recording, run_results)
    if run_results.reference:
        yield partial(write_reference, recording, run_results.reference)
        yield partial(draw_auto_mac, recording, run_results.reference)
        yield partial(draw_shapes, recording, run_results.reference, run_results.start)
        yield partial(draw_window_shapes, recording, run_results.reference, thin(run_results.watched))
    if run_results.signals:
        yield partial(draw_signals, recording, run_results.signals)
        yield partial(draw_channel_spectra, recording, run_results.signals, run_results.reference)
        yield partial(write_channels, recording, run_results.signals)

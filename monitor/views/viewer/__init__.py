"""Recordings for the rerun viewer (.rrd). Only this package imports rerun."""

from pathlib import Path

from monitor.results.story import RunResults
from monitor.views.viewer.cards import write_cards, write_reference
from monitor.views.viewer.diagnosis.recording import write_diagnosis
from monitor.views.viewer.increments import draw_increments
from monitor.views.viewer.layout.blueprint import layout
from monitor.views.viewer.mode_shapes import draw_mode_shapes
from monitor.views.viewer.posterior import draw_answers
from monitor.views.viewer.primitives import recording_file
from monitor.views.viewer.scene import draw_structure
from monitor.views.viewer.signals import draw_signals
from monitor.views.viewer.spectrum import draw_spectra
from monitor.views.viewer.state_lanes import draw_states, write_events
from monitor.views.viewer.trends import draw_trends

__all__ = ["write_diagnosis", "write_recording"]


def write_recording(path: Path, story: RunResults) -> None:
    """Write an .rrd file with its views laid out; absent results have no view.

    The file appears under its name when it is complete; an existing one is replaced.

    Parameters
    ----------
    path : of the new file
    story : the results of a run, and the signals whose last ten seconds are drawn

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with recording_file(path, f"{story.name}-{story.start}", layout(story)) as recording:
        recording.send_recording_name(story.name)
        draw_structure(recording, story)
        draw_spectra(recording, story)
        draw_trends(recording, story)
        draw_states(recording, story)
        write_events(recording, story)
        draw_answers(recording, story)
        draw_increments(recording, story)
        write_cards(recording, story)
        if story.reference:
            write_reference(recording, story.reference)
            draw_mode_shapes(recording, story.reference, story.start)
        if story.signals:
            draw_signals(recording, story.signals)

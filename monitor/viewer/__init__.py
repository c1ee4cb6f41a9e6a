"""The viewer's file (.rrd): results in, laid-out recording out. The only place that knows rerun."""

from pathlib import Path

from monitor.story import Story
from monitor.viewer.blueprint import layout
from monitor.viewer.cards import write_cards, write_reference
from monitor.viewer.change import draw_answers
from monitor.viewer.diagnosed import write_diagnosis
from monitor.viewer.draw import recording_file
from monitor.viewer.increments import draw_increments
from monitor.viewer.scene import draw_structure
from monitor.viewer.shapes import draw_mode_shapes
from monitor.viewer.signals import draw_signals
from monitor.viewer.spectrum import draw_spectra
from monitor.viewer.states import draw_states, write_events
from monitor.viewer.trends import draw_trends

__all__ = ["write_diagnosis", "write_recording"]


def write_recording(path: Path, story: Story) -> None:
    """Write an .rrd file with its views laid out; what the results do not hold gets no view.

    The file appears under its name when it is whole; one that stood there is replaced.

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

"""The viewer's file (.rrd): results in, laid-out recording out. The only place that knows rerun."""

from collections.abc import Sequence
from pathlib import Path

from daq import Recording
from monitor.results import AlarmResult, ReferenceResult, WindowResult
from monitor.viewer.blueprint import layout
from monitor.viewer.cards import write_cards
from monitor.viewer.change import draw_answers
from monitor.viewer.draw import recording_file
from monitor.viewer.scene import draw_structure
from monitor.viewer.shapes import draw_mode_shapes
from monitor.viewer.signals import draw_signals
from monitor.viewer.spectrum import draw_spectra
from monitor.viewer.states import draw_states, write_events
from monitor.viewer.story import Story
from monitor.viewer.trends import draw_trends

__all__ = ["write_recording"]


def write_recording(
    path: Path,
    *,
    reference: ReferenceResult | None,
    windows: Sequence[WindowResult],
    alarms: Sequence[AlarmResult],
    signals: Recording | None = None,
    name: str,
) -> None:
    """Write an .rrd file with its views laid out; what the results do not hold gets no view.

    The file appears under its name when it is whole; one that stood there is replaced.

    Parameters
    ----------
    path : of the new file
    reference : None if the run stopped while learning: then there is no structure to draw
    windows, alarms : in the order of time
    signals : whose last ten seconds are drawn, None for none
    name : of the recording

    Raises
    ------
    ValueError
        If there is no window.
    OSError
        If the file cannot be written.
    """
    story = Story(name=name, reference=reference, windows=tuple(windows), alarms=tuple(alarms), signals=signals)
    with recording_file(path, f"{name}-{story.start}", layout(story)) as recording:
        recording.send_recording_name(name)
        draw_structure(recording, story)
        draw_mode_shapes(recording, story)
        draw_spectra(recording, story)
        draw_trends(recording, story)
        draw_states(recording, story)
        write_events(recording, story)
        draw_answers(recording, story)
        write_cards(recording, story)
        if signals:
            draw_signals(recording, signals)

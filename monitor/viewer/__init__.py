"""The rerun viewer's file: a function of what stands in the log. The only place that knows rerun."""

import os
from collections.abc import Sequence
from pathlib import Path

import rerun as rr

from monitor.results import AlarmResult, ReferenceResult, WindowResult
from monitor.viewer.blueprint import Layout
from monitor.viewer.plots import draw_answers, draw_spectra, draw_states, draw_trends, reference_text, write_cards
from monitor.viewer.scene import draw_mode_shapes, draw_structure

__all__ = ["write_recording"]

_APPLICATION = "modalwatch"


def write_recording(
    path: Path,
    *,
    reference: ReferenceResult | None,
    windows: Sequence[WindowResult],
    alarms: Sequence[AlarmResult],
    name: str,
) -> None:
    """Write an .rrd file with a laid-out overview.

    Parameters
    ----------
    path : of the new file
    reference : None if the baseline was never learnt: then there is no structure to draw
    windows, alarms : in the order of time
    name : of the recording

    Raises
    ------
    ValueError
        If there is no window.
    """
    if not windows:
        raise ValueError("windows: expected at least one, found none")
    os.environ.setdefault("RERUN_ANALYTICS", "0")
    seconds = (windows[-1].end - windows[0].start) * 1e-9
    layout = Layout(reference, seconds, answered=any(w.answer for w in windows))
    recording = rr.RecordingStream(_APPLICATION, recording_id=f"{name}-{windows[0].start}")
    recording.save(path, default_blueprint=layout.blueprint())
    rr.set_log_time_enabled(False, recording=recording)
    rr.set_log_tick_enabled(False, recording=recording)
    recording.send_recording_name(name)
    if reference:
        recording.log("/reference", rr.TextDocument(reference_text(reference), media_type="text/markdown"), static=True)
        draw_mode_shapes(recording, reference)
        draw_structure(recording, reference, windows)
    draw_spectra(recording, windows)
    draw_trends(recording, windows)
    draw_states(recording, windows, alarms)
    draw_answers(recording, windows)
    write_cards(recording, windows)
    recording.flush()
    recording.disconnect()

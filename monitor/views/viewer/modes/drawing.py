"""Mode shapes of the baseline and of windows: on the structure, at the sensors, or per channel without positions."""

from collections.abc import Sequence

import rerun as rr

from monitor.results.windows import ReferenceResult, WindowResult
from monitor.views.viewer.modes.bars import draw_bars, draw_window_bars
from monitor.views.viewer.modes.shapes import draw_measured_shapes, draw_mode_shapes


def draw_shapes(recording: rr.RecordingStream, reference: ReferenceResult, time: int) -> None:
    """Draw the modes of a reference from a time on [ns UTC]."""
    if reference.has_shapes:
        (draw_mode_shapes if reference.has_geometry else draw_bars)(recording, reference, time)


def draw_window_shapes(
    recording: rr.RecordingStream, reference: ReferenceResult, windows: Sequence[WindowResult]
) -> None:
    """Draw the shapes of windows, scaled to those of the reference."""
    if reference.has_shapes:
        (draw_measured_shapes if reference.has_geometry else draw_window_bars)(recording, reference, windows)

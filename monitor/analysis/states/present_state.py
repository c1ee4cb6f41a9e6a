"""Present state of a structure in alarm: a change may go on, or another may follow, while the alarm is active."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from monitor.analysis.states.drift import without_drift
from monitor.analysis.window import Window, synchronized_windows
from updater import stack_tracks
from updater.modal_data import choose_tracks, find_course

# probability at which windows of one state are divided by chance: an alarm may be active for a year of windows
_FALSE_DIVISION = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class PresentState:
    """Windows of the present state."""

    windows: tuple[Window, ...]  #: those that show it, without drift among them
    before: int = 0  #: windows before a step to this state, or before the end of a gradual change, which do not
    since: Literal["alarm", "step", "end"] = "alarm"  #: the windows are those since this event
    gradual: bool = False  #: whether the structure still changes, or has until lately


def present_state(windows: Sequence[Window], devices: Mapping[str, str]) -> PresentState:
    """Return which windows of an alarm show the present state of the structure.

    After a step or a gradual change: the windows since. While the structure changes gradually: the last third, without
    their drift.

    Parameters
    ----------
    windows : in the order of time
    devices : of each channel
    """
    if not windows:
        return PresentState(windows=())
    estimates = synchronized_windows(windows, devices).estimates
    _, _, tracks = choose_tracks(estimates)
    seconds = np.array([window.start - windows[0].start for window in windows]) * 1e-9
    temperature, rms = (np.array([getattr(window, name) for window in windows]) for name in ("temperature", "rms"))
    course = find_course(stack_tracks(estimates, tracks), seconds, temperature, rms)
    if course is None or course.kind == "irregular" or course.p_value > _FALSE_DIVISION:
        return PresentState(windows=tuple(windows))
    last = int(course.last[0])
    if course.kind == "sudden":
        return PresentState(windows=tuple(windows[last:]), before=last, since="step")
    if course.end is not None:
        return PresentState(windows=tuple(windows[course.end :]), before=course.end, since="end")
    level = without_drift(estimates[last:], tracks[last:])
    present = (replace(window, synchronized=e) for window, e in zip(windows[last:], level, strict=True))
    return PresentState(windows=tuple(present), gradual=True)

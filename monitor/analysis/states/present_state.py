"""Present state of a structure in alarm: a change may go on, or another may follow, while the alarm is active."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from daq import FloatArray, IndexArray
from monitor.analysis.window import Window, synchronized_windows
from oma import ModalEstimate
from updater import stack_tracks
from updater.modal_data import choose_tracks, find_course

# probability at which windows of one state are divided by chance: an alarm may be active for a year of windows
_FALSE_DIVISION = 1e-6
_FEWEST = 4  # windows that show a mode, from which its drift is removed


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


def without_drift(estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray]) -> tuple[ModalEstimate, ...]:
    """Remove the lines in time from frequencies and shapes of windows, about the windows' mean time.

    The residuals are enlarged for the slope that was fitted to them.

    Parameters
    ----------
    estimates : of the windows
    tracks : for each window (n_tracks,) indices into its modes, or -1
    """
    time = np.array([estimate.start for estimate in estimates], dtype=np.float64)
    estimates = [replace(e, frequency=e.frequency.copy(), shape=e.shape.astype(np.complex128)) for e in estimates]
    for track in range(len(tracks[0])):
        seen = np.array([w for w, own in enumerate(tracks) if own[track] >= 0])
        if len(seen) < _FEWEST:
            continue
        modes = [int(tracks[w][track]) for w in seen]
        log_frequency = np.log([estimates[w].frequency[mode] for w, mode in zip(seen, modes, strict=True)])
        level = _level(time[seen], log_frequency[:, None])[:, 0]
        for w, mode, value in zip(seen, modes, level, strict=True):
            estimates[w].frequency[mode] = np.exp(value)
        _level_shapes([estimates[w] for w in seen], modes, time[seen])
    return tuple(estimates)


def _level_shapes(estimates: Sequence[ModalEstimate], modes: Sequence[int], time: FloatArray) -> None:
    """Remove the lines in time from the shapes of one mode, in place; windows that lack channels keep theirs."""
    channels = max((estimate.channels for estimate in estimates), key=len)
    full = [k for k, estimate in enumerate(estimates) if estimate.channels == channels]
    if len(full) < _FEWEST:
        return
    shape = np.array([estimates[k].shape[modes[k]] for k in full])
    turn = shape @ shape[0].conj()
    aligned = shape * (turn.conj() / np.maximum(np.abs(turn), 1e-300))[:, None]
    level = _level(time[full], aligned)
    for k, row in zip(full, level, strict=True):
        estimates[k].shape[modes[k]] = row / np.linalg.norm(row)


def _level(time: FloatArray, value: np.ndarray) -> np.ndarray:
    """Return values (n, m) without their lines in time."""
    n = len(time)
    design = np.column_stack([np.ones(n), (time - time.mean()) / np.ptp(time)])
    rest = value - design @ np.linalg.lstsq(design, value, rcond=None)[0]
    return np.asarray(value.mean(0) + rest * np.sqrt((n - 1) / (n - 2)))

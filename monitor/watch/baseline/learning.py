"""Learning of a baseline: windows are collected until it is long enough and of one state."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from monitor.analysis.window import Window
from monitor.detection import effective_number
from monitor.results.windows import LearningProgress
from monitor.settings import Settings
from monitor.text.detection import NO_THERMOMETER
from monitor.text.quantities import duration_text, utc
from monitor.watch.baseline.learned_baseline import LearnedBaseline, learn_baseline
from monitor.watch.memory import Memory
from updater import Structure, TrackedModes, UpdaterError
from updater.modal_data import ChangePoint, find_change

_DAY = 86400.0  # s
_MAX = 288  # windows that the autocorrelation is estimated from, the newest
_CONSTANTS = (2.0, 5.0, 12.0, 30.0, 80.0)  # windows, of the autocorrelation
_MOVED = 1.0  # K: a thermometer is no more certain as that of the structure
_SLOPE_STD = 1e-3  # 1/K of a log frequency: steel has 2e-4, bridges on bearings up to 2e-3
_REGRESSORS = 4  # of the law that a few days determine: constant, temperature, and two of its past
_CORRELATED = 0.5  # of the windows: with fewer effective ones successive windows are not independent


@dataclass(frozen=True, kw_only=True)
class Shortcoming:
    """A respect in which a baseline is too short."""

    text: str  #: sentence on the baseline
    needed: int  #: windows that would be enough


def baseline_shortcomings(windows: Sequence[Window], modes: TrackedModes, step: float) -> tuple[Shortcoming, ...]:
    """Return the shortcomings of a live baseline.

    Parameters
    ----------
    windows : of the baseline
    modes : (n_windows, n_tracks) of these
    step : from one window to the next [s]
    """
    seconds = 1e-9 * np.array([window.start - windows[0].start for window in windows])
    return shortcomings(modes, seconds, np.array([window.temperature for window in windows]), step)


def longer_baseline(n: int, lacking: Sequence[Shortcoming], most: int) -> int:
    """Return how many windows to learn from: as many as needed, but at most twice as many as now."""
    needed = max((one.needed for one in lacking), default=n)
    return max(n, min(needed, 2 * n, most))


def extended_text(n: int, lacking: Sequence[Shortcoming], longer: int, settings: Settings) -> str:
    """Return a sentence on a baseline that is continued."""
    return (
        f"the baseline of {n} windows is {too_short_text(lacking)}; learning is extended to {longer} windows (at most "
        f"{settings.analysis.most_windows}, analysis.baseline_windows_max)"
    )


def too_short_text(lacking: Sequence[Shortcoming]) -> str:
    """Return the shortcomings of a baseline, as part of a sentence."""
    return f"too short: {'; '.join(one.text for one in lacking)}"


def shortcomings(
    modes: TrackedModes, seconds: FloatArray, temperature: FloatArray, step: float
) -> tuple[Shortcoming, ...]:
    """Return the shortcomings of a baseline; empty if it is long enough.

    Windows that are independent of one another and have no temperature that moves are enough at any length. Otherwise a
    day must be covered, and the windows must be worth as many independent ones as make the squared distance of a new
    window from p estimated means and variances at most twice that from the true ones in the mean: 2 p + 3, and one for
    each regressor of the law (Hotelling's T2: expectation of the inverse Wishart distribution).

    Parameters
    ----------
    modes : (n_windows, n_tracks)
    seconds : (n_windows,) start of each window, ascending [s]
    temperature : (n_windows,) [degC], NaN where not known; interpolated over time if most are known, else not used
    step : from one window to the next [s]
    """
    n, p = modes.log_frequency.shape
    read = np.isfinite(temperature)
    known = 2 * int(read.sum()) > n
    moved = float(np.ptp(temperature[read])) if known else 0.0
    there = np.interp(seconds, seconds[read], temperature[read]) if moved > 0 else None
    effective = _effective(modes, there)
    correlated = effective < _CORRELATED * n
    found = []
    covered = float(seconds[-1] - seconds[0]) + step
    if covered < _DAY and (correlated or moved > _MOVED):
        reason = " and ".join(
            text
            for text, applies in (
                (f"the temperature moved by {moved:.1f} K", moved > _MOVED),
                ("successive windows are correlated", correlated),
            )
            if applies
        )
        needed = n + math.ceil((_DAY - covered) / step)
        found.append(Shortcoming(text=f"it covers {duration_text(covered)} of a daily cycle ({reason})", needed=needed))
    least = 2 * p + 3 + (_REGRESSORS if known else 1)
    if correlated and effective < least:
        text = f"{n} correlated windows count as {effective:.0f} independent ones where {p} modes need {least}"
        found.append(Shortcoming(text=text, needed=math.ceil(n * least / effective)))
    return tuple(found)


def _effective(modes: TrackedModes, temperature: FloatArray | None) -> float:
    """Return the number of independent windows, with a straight line over temperature if that is given."""
    y = modes.log_frequency[-_MAX:]
    y = y - np.nanmean(y, axis=0)
    n = len(y)
    columns = [np.ones(n)]
    if temperature is not None:
        columns.append(temperature[-_MAX:] - temperature[-_MAX:].mean())
    prior = np.array([1.0, _SLOPE_STD])[: len(columns)]
    constants = tuple(c for c in _CONSTANTS if c <= max(n / 2, _CONSTANTS[0]))  # slower ones are a constant to so few
    found = effective_number(y, np.column_stack(columns), prior, np.arange(n, dtype=float), constants)
    return found * len(modes.log_frequency) / n


MAX_RESTARTS = 3  #: restarts of learning; then a baseline that contains a change is accepted, which is reported


def change_in_baseline(windows: Sequence[Window], modes: TrackedModes) -> tuple[int, str] | None:
    """Return the first window after the last change within a live baseline, and a sentence; None without a change.

    Parameters
    ----------
    windows : of the baseline
    modes : (n_windows, n_tracks) of these
    """
    change = find_change(
        modes,
        1e-9 * np.array([window.start - windows[0].start for window in windows]),
        np.array([window.temperature for window in windows]),
        np.array([window.rms for window in windows]),
    )
    if change is None:
        return None
    first = change.first if change.stop == len(windows) else change.stop
    back = ", and back" if change.first and change.stop < len(windows) else ""
    size, std = _largest(change)
    return first, (
        f"the structure changed within the baseline at {utc(windows[change.first or first].start)}{back}: "
        f"frequencies moved by up to {100 * size:+.2g} ± {100 * std:.1g} %; "
        f"learning begins anew with the {len(windows) - first} windows since"
    )


def _largest(change: ChangePoint) -> tuple[float, float]:
    k = int(np.nanargmax(np.abs(change.shift)))
    sign = 1.0 if change.first else -1.0  # a change that the first windows are before
    return sign * float(change.shift[k]), float(change.shift_std[k])


class BaselineLearning:
    """Windows from which a baseline will be learned.

    Parameters
    ----------
    structure, settings : of the site; None for one without a structure file
    memory : state of the run before, if its baseline is to be continued
    """

    def __init__(self, structure: Structure | None, settings: Settings, memory: Memory | None = None) -> None:
        self._structure, self._settings = structure, settings
        self._first = settings.analysis.first_windows
        self.windows: list[Window] = []
        self.target = self._first  #: number of windows to learn from
        self.restarts = 0  #: because the structure changed within the baseline
        if memory is not None and memory.detector is None:
            self.windows, self.restarts = list(memory.baseline), memory.restarts
            self.target = max(self.target, min(memory.target, settings.analysis.most_windows))

    @property
    def progress(self) -> LearningProgress:
        """Progress with the next window."""
        return LearningProgress(windows=len(self.windows) + 1, target=self.target)

    def add(self, window: Window) -> tuple[LearnedBaseline | None, str]:
        """Take a window; return the baseline once it is learned, and a message, empty if there is none."""
        self.windows.append(window)
        if len(self.windows) < self.target:
            return None, ""
        try:
            learned = learn_baseline(self._structure, self.windows, self._settings)
        except (UpdaterError, np.linalg.LinAlgError) as error:
            self.windows.pop(0)  # learning continues: the oldest window makes room
            return None, str(error)
        change = change_in_baseline(learned.baseline, learned.modes.windows)
        if change and self.restarts < MAX_RESTARTS:
            self.restarts += 1
            self.windows, self.target = self.windows[change[0] :], self._first
            return None, change[1]
        n = len(learned.baseline)
        lacking = baseline_shortcomings(learned.baseline, learned.modes.windows, self._settings.step_seconds)
        longer = longer_baseline(n, lacking, self._settings.analysis.most_windows)
        if longer > n and not change:
            is_first, self.target = self.target == self._first, longer
            return None, extended_text(n, lacking, longer, self._settings) if is_first else ""
        self.windows, self.restarts = [], 0
        text = f"baseline learned from {n} windows"
        text += f", though {change[1].partition(';')[0]}" if change else ""
        text += f"; {too_short_text(lacking)}" if lacking else ""
        return learned, text if learned.detector.has_thermometer else f"{text}; {NO_THERMOMETER}"

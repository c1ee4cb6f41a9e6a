"""Course of a change within a record: sudden, gradual, or neither.

Undisturbed windows scatter about a constant with the deviations of `WindowSeries`. A straight line in time that
describes them far better reveals a drift; `find_change` reveals a step. The difference between the last and the first
windows is the direction of the change in log frequencies, and the projection of each window on it is the share of the
change that the window shows. Isotonic regression of the shares tests whether the change goes one way.

References
----------
Barlow, R. E., Bartholomew, D. J., Bremner, J. M., Brunk, H. D. (1972). Statistical inference under order restrictions.
Wiley, chapter 3.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import isotonic_regression
from scipy.special import chdtrc

from daq import FloatArray, IndexArray
from updater.modal_data.states.change_point import FALSE_POSITIVE, find_change
from updater.modal_data.states.series import WindowSeries
from updater.modal_data.tracked import TrackedModes

FEWEST = 12  #: windows in which a course is looked for: four at each end of a drift
_ENDS = 3  # a drift is the difference between the last and the first of so many parts
_SHORTEST = 3  # windows of a state before or after a step
_FEWEST_AFTER = 5  # windows after a gradual change
_NO_SLOPE, _CLEARLY = 2.0, 4.0  # standard deviations
_MISFIT = 1e-3  # probability at which shares that go one way are rejected by chance

CourseKind = Literal["sudden", "gradual", "irregular"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Course:
    """A change of the natural frequencies within a record."""

    kind: CourseKind
    first: IndexArray  #: windows of the state before it, or at its beginning
    last: IndexArray  #: windows of the state after it, or at its end
    share: FloatArray  #: (n_windows,) share of the change from `first` to `last` that each window shows [-]
    share_std: FloatArray  #: (n_windows,) [-]
    p_value: float  #: probability of as clear a drift or step in windows of one state [-]

    @property
    def end(self) -> int | None:
        """Return the first window after a gradual change; None if the change is not known to have ended.

        From this window on, the slope of the share is consistent with zero, and clearly below half the mean rate until
        then. It is one of the last half: a slope is judged by no more windows than the rate. The longest end is chosen.
        """
        n, std = len(self.share), float(self.share_std[0])
        for first in range(n // 2, n - _FEWEST_AFTER + 1):
            after = self.share[first:]
            time = np.arange(n - first) - (n - first - 1) / 2
            square = float(time @ time)
            slope, slope_std = float(time @ after) / square, std * square**-0.5
            rate = float(after.mean() - self.share[:_SHORTEST].mean()) / first
            if abs(slope) < _NO_SLOPE * slope_std and slope + _CLEARLY * slope_std < rate / 2:
                return first
        return None


def find_course(modes: TrackedModes, seconds: FloatArray, temperature: FloatArray, rms: FloatArray) -> Course | None:
    """Return the course of a change that at least two modes show, None where the windows are of one state.

    Parameters
    ----------
    modes : (n_windows, n_tracks)
    seconds : (n_windows,) start of each window, ascending [s]
    temperature : (n_windows,) [degC]
    rms : (n_windows,) of the acceleration [m/s2]; ignored, as temperature, where it is not known in every window
    """
    n = len(seconds)
    known = np.flatnonzero(np.isfinite(modes.log_frequency).sum(0) > n / 2)
    if n < FEWEST or len(known) < 2:
        return None
    series = WindowSeries.of(modes.tracks(known), seconds, temperature, rms, list(np.arange(n)[:, None]))
    step = find_change(modes, seconds, temperature, rms)
    p_value = min(_drift(series), step.p_value if step else 1.0)
    if p_value > FALSE_POSITIVE:
        return None
    ends = np.array_split(np.arange(n), _ENDS)
    first, last = ends[0], ends[-1]
    share, std = _shares(series.y, first, last)
    kind: CourseKind = "irregular"
    if (split := _sudden(share, std)) is not None:
        kind, first, last = "sudden", np.arange(split[0]), np.arange(split[1], n)
        share, std = _shares(series.y, first, last)
    elif _goes_one_way(share, std):
        kind = "gradual"
    return Course(kind=kind, first=first, last=last, share=share, share_std=np.full(n, std), p_value=float(p_value))


def _drift(series: WindowSeries) -> float:
    """Return the probability of as clear a line in time in windows of one state, in two modes or more."""
    slope = series.seconds - series.seconds.mean()
    p_value = _line(series, slope)
    if p_value > FALSE_POSITIVE:
        return p_value
    clearest = int(np.argmax(np.abs(slope @ series.y)))
    return max(p_value, _line(series.without(clearest), slope))


def _line(series: WindowSeries, slope: FloatArray) -> float:
    """Return the probability of as clear a line, along the modes or the principal directions of the residuals."""
    size = slope @ series.y / (slope @ slope)
    rest = series.y - series.y.mean(0) - np.outer(slope, size)
    axes = (np.eye(series.y.shape[1]), np.linalg.svd(rest)[2].T)
    return max(series.chance(sum(_ratio(series, slope, axis) for axis in every.T)) for every in axes)


def _ratio(series: WindowSeries, slope: FloatArray, axis: FloatArray) -> float:
    """Return twice the log likelihood ratio of a line along a unit vector (p,)."""
    n = len(slope)
    factor = cho_factor(series.error * np.eye(n) + series.environment(axis))
    columns = np.column_stack([np.ones(n), slope, series.y @ axis])
    gram = columns.T @ cho_solve(factor, columns)
    rest = gram[1:, 1:] - np.outer(gram[1:, 0], gram[0, 1:]) / gram[0, 0]  # without the mean
    return float(rest[0, 1] ** 2 / rest[0, 0])


def _shares(y: FloatArray, first: IndexArray, last: IndexArray) -> tuple[FloatArray, float]:
    """Return the share of the change that each window (n,) shows, and its standard deviation."""
    before = y[first].mean(0)
    change = y[last].mean(0) - before
    square = float(change @ change)
    return np.asarray((y - before) @ change / square), square**-0.5


def _sudden(share: FloatArray, std: float) -> tuple[int, int] | None:
    """Return the number of windows before a step and the first one after it; None unless a step alone fits.

    One window between them may show both states.
    """
    n = len(share)
    fits = []
    for before in range(_SHORTEST, n - _SHORTEST + 1):
        for after in range(before, min(before + 1, n - _SHORTEST) + 1):
            rest = sum(np.sum((part - part.mean()) ** 2) for part in (share[:before], share[after:]))
            fits.append((float(rest) / std**2 + np.log(n) * (after - before), before, after))
    square, before, after = min(fits)
    if chdtrc(n - 3, square) < _MISFIT or _slopes(share[:before], share[after:], std):
        return None
    return before, after


def _slopes(before: FloatArray, after: FloatArray, std: float) -> bool:
    """Return whether the windows on both sides of a step drift on: then it is none."""
    square = 0.0
    for part in (before, after):
        time = np.arange(len(part)) - (len(part) - 1) / 2
        square += float(time @ part) ** 2 / (float(time @ time) * std**2)
    return bool(chdtrc(2, square) < _MISFIT)


def _goes_one_way(share: FloatArray, std: float) -> bool:
    fit = isotonic_regression(share, increasing=True).x
    return bool(chdtrc(len(share), float(np.sum((share - fit) ** 2)) / std**2) > _MISFIT)

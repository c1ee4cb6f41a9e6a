"""Change-point test for the windows of one baseline: a lasting step, or one that reverses.

Log frequencies of undisturbed windows are a constant, the effect of temperature, a slow movement and an independent
error. The slow movement is an Ornstein-Uhlenbeck process whose variance and time constant are fitted. Temperature acts
by a slope of limited size where it is measured, and is a smooth process of limited size elsewhere; amplitude acts by a
slope of limited size. A change adds a step to these. The likelihood ratio of both is maximised over intervals of
windows (circular binary segmentation).

References
----------
Olshen, A. B., Venkatraman, E. S., Lucito, R., Wigler, M. (2004). Circular binary segmentation for the analysis of
array-based DNA copy number data. Biostatistics 5, 557-572.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray
from updater.modal_data.states.series import WindowSeries
from updater.modal_data.tracked import TrackedModes

SHORTEST = 3  #: windows of the shortest change that is looked for
FALSE_POSITIVE = 1e-3  #: probability at which windows of one state are found to contain a change

_MAX_GROUPS = 96  # windows that the test distinguishes; more are averaged in groups
_MOVEMENTS = ((0.0, 1.0), *((v, t) for v in (1.0, 10.0, 100.0, 1000.0) for t in (1.0, 5.0, 25.0, 125.0)))
# variance of the slow movement over that of a window's error, time constant [windows]


@dataclass(frozen=True, eq=False, kw_only=True)
class ChangePoint:
    """Step in the log frequencies of consecutive windows."""

    first: int  #: first window after the step
    stop: int  #: window after the last one before the step back; the number of windows where there is none
    shift: FloatArray  #: (n_tracks,) log frequency within less that outside; NaN where a mode is seldom seen [-]
    shift_std: FloatArray  #: (n_tracks,) [-]
    p_value: float  #: probability of as clear a step in windows of one state, all intervals considered [-]


def find_change(
    modes: TrackedModes, seconds: FloatArray, temperature: FloatArray, rms: FloatArray
) -> ChangePoint | None:
    """Return the clearest step that at least two modes show, None where the windows are of one state.

    A step of a single mode is taken for an error of identification, such as a few windows of a neighbouring pole.

    Parameters
    ----------
    modes : (n_windows, n_tracks)
    seconds : (n_windows,) start of each window, ascending [s]
    temperature : (n_windows,) [degC]
    rms : (n_windows,) of the acceleration [m/s2]; ignored, as temperature, where it is not known in every window
    """
    n_windows, n_tracks = modes.log_frequency.shape
    known = np.flatnonzero(np.isfinite(modes.log_frequency).sum(0) > n_windows / 2)
    groups = np.array_split(np.arange(n_windows), min(n_windows, _MAX_GROUPS))
    if len(groups) < 2 * SHORTEST or len(known) < 2:
        return None
    test = _StepTest.of(modes.tracks(known), seconds, temperature, rms, groups)
    step = test.clearest()
    if step.p_value > FALSE_POSITIVE:
        return None
    shift, std = test.shift(step)
    if test.without(int(np.argmax(np.abs(shift / std)))).p_value(step) > FALSE_POSITIVE:
        return None
    every = np.full((2, n_tracks), np.nan)
    every[:, known] = shift, std
    return ChangePoint(
        first=int(groups[step.first][0]),
        stop=int(groups[step.stop - 1][-1]) + 1,
        shift=every[0],
        shift_std=every[1],
        p_value=step.p_value,
    )


def windows_of_one_state(
    modes: TrackedModes, seconds: FloatArray, temperature: FloatArray, rms: FloatArray
) -> tuple[IndexArray, tuple[ChangePoint, ...]]:
    """Return the windows (n_kept,) of the state that most of them show, and the changes that the others contain.

    Parameters
    ----------
    modes : (n_windows, n_tracks)
    seconds : (n_windows,) start of each window, ascending [s]
    temperature : (n_windows,) [degC]
    rms : (n_windows,) of the acceleration [m/s2]

    Returns
    -------
    windows : (n_kept,)
        Their numbers, ascending.
    changes : tuple of ChangePoint
        As by `find_change`, with numbers of these windows.
    """
    kept: IndexArray = np.arange(len(seconds))
    changes: list[ChangePoint] = []
    while (change := find_change(modes.windows(kept), seconds[kept], temperature[kept], rms[kept])) is not None:
        inside = np.zeros(len(kept), bool)
        inside[change.first : change.stop] = True
        changes.append(replace(change, first=int(kept[change.first]), stop=int(kept[change.stop - 1]) + 1))
        kept = kept[inside] if inside.sum() > len(kept) / 2 else kept[~inside]
    return kept, tuple(changes)


@dataclass(frozen=True, kw_only=True)
class _Step:
    first: int  # group of windows
    stop: int
    p_value: float


@dataclass(frozen=True, eq=False, kw_only=True)
class _StepTest(WindowSeries):
    """Test for a step in the series of windows."""

    def inside(self, step: _Step) -> npt.NDArray[np.bool_]:
        n = np.arange(len(self.y))
        return np.asarray((n >= step.first) & (n < step.stop))

    def shift(self, step: _Step) -> tuple[FloatArray, FloatArray]:
        """Return the step of each mode (p,) and its standard deviation, errors of identification alone."""
        inside = self.inside(step)
        shift = self.y[inside].mean(0) - self.y[~inside].mean(0)
        std = np.sqrt(self.error * (1 / inside.sum() + 1 / (~inside).sum()))
        return shift * self.noise, std * self.noise

    def clearest(self) -> _Step:
        """Return the interval of the largest likelihood ratio.

        Modes may move together. The ratios of independent directions are therefore added: those of the modes first,
        then the principal ones of the residuals without the step.
        """
        possible = _intervals(len(self.y))
        step, axes = _Step(first=0, stop=0, p_value=1.0), np.eye(self.y.shape[1])
        for _ in range(2):
            ratio = self._ratio(axes)
            first, last = np.unravel_index(int(np.argmax(np.where(possible, ratio, -1.0))), ratio.shape)
            chance = possible.sum() * self.chance(float(ratio[first, last]))
            step = _Step(first=int(first), stop=int(last) + 1, p_value=min(1.0, float(chance)))
            axes = self._principal(step)
        return step

    def p_value(self, step: _Step) -> float:
        """Return the probability of as clear a step in the same interval."""
        return self.chance(float(self._ratio(self._principal(step))[step.first, step.stop - 1]))

    def _principal(self, step: _Step) -> FloatArray:
        """Return the principal directions (p, p) of the residuals without a step, as columns."""
        inside = self.inside(step)
        rest = self.y - np.where(inside[:, None], self.y[inside].mean(0), self.y[~inside].mean(0))
        return np.asarray(np.linalg.svd(rest)[2].T)

    def _ratio(self, axes: FloatArray) -> FloatArray:
        return np.asarray(np.sum([self._ratio_along(axis) for axis in axes.T], axis=0))

    def _ratio_along(self, axis: FloatArray) -> FloatArray:
        """Return twice the log likelihood ratio (n, n) of a step from each window to each, along a unit vector (p,)."""
        n, prior = len(self.y), self.environment(axis)
        apart = np.abs(np.subtract.outer(self.seconds, self.seconds)) / np.median(np.diff(self.seconds))
        start = np.append(np.tril(np.ones((n, n))), np.zeros((n, 1)), axis=1)  # columns: a step from each window on
        columns = np.column_stack([np.ones(n), self.y @ axis, start])
        possible = _intervals(n)
        without, with_step = -np.inf, np.full((n, n), -np.inf)
        for variance, constant in _MOVEMENTS:
            covariance = self.error * np.eye(n) + variance * np.exp(-apart / constant) + prior
            root = scipy.linalg.cholesky(covariance, lower=True)
            white = scipy.linalg.solve_triangular(root, columns, lower=True)
            one = white[:, 0] / np.linalg.norm(white[:, 0])
            rest = white[:, 1:] - np.outer(one, one @ white[:, 1:])
            likelihood = -np.log(np.diag(root)).sum() - np.log(np.linalg.norm(white[:, 0]))
            likelihood -= 0.5 * rest[:, 0] @ rest[:, 0]
            moment, gram = rest[:, 0] @ rest[:, 1:], rest[:, 1:].T @ rest[:, 1:]
            size = np.diag(gram)[:n, None] + np.diag(gram)[1:] - 2 * gram[:n, 1:]
            gain = (moment[:n, None] - moment[1:]) ** 2 / np.where(possible, size, 1.0)
            without = max(without, likelihood)
            with_step = np.maximum(with_step, likelihood + 0.5 * np.where(possible, gain, 0.0))
        return np.where(possible, 2 * (with_step - without), 0.0)


def _intervals(n: int) -> npt.NDArray[np.bool_]:
    """Return which intervals (n, n), by first and last window, are neither too short nor leave too little."""
    length = np.arange(n) - np.arange(n)[:, None] + 1
    return np.asarray((length >= SHORTEST) & (length <= n - SHORTEST))

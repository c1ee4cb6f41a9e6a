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
from scipy.linalg import cholesky, solve_triangular
from scipy.special import fdtrc

from daq import FloatArray, IndexArray
from updater.modal_data.tracked import COMMON_STD, TrackedModes

SHORTEST = 3  #: windows of the shortest change that is looked for
FALSE_POSITIVE = 1e-3  #: probability at which windows of one state are found to contain a change

_MAX_GROUPS = 96  # windows that the test distinguishes; more are averaged in groups
_WILD = 4.5  # standard deviations from the running median beyond which a single value is an error of identification
_STATED_WORTH = 8.0  # degrees of freedom that the stated deviations are worth
_EFFICIENCY = 0.37  # degrees of freedom per difference, of a deviation taken from the median of differences
_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable
_SLOPE_STD, _OWN_SLOPE_STD = 1e-3, 3e-4  # 1/K of ln f, common to all modes and of each: bridges on bearings have 2e-3
_UNMEASURED_STD = 3e-4  # of ln f: sun, moisture and load where temperature is measured
_SOFTENING_STD = 0.03  # of ln f over the rms to its mean: buildings in earthquakes
_SMOOTH_SECONDS = 6 * 3600.0  # time constant of a temperature that is not measured
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
    test = _test_of(modes.tracks(known), seconds, temperature, rms, groups)
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

    Parameters are those of `find_change`; the changes count in its windows.
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
class _Test:
    """Windows, or means of as many successive ones each, in units of a window's error."""

    y: FloatArray  # (n, p) about their mean
    noise: FloatArray  # (p,) standard deviation of a window's log frequency
    error: float  # variance of the error, below one where windows are averaged
    seconds: FloatArray  # (n,)
    temperature: FloatArray  # (n,) [degC], NaN where not known
    rms: FloatArray  # (n,) [m/s2], likewise
    freedom: float  # degrees of freedom of `noise`, pooled

    def without(self, mode: int) -> "_Test":
        """Return the test of the other modes."""
        return replace(
            self,
            y=np.delete(self.y, mode, axis=1),
            noise=np.delete(self.noise, mode),
            freedom=self.freedom * (1 - 1 / len(self.noise)),
        )

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
            chance = possible.sum() * self._chance(float(ratio[first, last]))
            step = _Step(first=int(first), stop=int(last) + 1, p_value=min(1.0, float(chance)))
            axes = self._principal(step)
        return step

    def p_value(self, step: _Step) -> float:
        """Return the probability of as clear a step in the same interval."""
        return self._chance(float(self._ratio(self._principal(step))[step.first, step.stop - 1]))

    def _principal(self, step: _Step) -> FloatArray:
        """Return the principal directions (p, p) of the residuals without a step, as columns."""
        inside = self.inside(step)
        rest = self.y - np.where(inside[:, None], self.y[inside].mean(0), self.y[~inside].mean(0))
        return np.asarray(np.linalg.svd(rest)[2].T)

    def _chance(self, ratio: float) -> float:
        p = self.y.shape[1]
        return float(fdtrc(p, self.freedom, ratio / p))

    def _ratio(self, axes: FloatArray) -> FloatArray:
        return np.asarray(np.sum([self._ratio_along(axis) for axis in axes.T], axis=0))

    def _ratio_along(self, axis: FloatArray) -> FloatArray:
        """Return twice the log likelihood ratio (n, n) of a step from each window to each, along a unit vector (p,)."""
        n, prior = len(self.y), self._environment(axis)
        apart = np.abs(np.subtract.outer(self.seconds, self.seconds)) / np.median(np.diff(self.seconds))
        start = np.append(np.tril(np.ones((n, n))), np.zeros((n, 1)), axis=1)  # columns: a step from each window on
        columns = np.column_stack([np.ones(n), self.y @ axis, start])
        possible = _intervals(n)
        without, with_step = -np.inf, np.full((n, n), -np.inf)
        for variance, constant in _MOVEMENTS:
            covariance = self.error * np.eye(n) + variance * np.exp(-apart / constant) + prior
            root = cholesky(covariance, lower=True)
            white = solve_triangular(root, columns, lower=True)
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

    def _environment(self, axis: FloatArray) -> FloatArray:
        """Return the prior covariance (n, n) of temperature and weather along a unit vector (p,)."""
        relative = axis / self.noise
        common, own = relative.sum() ** 2, (relative**2).sum()
        lag = np.sqrt(3) * np.abs(np.subtract.outer(self.seconds, self.seconds)) / _SMOOTH_SECONDS
        smooth = (1 + lag) * np.exp(-lag)  # once differentiable
        if np.isfinite(self.temperature).all():
            warmer = self.temperature - self.temperature.mean()
            slope = _SLOPE_STD**2 * common + _OWN_SLOPE_STD**2 * own
            weather = slope * np.outer(warmer, warmer) + _UNMEASURED_STD**2 * (common + own) * smooth
        else:
            weather = COMMON_STD**2 * (common + own / 9) * smooth
        if np.isfinite(self.rms).all() and self.rms.all():
            louder = self.rms / self.rms.mean() - 1
            weather += _SOFTENING_STD**2 * own * np.outer(louder, louder)
        return np.asarray(weather)


def _intervals(n: int) -> npt.NDArray[np.bool_]:
    """Return which intervals (n, n), by first and last window, are neither too short nor leave too little."""
    length = np.arange(n) - np.arange(n)[:, None] + 1
    return np.asarray((length >= SHORTEST) & (length <= n - SHORTEST))


def _test_of(
    modes: TrackedModes, seconds: FloatArray, temperature: FloatArray, rms: FloatArray, groups: list[IndexArray]
) -> _Test:
    cleaned, noise, freedom = _cleaned(modes.log_frequency, np.sqrt(np.nanmedian(modes.log_frequency_std**2, axis=0)))
    mean = [np.array([values[group].mean(0) for group in groups]) for values in (cleaned, seconds, temperature, rms)]
    return _Test(
        y=(mean[0] - mean[0].mean(0)) / noise,
        noise=noise,
        error=len(groups) / len(seconds),
        seconds=mean[1],
        temperature=mean[2],
        rms=mean[3],
        freedom=freedom,
    )


def _cleaned(value: FloatArray, stated: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return values (n, p) without gaps and single errors, the deviation of each mode (p,), its degrees of freedom.

    Deviations are estimated from successive differences, which hardly contain a step, and shrunk towards the stated
    ones.
    """
    n, p = value.shape
    window = np.arange(n)
    seen = np.isfinite(value)
    filled = np.column_stack([np.interp(window, window[s], v[s]) for v, s in zip(value.T, seen.T, strict=True)])
    differences = np.median(np.abs(np.diff(filled, axis=0)), axis=0) / (_NORMAL_MEDIAN * 2**0.5)
    worth = _EFFICIENCY * (n - 1)
    usual = np.median(differences / stated) * stated
    noise = np.sqrt((_STATED_WORTH * usual**2 + worth * differences**2) / (_STATED_WORTH + worth))
    padded = np.pad(filled, ((2, 2), (0, 0)), mode="edge")
    median = np.median([padded[k : k + n] for k in range(5)], axis=0)
    wild = np.abs(filled - median) > _WILD * noise
    return np.where(wild, median, filled), noise, _STATED_WORTH + worth * p

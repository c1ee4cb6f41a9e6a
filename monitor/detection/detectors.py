"""Three detectors over one law: jumps of single windows, and two averages for small lasting changes.

References
----------
Lowry, C. A., Woodall, W. H., Champ, C. W., Rigdon, S. E. (1992). A multivariate exponentially weighted moving average
control chart. Technometrics 34, 46-53.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from daq import FloatArray
from monitor.detection.alarm import DetectorName
from monitor.detection.constant import wandered
from monitor.detection.run_length import DetectionSettings, averaged, drift_limit, jump_limit
from monitor.detection.scores import alone, clipped, distance, tamed
from monitor.detection.single_mode import SingleModeRuns, most_inconsistent, no_runs, wait
from monitor.detection.temperature_law import Law, first_law, learn
from monitor.detection.temperature_terms import Climate, first_climate, follow, terms
from monitor.detection.trend import WeeklyMeans, add_windows, no_weeks
from monitor.detection.window_variance import Scatter, ScatterState, first_scatter, follow_scatter, regressors

WEIGHTS = (0.2, 0.02)  #: weight of the newest window, in the quick and the slow average
DETECTORS: tuple[DetectorName, ...] = ("jump", "quick drift", "slow drift")
GUARD = 72  #: windows that must stay calm before older ones are learned from

_FREEDOMS = 1.25  # ratio of the degrees of freedom that limits are computed for


@dataclass(frozen=True, eq=False, kw_only=True)
class LawState:
    """A law and the state of monitoring with it; leading dimensions are sites."""

    law: Law
    watching: DetectionSettings
    climate: Climate  #: temperatures so far
    average: FloatArray  #: (2, ..., n_tracks) of the whitened deviations
    #: (2, ..., n_tracks, n_tracks) covariance of lasting movements, as averaged in `average`
    average_lasting: FloatArray
    scatter: ScatterState  #: variance common to all modes
    average_variance: FloatArray  #: (2, ...) the same as averaged in `average`
    runs: SingleModeRuns  #: runs of windows in which one mode alone is inconsistent
    weekly: WeeklyMeans  #: weekly means of the windows learned from since the baseline
    age: float = 0.0  #: time since the baseline [s]


@dataclass(frozen=True, eq=False, kw_only=True)
class ScoredWindows:
    """Windows, judged; all distances are over their number of modes."""

    value: FloatArray  #: (3, ..., n_windows), by `DETECTORS`
    limit: FloatArray  #: (3, ..., n_windows)
    terms: FloatArray  #: (..., n_windows, 5, q)
    whitened: FloatArray  #: (..., n_windows, n_tracks)
    #: (..., n_windows) variance of the new errors of a window, relative to the stated one of the law
    variance: FloatArray
    age: FloatArray  #: (n_windows,) since the baseline [s]
    carried: npt.NDArray[np.bool_]  #: (..., n_windows) whether temperatures are uncertain for lack of readings
    waiting: npt.NDArray[
        np.intp
    ]  #: (..., n_windows) mode that alone would be over a limit, not for long enough; else -1

    @property
    def over(self) -> npt.NDArray[np.bool_]:
        """Return for each window (..., n_windows) whether any detector is above its limit."""
        return np.asarray((self.value > self.limit).any(0))

    @property
    def teaching(self) -> FloatArray:
        """Return the data for learning (..., n_windows, n_tracks): no window with an uncertain temperature."""
        return np.where(self.carried[..., None], np.nan, self.whitened)


def start(
    log_frequency: FloatArray,
    std: FloatArray,
    temperature: FloatArray,
    seconds: FloatArray,
    watching: DetectionSettings,
    rms: FloatArray | None = None,
) -> LawState:
    """Learn from baseline windows.

    Parameters
    ----------
    log_frequency, std : (..., n_windows, n_tracks), NaN where a window lacks a mode
    temperature : (..., n_windows) [degC], NaN where no device has a sensor
    seconds : (n_windows,) since the window before [s]
    watching : how the next windows will be judged
    rms : (..., n_windows) of the acceleration [m/s2], NaN where unknown
    """
    temperatures, climate = follow(first_climate(temperature), temperature, seconds)
    known, lag = terms(temperatures), _lag(watching)
    taught = np.where(temperatures.carried[..., None], np.nan, log_frequency)
    measured = np.isfinite(temperature).mean(-1) > 0.5
    step = float(np.median(seconds))
    even = first_law(taught, std, known, measured=measured, lag=lag, step=step)
    x = regressors(std, even.scale, _or_unknown(rms, temperature))
    before = first_scatter(x, log_frequency.shape[-1], even.fast, lag)
    scatter, state = follow_scatter(before, even.residual(known, even.whiten(taught)), x, seconds)
    law = first_law(taught, std, known, measured=measured, lag=lag, step=step, variance=scatter.variance)
    average = np.zeros((len(WEIGHTS), *law.centre.shape))
    lasting = np.repeat(law.lasting(known, np.zeros(1))[None, ..., -1, :, :], len(WEIGHTS), axis=0)
    level = np.repeat(scatter.variance[None, ..., -1], len(WEIGHTS), axis=0)
    return LawState(
        law=law,
        watching=watching,
        climate=climate,
        average=average,
        average_lasting=lasting,
        scatter=state,
        average_variance=level,
        runs=no_runs(law.freedom.shape),
        weekly=no_weeks(law.freedom.shape, law.scale.shape[-1]),
    )


def judge(
    watched: LawState,
    log_frequency: FloatArray,
    temperature: FloatArray,
    seconds: FloatArray,
    std: FloatArray | None = None,
    rms: FloatArray | None = None,
) -> tuple[ScoredWindows, LawState]:
    """Judge windows by the law; windows above the jump's limit, or with an uncertain temperature, enter no average.

    Parameters are those of `start`; without `std`, windows have the stated deviations of the law's baseline. The law is
    not changed: `accept` does that.
    """
    law, p = watched.law, log_frequency.shape[-1]
    temperatures, climate = follow(watched.climate, temperature, seconds)
    known = terms(temperatures)
    whitened = law.whiten(log_frequency)
    residual = law.residual(known, whitened)
    x = regressors(_or_unknown(std, log_frequency), law.scale, _or_unknown(rms, temperature))
    scatter, state = follow_scatter(watched.scatter, residual, x, seconds)
    age = watched.age + np.cumsum(seconds)
    lasting = law.lasting(known, age)
    fast = law.fast[..., None] * scatter.variance
    covariance = lasting + _even(fast, p)
    deviation = tamed(residual, covariance, law.tail[..., None, None])
    squared, n = distance(deviation, covariance)
    jump, drift = _limits(law, scatter, watched.watching)
    at = (law.lasting_directions(known, age, scatter.variance) * p + np.maximum(n - 1, 0))[..., None]
    values = [squared / np.maximum(n, 1)]
    limits = [np.take_along_axis(jump, at, axis=-1)[..., 0]]
    score = alone(deviation, covariance)
    single = [most_inconsistent(squared, score, n)]
    taken = _entering(deviation, covariance, values[0] > limits[0], *single[0])
    taken = np.where(temperatures.carried[..., None], np.nan, taken)
    averages, levels, lastings = [], [], []
    for i, weight in enumerate(WEIGHTS):
        path = _averaged(watched.average[i], taken, weight)
        level = _averaged_variance(watched.average_variance[i], scatter.variance, taken, weight)
        fast = law.fast[..., None] * averaged(weight, watched.watching.overlap)[0] * level
        lasted = _averaged_lasting(watched.average_lasting[i], lasting, taken, weight)
        covariance = lasted + _even(fast, p)
        squared = distance(path, covariance)[0]
        values.append(squared / p)
        limits.append(drift[..., i])
        single.append(most_inconsistent(squared, alone(path, covariance), np.full(squared.shape, p)))
        averages.append(path[..., -1, :])
        levels.append(level[..., -1])
        lastings.append(lasted[..., -1, :, :])
    value, limit = np.array(values), np.array(limits)
    mode = _single(value > limit, np.array([s[0] for s in single]), np.array([s[1] for s in single]))
    waits, runs = wait(watched.runs, mode, score, watched.watching.rate)
    judged = ScoredWindows(
        value=np.where(waits, np.minimum(value, limit), value),
        limit=limit,
        terms=known,
        whitened=whitened,
        variance=scatter.variance,
        age=age,
        carried=temperatures.carried,
        waiting=np.where(waits, mode, -1),
    )
    after = replace(
        watched,
        climate=climate,
        average=np.array(averages),
        age=float(age[-1]),
        scatter=state,
        average_variance=np.array(levels),
        average_lasting=np.array(lastings),
        runs=runs,
    )
    return judged, after


def _or_unknown(values: FloatArray | None, like: FloatArray) -> FloatArray:
    return np.full(like.shape, np.nan) if values is None else values


def _even(variance: FloatArray, p: int) -> FloatArray:
    """Return covariances (..., p, p) of that variance (...,) in every direction."""
    return variance[..., None, None] * np.eye(p)


def _entering(
    deviation: FloatArray,
    covariance: FloatArray,
    over: npt.NDArray[np.bool_],
    single: npt.NDArray[np.bool_],
    mode: npt.NDArray[np.intp],
) -> FloatArray:
    """Return the data for the averages: no window that is a jump, or all but its mode if that alone is inconsistent.

    Below the limit, too, the deviation of one mode given the others is clipped: a wrong pole is not a drift.
    """
    most = np.arange(deviation.shape[-1]) == mode[..., None]
    left_out = over[..., None] & (most | ~single[..., None])
    return np.where(left_out, np.nan, clipped(deviation, covariance, most))


def _single(
    over: npt.NDArray[np.bool_], single: npt.NDArray[np.bool_], mode: npt.NDArray[np.intp]
) -> npt.NDArray[np.intp]:
    """Return the mode that alone brings each window over limits, -1 where none or more than one does.

    Parameters are (3, ..., n_windows), by detector: over its limit, one mode alone inconsistent, the most inconsistent.
    """
    highest, lowest = np.where(over, mode, -1).max(0), np.where(over, mode, np.iinfo(np.intp).max).min(0)
    return np.where(over.any(0) & (single | ~over).all(0) & (highest == lowest), highest, -1)


def accept(
    watched: LawState,
    known: FloatArray,
    whitened: FloatArray,
    variance: FloatArray | None = None,
    age: FloatArray | None = None,
) -> LawState:
    """Learn from windows that have been judged and stayed calm; NaN for those that have not.

    Parameters
    ----------
    known, whitened, variance, age : `terms`, `teaching`, `variance` and `age` of `ScoredWindows`; without age, windows
        enter no weekly mean
    """
    weekly = watched.weekly
    if age is not None:
        residual = watched.law.residual(known, whitened)
        deviation = whitened * watched.law.scale[..., None, :]
        weekly = add_windows(weekly, age, known[..., 0, :], deviation, residual)
    law = wandered(watched.law, known.shape[-3] * watched.law.step)
    law = learn(law, known, whitened, lag=_lag(watched.watching), age=watched.age, variance=variance)
    return replace(watched, law=law, weekly=weekly)


def _averaged(average: FloatArray, deviation: FloatArray, weight: float) -> FloatArray:
    """Return the average (..., n_windows, n_tracks) after each window; a mode that is missing keeps its own."""
    out = np.empty_like(deviation)
    for window in range(deviation.shape[-2]):
        newest = deviation[..., window, :]
        average = np.where(np.isfinite(newest), (1 - weight) * average + weight * newest, average)
        out[..., window, :] = average
    return out


def _averaged_variance(level: FloatArray, variance: FloatArray, taken: FloatArray, weight: float) -> FloatArray:
    """Return the mean variance (..., n_windows) of an average's windows, each by its share in that of the average."""
    out, kept = np.empty_like(variance), (1 - weight) ** 2
    for window in range(variance.shape[-1]):
        entered = np.isfinite(taken[..., window, :]).any(-1)
        level = np.where(entered, kept * level + (1 - kept) * variance[..., window], level)
        out[..., window] = level
    return out


def _averaged_lasting(average: FloatArray, lasting: FloatArray, taken: FloatArray, weight: float) -> FloatArray:
    """Return an upper bound (..., n_windows, n_tracks, n_tracks) of an average's covariance by lasting movements.

    The square of a weighted mean is at most the weighted mean of squares, however correlated the windows are.
    """
    out = np.empty_like(lasting)
    for window in range(lasting.shape[-3]):
        entered = np.asarray(np.isfinite(taken[..., window, :]).any(-1))
        average = np.where(
            entered[..., None, None], (1 - weight) * average + weight * lasting[..., window, :, :], average
        )
        out[..., window, :, :] = average
    return out


def _lag(watching: DetectionSettings) -> int:
    """Return the windows from one to the next that shares no sample with it."""
    return int(np.ceil(1 / (1 - watching.overlap) - 1e-9))


def _limits(law: Law, scatter: Scatter, watching: DetectionSettings) -> tuple[FloatArray, FloatArray]:
    """Return limits of jumps (..., n_windows, (p + 1) p), by lasting directions and modes seen, and of drifts (..., 2).

    The uncertainty of a window's own variance counts in an average by the weight of one window.
    """
    known, unsure = 1 / law.freedom[..., None], scatter.log_variance / 2
    shares = np.array([1.0, *(weight * (2 - weight) for weight in WEIGHTS)])
    tables = [_table(law.scale.shape[-1], 1 / (known + share * unsure), watching) for share in shares]
    first = -len(WEIGHTS)
    return tables[0][..., :first], np.stack([table[..., first + i] for i, table in enumerate(tables[1:])], axis=-1)


def _table(p: int, freedom: FloatArray, watching: DetectionSettings) -> FloatArray:
    """Return limits (..., n_limits) for degrees of freedom (...,), rounded down in steps."""
    steps, back = np.unique(np.floor(np.log(freedom) / np.log(_FREEDOMS)), return_inverse=True)
    rows = np.array([_limits_of(p, float(_FREEDOMS**step), watching) for step in steps])
    return rows[back.reshape(freedom.shape)]


@lru_cache(maxsize=256)
def _limits_of(p: int, freedom: float, watching: DetectionSettings) -> tuple[float, ...]:
    jumps = (jump_limit(n, lasting, freedom, watching) for lasting in range(p + 1) for n in range(1, p + 1))
    return (*jumps, *(drift_limit(p, freedom, weight, watching) for weight in WEIGHTS))

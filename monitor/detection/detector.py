"""Three detectors over one law: a jump in single windows, and two averages for what is small and stays.

References
----------
Lowry, C. A., Woodall, W. H., Champ, C. W., Rigdon, S. E. (1992). A multivariate exponentially weighted moving average
control chart. Technometrics 34, 46-53.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from daq import FloatArray
from monitor.detection.environment import Climate, first_climate, follow, terms
from monitor.detection.law import Law, first_law, learn
from monitor.detection.run_length import Watching, averaged, drift_limit, jump_limit
from monitor.detection.scores import alone, clipped, distance, tamed
from monitor.detection.single_mode import SingleModeRuns, most_inconsistent, no_runs, wait

WEIGHTS = (0.2, 0.02)  #: of the newest window, in the quick and the slow average
DetectorName = Literal["jump", "quick drift", "slow drift"]
DETECTORS: tuple[DetectorName, ...] = ("jump", "quick drift", "slow drift")
GUARD = 72  #: windows that must stay calm before older ones are learnt from

_FREEDOMS = 1.25  # ratio of the degrees of freedom that limits are computed for


@dataclass(frozen=True, eq=False, kw_only=True)
class Watched:
    """A law and what watching by it has come to; leading dimensions are sites."""

    law: Law
    watching: Watching
    climate: Climate  #: temperatures so far
    average: FloatArray  #: (2, ..., n_tracks) of the whitened deviations
    runs: SingleModeRuns  #: of windows in which one mode alone is inconsistent
    age: float = 0.0  #: since the baseline [s]


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged:
    """Windows, judged; all distances are over their number of modes."""

    value: FloatArray  #: (3, ..., n_windows), by `DETECTORS`
    limit: FloatArray  #: (3, ..., n_windows)
    terms: FloatArray  #: (..., n_windows, 3, q)
    whitened: FloatArray  #: (..., n_windows, n_tracks)
    carried: npt.NDArray[np.bool_]  #: (..., n_windows) whether temperatures are unsure for want of readings
    waiting: npt.NDArray[
        np.intp
    ]  #: (..., n_windows) mode that alone would be over a limit, not for long enough; else -1

    @property
    def over(self) -> npt.NDArray[np.bool_]:
        """Tell for each window (..., n_windows) whether any detector is over its limit."""
        return np.asarray((self.value > self.limit).any(0))

    @property
    def teaching(self) -> FloatArray:
        """Return what the law may learn from (..., n_windows, n_tracks): no window of unsure temperature."""
        return np.where(self.carried[..., None], np.nan, self.whitened)


def start(
    log_frequency: FloatArray, std: FloatArray, temperature: FloatArray, seconds: FloatArray, watching: Watching
) -> Watched:
    """Learn from baseline windows.

    Parameters
    ----------
    log_frequency, std : (..., n_windows, n_tracks), NaN where a window lacks a mode
    temperature : (..., n_windows) [degC], NaN where no device has a sensor
    seconds : (n_windows,) since the window before [s]
    watching : how the next windows will be judged
    """
    temperatures, climate = follow(first_climate(temperature), temperature, seconds)
    law = first_law(
        np.where(temperatures.carried[..., None], np.nan, log_frequency),
        std,
        terms(temperatures),
        measured=np.isfinite(temperature).mean(-1) > 0.5,
        lag=_lag(watching),
        step=float(np.median(seconds)),
    )
    average = np.zeros((len(WEIGHTS), *law.centre.shape))
    return Watched(law=law, watching=watching, climate=climate, average=average, runs=no_runs(law.freedom.shape))


def judge(
    watched: Watched, log_frequency: FloatArray, temperature: FloatArray, seconds: FloatArray
) -> tuple[Judged, Watched]:
    """Judge windows by the law; a window over the jump's limit, or whose temperature is unsure, enters no average.

    Parameters are those of `start`. The law is not changed: `accept` does that.
    """
    law, p = watched.law, log_frequency.shape[-1]
    temperatures, climate = follow(watched.climate, temperature, seconds)
    known = terms(temperatures)
    whitened = law.whiten(log_frequency)
    age = watched.age + np.cumsum(seconds)
    lasting = law.lasting(known, age)
    new = law.fast[..., None, None, None] * np.eye(p)
    deviation = tamed(law.residual(known, whitened), lasting + new, law.tail[..., None, None])
    squared, n = distance(deviation, lasting + new)
    jump, drift = _limits(law, watched.watching)
    at = (law.lasting_directions(known, age) * p + np.maximum(n - 1, 0))[..., None]
    values = [squared / np.maximum(n, 1)]
    limits = [np.take_along_axis(jump[..., None, :], at, axis=-1)[..., 0]]
    score = alone(deviation, lasting + new)
    single = [most_inconsistent(squared, score, n)]
    taken = _entering(deviation, lasting + new, values[0] > limits[0], *single[0])
    taken = np.where(temperatures.carried[..., None], np.nan, taken)
    averages = []
    for i, weight in enumerate(WEIGHTS):
        path = _averaged(watched.average[i], taken, weight)
        covariance = lasting + averaged(weight, watched.watching.overlap)[0] * new
        squared = distance(path, covariance)[0]
        values.append(squared / p)
        limits.append(np.broadcast_to(drift[..., i : i + 1], squared.shape))
        single.append(most_inconsistent(squared, alone(path, covariance), np.full(squared.shape, p)))
        averages.append(path[..., -1, :])
    value, limit = np.array(values), np.array(limits)
    mode = _single(value > limit, np.array([s[0] for s in single]), np.array([s[1] for s in single]))
    waits, runs = wait(watched.runs, mode, score, watched.watching.rate)
    judged = Judged(
        value=np.where(waits, np.minimum(value, limit), value),
        limit=limit,
        terms=known,
        whitened=whitened,
        carried=temperatures.carried,
        waiting=np.where(waits, mode, -1),
    )
    return judged, replace(watched, climate=climate, average=np.array(averages), age=float(age[-1]), runs=runs)


def _entering(
    deviation: FloatArray,
    covariance: FloatArray,
    over: npt.NDArray[np.bool_],
    single: npt.NDArray[np.bool_],
    mode: npt.NDArray[np.intp],
) -> FloatArray:
    """Return what enters the averages: no window that is a jump, or all but its mode if that alone is inconsistent.

    Below the limit, too, what one mode deviates by given the others is clipped: a wrong pole is no drift.
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


def accept(watched: Watched, known: FloatArray, whitened: FloatArray) -> Watched:
    """Learn from windows that have been judged and stayed calm; NaN for those that have not.

    Parameters
    ----------
    known, whitened : `terms` and `teaching` of `Judged`
    """
    return replace(watched, law=learn(watched.law, known, whitened, lag=_lag(watched.watching), age=watched.age))


def _averaged(average: FloatArray, deviation: FloatArray, weight: float) -> FloatArray:
    """Return the average (..., n_windows, n_tracks) after each window; a mode that is missing keeps its own."""
    out = np.empty_like(deviation)
    for window in range(deviation.shape[-2]):
        newest = deviation[..., window, :]
        average = np.where(np.isfinite(newest), (1 - weight) * average + weight * newest, average)
        out[..., window, :] = average
    return out


def _lag(watching: Watching) -> int:
    """Return the windows from one to the next that shares no sample with it."""
    return int(np.ceil(1 / (1 - watching.overlap) - 1e-9))


def _limits(law: Law, watching: Watching) -> tuple[FloatArray, FloatArray]:
    """Return limits of jumps (..., (p + 1) p), by lasting directions and modes seen, and of drifts (..., 2)."""
    p, lead = law.scale.shape[-1], law.freedom.shape
    rounded = _FREEDOMS ** np.floor(np.log(law.freedom) / np.log(_FREEDOMS))
    table = np.array([_limits_of(p, freedom, watching) for freedom in rounded.ravel().tolist()])
    table = table.reshape(*lead, -1)
    return table[..., : -len(WEIGHTS)], table[..., -len(WEIGHTS) :]


@lru_cache(maxsize=256)
def _limits_of(p: int, freedom: float, watching: Watching) -> tuple[float, ...]:
    jumps = (jump_limit(n, lasting, freedom, watching) for lasting in range(p + 1) for n in range(1, p + 1))
    return (*jumps, *(drift_limit(p, freedom, weight, watching) for weight in WEIGHTS))

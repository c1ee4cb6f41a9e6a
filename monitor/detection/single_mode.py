"""Windows in which one mode alone is inconsistent: a temporary wrong pole, or a change of one mode.

A wrong pole often stays for several windows, so that a few windows in a row do not distinguish the two. How long such
runs last is learned from those that have ended: the number of windows to wait follows from the stated false alarm rate.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy  # its parts at their first use
from scipy.special import gammaln

from daq import FloatArray

MAX_HOLD_WINDOWS = 36  #: longest wait for a change of one mode alone
_ORDINARY = 0.99  # quantile of chi-square up to which the other modes are taken for unchanged
_INCONSISTENT_SCORE = 4.0  # standard deviations from which a mode given the others is inconsistent ...
_ORDINARY_SCORE = 2.5  # ... and up to which it is ordinary
_PRIOR_ON, _PRIOR_END = 3.0, 3.0  # beta prior of a run's continuing and ending: runs of two and a half windows
_PRIOR_RUNS, _PRIOR_WINDOWS = 1.0, 1000.0  # runs, and windows that they came in: one per week of ten-minute windows
_LENGTHS = np.arange(1, MAX_HOLD_WINDOWS + 1)

BoolArray = npt.NDArray[np.bool_]
IndexArray = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False, kw_only=True)
class SingleModeRuns:
    """The present run of windows in which one mode alone is inconsistent, and the runs that have ended."""

    mode: IndexArray  #: (...,) of the present run, -1 if there is none
    length: FloatArray  #: (...,) windows of it
    n_ended: FloatArray  #: (...,) runs that have ended
    in_ended: FloatArray  #: (...,) windows of these
    n_windows: FloatArray  #: (...,) windows in all

    def hold(self, rate: float) -> IndexArray:
        """Return how many windows (...,) a run must have before it counts.

        The probability of a run of that length is that of a geometric distribution whose probability to continue is
        known from ended runs (a beta distribution); times the rate of runs, it is the stated rate of false alarms.

        Parameters
        ----------
        rate : false alarms per window
        """
        on = (_PRIOR_ON + self.in_ended - self.n_ended)[..., None]
        end = (_PRIOR_END + self.n_ended)[..., None]
        longer = gammaln(on + _LENGTHS - 1) - gammaln(on + end + _LENGTHS - 1) + gammaln(on + end) - gammaln(on)
        often = (_PRIOR_RUNS + self.n_ended) / (_PRIOR_WINDOWS + self.n_windows)
        enough = np.log(often)[..., None] + longer <= np.log(rate)
        return np.where(enough.any(-1), enough.argmax(-1) + 1, MAX_HOLD_WINDOWS)


def no_runs(shape: tuple[int, ...]) -> SingleModeRuns:
    """Return the runs of sites before any window."""
    zero = np.zeros(shape)
    return SingleModeRuns(mode=np.full(shape, -1), length=zero, n_ended=zero, in_ended=zero, n_windows=zero)


def most_inconsistent(squared: FloatArray, score: FloatArray, n: IndexArray) -> tuple[BoolArray, IndexArray]:
    """Return whether one mode alone is inconsistent, and which one is the most inconsistent.

    It must be beyond the noise of one mode, and the others ordinary without it. With at most half of the modes
    measured, the others are too few to be evidence of an unchanged structure.

    Parameters
    ----------
    squared : (...,) squared Mahalanobis distance of all modes
    score : (..., n_tracks) of each mode given the others, from `scores.alone`; NaN where missing
    n : (...,) modes that are there
    """
    size = np.nan_to_num(score**2)
    rest = squared - size.max(-1)
    ordinary = rest <= scipy.stats.chi2.ppf(_ORDINARY, np.maximum(n - 1, 1))
    enough = 2 * n > score.shape[-1]
    return enough & ordinary & (size.max(-1) > _INCONSISTENT_SCORE**2), size.argmax(-1)


def wait(runs: SingleModeRuns, single: IndexArray, score: FloatArray, rate: float) -> tuple[BoolArray, SingleModeRuns]:
    """Return which windows (..., n_windows) do not count yet, and the runs after them.

    A run continues through windows without its mode, or with that mode below the limits but not ordinary.

    Parameters
    ----------
    runs : before the windows
    single : (..., n_windows) mode that alone brings a window over a limit, -1 if none does
    score : (..., n_windows, n_tracks) of each mode given the others; NaN where missing
    rate : false alarms per window
    """
    waiting = np.zeros(single.shape, dtype=np.bool_)
    for k in range(single.shape[-1]):
        mode, running = single[..., k], runs.mode >= 0
        own = np.take_along_axis(score[..., k, :], np.maximum(runs.mode, 0)[..., None], axis=-1)[..., 0]
        unseen = running & (mode < 0) & np.isnan(own)
        same = running & ((mode == runs.mode) | ((mode < 0) & (np.abs(np.nan_to_num(own)) > _ORDINARY_SCORE)))
        going_on = same | unseen
        ended = running & ~going_on
        runs = SingleModeRuns(
            mode=np.where(going_on, runs.mode, mode),
            length=np.where(going_on, runs.length + same, 1.0 * (mode >= 0)),
            n_ended=runs.n_ended + ended,
            in_ended=runs.in_ended + np.where(ended, np.minimum(runs.length, MAX_HOLD_WINDOWS), 0.0),
            n_windows=runs.n_windows + 1,
        )
        waiting[..., k] = (mode >= 0) & (runs.length < runs.hold(rate))
    return waiting, runs

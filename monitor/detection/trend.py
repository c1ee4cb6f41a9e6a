"""Slow trends of natural frequencies: a constant rate of change, the effects of temperature and season removed.

The detectors' law is learned from calm windows and therefore follows slow changes. Weekly means of the same windows are
kept for years. Their regression on time, temperature and season gives each mode's rate, with a standard deviation that
includes autocorrelation. A week averages over the cycles of the day and of working days.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from daq import FloatArray
from monitor.detection.correlated_noise import regress
from monitor.detection.temperature_law import COMMON_STD, UNOBSERVED_STD
from monitor.detection.temperature_terms import N_TERMS, prior_std

WEEK = 7 * 86400.0  #: s
YEAR = 365.25 * 86400.0  #: s
SIGNIFICANT = 4.0  #: standard deviations at which a rate is reported ...
INSIGNIFICANT = 2.0  #: ... and under which a reported one is withdrawn
MIN_WEEKS = 8  #: weeks with windows, before a rate is estimated
_MAX_WEEKS = 522  # ten years: older weeks are dropped
_CONSTANTS = (1.5, 5.0, 15.0, 50.0, 150.0)  # weeks, of the autocorrelation: up to much longer than a record
_RATE_STD = 0.02  # prior rate of a structure [per year]
_HARMONICS = np.array([1.0, 2.0])  # of the year
_UNMEASURED = 10 / 3  # times `COMMON_STD`: seasons without a thermometer, frost included
_WILD = 4.5  # robust standard deviations about the median of successive windows, from which a value is left out


@dataclass(frozen=True, eq=False, kw_only=True)
class WeeklyMeans:
    """Sums over the windows of each week; leading dimensions are sites.

    A week in which the structure changed has a row for each of its states.
    """

    week: npt.NDArray[np.intp]  #: (n_rows,) since the baseline
    state: npt.NDArray[np.intp]  #: (n_rows,) of the structure, counted from the baseline's
    present: int  #: state now
    count: FloatArray  #: (..., n_rows, n_tracks) windows
    total: FloatArray  #: (..., n_rows, n_tracks) log frequencies about the law's centre, summed [-]
    n_terms: FloatArray  #: (..., n_rows) windows in ...
    terms: FloatArray  #: (..., n_rows, q) regressors of temperature, summed


@dataclass(frozen=True, eq=False, kw_only=True)
class Trend:
    """Rates of change of one site's log frequencies."""

    rate: FloatArray  #: (n_tracks,) per year [-]
    std: FloatArray  #: (n_tracks,)
    common_rate: float  #: rate of the mean over all modes, per year [-]
    common_std: float
    seconds: float  #: time from the first week to the last [s]

    @property
    def score(self) -> float:
        """Largest rate over its standard deviation, of the modes and of their mean."""
        known = np.isfinite(self.rate)
        each = np.abs(self.rate[known] / self.std[known])
        return float(max(abs(self.common_rate / self.common_std), *each))


@dataclass(frozen=True, eq=False, kw_only=True)
class TrendWatch:
    """The present trend, and the one last reported."""

    week: int = -1  #: week of the last estimate
    present: Trend | None = None  #: significant one
    reported: Trend | None = None  #: the same at the last event; None before any and where that withdrew it


NO_TREND = TrendWatch()  #: before any is estimated


def follow_trend(watch: TrendWatch, weekly: WeeklyMeans) -> tuple[TrendWatch, bool]:
    """Return the trend after more windows, and whether it is to be reported; it is estimated once per week.

    A trend is active from `SIGNIFICANT` deviations on until it has fewer than `INSIGNIFICANT`. It is reported when it
    begins and ends, and when its rates differ from those reported by `SIGNIFICANT` deviations.
    """
    week = int(weekly.week[-1]) if len(weekly.week) else -1
    if week == watch.week:
        return watch, False
    found = trend_of(weekly)
    least = SIGNIFICANT if watch.present is None else INSIGNIFICANT
    present = found if found is not None and found.score > least else None
    new = _differs(watch.reported, present)
    return TrendWatch(week=week, present=present, reported=present if new else watch.reported), new


def _differs(reported: Trend | None, present: Trend | None) -> bool:
    if reported is None or present is None:
        return (reported is None) != (present is None)
    change = np.append(present.rate - reported.rate, present.common_rate - reported.common_rate)
    std = np.hypot(np.append(present.std, present.common_std), np.append(reported.std, reported.common_std))
    return bool((np.abs(change) > SIGNIFICANT * std).any())


def no_weeks(lead: tuple[int, ...], n_tracks: int) -> WeeklyMeans:
    """Return the weekly means before any window."""
    none = np.empty(0, np.intp)
    values = np.empty((*lead, 0, n_tracks))
    return WeeklyMeans(
        week=none,
        state=none,
        present=0,
        count=values,
        total=values,
        n_terms=np.empty((*lead, 0)),
        terms=np.empty((*lead, 0, N_TERMS)),
    )


def add_windows(
    weekly: WeeklyMeans, age: FloatArray, terms: FloatArray, deviation: FloatArray, residual: FloatArray
) -> WeeklyMeans:
    """Return the weekly means after successive windows.

    Parameters
    ----------
    weekly : before
    age : (n_windows,) since the baseline [s]
    terms : (..., n_windows, q) regressors of temperature
    deviation : (..., n_windows, n_tracks) log frequencies about the law's centre [-], NaN where not to be used
    residual : (..., n_windows, n_tracks) residuals of the law, by which wild values are recognised
    """
    off = np.abs(residual - _median(residual))
    kept = np.where(off > _WILD * 1.4826 * _median(off), np.nan, deviation)
    for week in np.unique(np.floor(age / WEEK)).astype(np.intp):
        inside = np.floor(age / WEEK) == week
        weekly = _add(weekly, int(week), terms[..., inside, :], kept[..., inside, :])
    return weekly


def next_state(weekly: WeeklyMeans) -> WeeklyMeans:
    """Return the weekly means where a change of the structure was accepted, or an acceptance taken back."""
    return replace(weekly, present=weekly.present + 1)


def trend_of(weekly: WeeklyMeans) -> Trend | None:
    """Return the rates of one site; None before there are enough weeks.

    Modes that too few weeks show have NaN. Each state of the structure has a constant of its own.
    """
    if len(weekly.week) < MIN_WEEKS:
        return None
    time: FloatArray = np.asarray((weekly.week + 0.5) * WEEK / YEAR, dtype=np.float64)
    x, prior = _design(weekly, time)
    mean = np.where(weekly.count > 0, weekly.total / np.maximum(weekly.count, 1), np.nan)
    often = np.isfinite(mean).mean(0) > 0.5
    if not often.any():
        return None
    series = np.column_stack([mean, mean[:, often].mean(1)])
    weights = np.column_stack([weekly.count, weekly.count[:, often].min(1, initial=np.inf)])
    found = [_rate(y, weight, x, prior, time) for y, weight in zip(series.T, weights.T, strict=True)]
    if not np.isfinite(found[-1][0]):
        return None
    rate, std = np.array(found).T
    return Trend(
        rate=rate[:-1],
        std=std[:-1],
        common_rate=float(rate[-1]),
        common_std=float(std[-1]),
        seconds=float(np.ptp(weekly.week) + 1) * WEEK,
    )


def _median(values: FloatArray) -> FloatArray:
    """Return the medians (..., 1, n_tracks) over windows, zero where there is none."""
    seen = np.isfinite(values).any(-2, keepdims=True)
    return np.asarray(np.nanmedian(np.where(seen, values, 0.0), axis=-2, keepdims=True))


def _add(weekly: WeeklyMeans, week: int, terms: FloatArray, kept: FloatArray) -> WeeklyMeans:
    if not len(weekly.week) or weekly.week[-1] != week or weekly.state[-1] != weekly.present:
        weekly = _with_row(weekly, week)
    seen = np.isfinite(kept)
    some = np.asarray(seen.any(-1))
    count, total, n_terms, summed = (a.copy() for a in (weekly.count, weekly.total, weekly.n_terms, weekly.terms))
    count[..., -1, :] += seen.sum(-2)
    total[..., -1, :] += np.where(seen, kept, 0.0).sum(-2)
    n_terms[..., -1] += some.sum(-1)
    summed[..., -1, :] += np.where(some[..., None], terms, 0.0).sum(-2)
    return replace(weekly, count=count, total=total, n_terms=n_terms, terms=summed)


def _with_row(weekly: WeeklyMeans, week: int) -> WeeklyMeans:
    """Return the weekly means with one row more, of nothing, the oldest dropped if there are too many."""

    def longer(values: FloatArray, axis: int) -> FloatArray:
        shape = [*values.shape]
        shape[axis] = 1
        out = np.concatenate([values, np.zeros(shape)], axis=axis)
        return np.take(out, np.arange(max(0, out.shape[axis] - _MAX_WEEKS), out.shape[axis]), axis=axis)

    return WeeklyMeans(
        week=np.append(weekly.week, week)[-_MAX_WEEKS:],
        state=np.append(weekly.state, weekly.present)[-_MAX_WEEKS:],
        present=weekly.present,
        count=longer(weekly.count, -2),
        total=longer(weekly.total, -2),
        n_terms=longer(weekly.n_terms, -1),
        terms=longer(weekly.terms, -2),
    )


def _design(weekly: WeeklyMeans, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return regressors (n_rows, q), the rate first, and their coefficients' prior standard deviations (q,)."""
    terms = weekly.terms / np.maximum(weekly.n_terms, 1)[:, None]
    each = np.hypot(*prior_std(np.ones(1)))  # of one mode, in log frequency
    used = np.arange(1, terms.shape[1])  # all but the constant
    measured = bool(terms[:, used].any())
    season = 2 * np.pi * time[:, None] * _HARMONICS
    season_std = np.tile((UNOBSERVED_STD if measured else _UNMEASURED * COMMON_STD) / _HARMONICS, 2)
    states = (weekly.state.reshape(-1, 1) == np.unique(weekly.state)).astype(float)
    x = np.column_stack([time - time.mean(), terms[:, used], np.cos(season), np.sin(season), states])
    prior = np.concatenate([[_RATE_STD], each[used], season_std, np.ones(states.shape[1])])
    return x, prior


def _rate(y: FloatArray, weight: FloatArray, x: FloatArray, prior: FloatArray, time: FloatArray) -> tuple[float, float]:
    known = np.isfinite(y) & (weight > 0)
    if known.sum() < MIN_WEEKS:
        return float("nan"), float("nan")
    found = regress(y[known], x[known], prior, time[known] * YEAR / WEEK, _CONSTANTS, weight[known])
    return float(found.coefficient[0]), float(found.std[0])

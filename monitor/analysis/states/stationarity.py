"""Changes of natural frequencies within a record: when, and by how much.

The influence of each block of time on a mode's frequency, which gives the standard deviation, is a series over time: it
scatters about zero while the structure stays as it is, and steps where its stiffness or mass changes. A split of
the series that is more uneven than splits of its permutations is confirmed by the modes of both sides.

References
----------
Pettitt, A. N. (1979). A non-parametric approach to the change-point problem. Applied Statistics 28(2), 126-135.
Good, P. (2005). Permutation, parametric, and bootstrap tests of hypotheses. Springer, chapter 3.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, IndexArray, Recording
from monitor.text.quantities import utc
from oma import IdentificationError, Method, ModalEstimate, identify_all, mac_matrix
from oma.windows import Windows, identify_windows
from updater.modal_data import fuse, windows_of_one_state

if TYPE_CHECKING:
    from monitor.analysis.observation import Observation
    from updater.diagnosis import ReferenceStep

_MAX_COLUMNS = 120  # blocks of time in a series; neighbours are averaged down to that
_EDGE = 2  # least blocks on each side of a change
_PERMUTATIONS = 4000
_CLEAR = 40  # permutations as uneven as the found split, after which its p-value is known to a sixth
_N_PARTS = 6  # that a single window is cut into where a change is suspected
_SUSPICION = 0.05  # rate at which a stationary record is looked at twice
_FALSE_CHANGE = 1e-3  # rate at which a difference between both sides counts by chance
_LIKELY = 0.01  # the same where the split by itself is that uneven
_STD_FACTOR = 1.5  # real over stated deviation of frequencies of short records, at most
_MIXED = 1 / 8  # error of the time of a large step within a window, over its length
_MIN_MAC, _MAX_SHIFT = 0.8, 0.1  # of a mode before and after, the latter of ln f
_MAX_NAMED = 4  # modes in a sentence


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyChange:
    """A step of natural frequencies within a record, or the middle of a drift."""

    time: int  #: [ns UTC]
    time_std: float  #: [s]
    before: ModalEstimate  #: paired modes before the change
    after: ModalEstimate  #: the same after it

    @property
    def words(self) -> str:
        """Sentence for the user."""
        when = datetime.fromtimestamp(self.time // 10**9, UTC)
        shift = np.log(self.after.frequency / self.before.frequency)
        std = np.hypot(*(side.frequency_std / side.frequency for side in (self.before, self.after)))
        order = np.argsort(-np.abs(shift / std))[:_MAX_NAMED]
        modes = ", ".join(
            f"{self.before.frequency[i]:.4g} -> {self.after.frequency[i]:.4g} Hz ({shift[i]:+.2%} ± {std[i]:.2%})"
            for i in np.sort(order)
        )
        return (
            f"the structure changed within the record, at {when:%Y-%m-%dT%H:%M:%SZ} ± {self.time_std:.2g} s: {modes}; "
            "the table averages over both states: identify each by itself with --to and --from, or choose a shorter "
            "--window"
        )


def frequency_change(
    windows: Windows,
    recordings: Callable[[], Iterable[Recording]],
    method: Method | None = None,
    band: tuple[float, float] | None = None,
) -> FrequencyChange | None:
    """Return the largest change of frequencies within windows; None if there is none.

    A stationary record shows one in fewer than one case in a thousand (`test_stationarity.py`).
    Slow drifts, as of temperature, count as well.

    Parameters
    ----------
    windows : identified
    recordings : reads the windows again; called only where something is suspected
    method, band : as for `oma.identify`
    """
    step = _step(windows)
    if step is None or step.probability > _SUSPICION:
        return None
    band = band or windows.band
    if (
        len(windows.estimates) == 1
    ):  # large steps are not small to first order: shorter windows show them where they are
        (start,) = (e.start for e in windows.estimates)
        recording = next(r for r in recordings() if r.start == start)
        edges = [round(k * len(recording.data) / _N_PARTS) for k in range(_N_PARTS + 1)]
        parts = [_part(recording, first, last) for first, last in pairwise(edges)]
        with suppress(IdentificationError):
            finer = _step(identify_windows(parts, method, band))
            step = finer if finer and finer.probability <= step.probability else step
    sides = _sides(windows.estimates, step.time, recordings, method, band)
    if sides is None:
        return None
    partner = _partners(*sides)
    before, after = sides[0][np.flatnonzero(partner >= 0)], sides[1][partner[partner >= 0]]
    shift = np.log(after.frequency / before.frequency)
    std = np.hypot(after.frequency_std / after.frequency, before.frequency_std / before.frequency)
    square = float(np.sum((shift / (_STD_FACTOR * std)) ** 2))
    most = _LIKELY if step.probability < _FALSE_CHANGE else _FALSE_CHANGE
    if not len(shift) or scipy.special.chdtrc(len(shift), square) > most:
        return None
    return FrequencyChange(time=step.time, time_std=step.time_std, before=before, after=after)


@dataclass(frozen=True, kw_only=True)
class _Step:
    """Most likely step of the frequencies of windows."""

    time: int  #: [ns UTC]
    time_std: float  #: [s]
    probability: float  #: probability of so uneven a split by chance [-]


def _step(windows: Windows) -> _Step | None:
    """Return the most likely step; None where there are too few blocks of time."""
    if not windows.estimates:
        return None
    series, middle = _series(windows, max(windows.estimates, key=lambda e: e.n_modes))
    if series.shape[1] < 4 * _EDGE:
        return None
    column, spread, probability = change_point(series)
    time = int((middle[column - 1] + middle[column]) // 2)
    # a window with both states in it has modes between them, to which its blocks are not compared without bias
    mixed = sum(1e-9 * (e.end - e.start) * _MIXED for e in windows.estimates if e.start < time < e.end)
    return _Step(
        time=time,
        time_std=float(np.hypot(spread * np.median(np.diff(middle)) * 1e-9, mixed)),
        probability=probability,
    )


def change_point(series: FloatArray) -> tuple[int, float, float]:
    """Return the first column after the most likely step, the step's standard deviation [columns], and its p-value.

    Parameters
    ----------
    series : (n_series, n_columns) array
        With a step common to all series, of any sign and size in each, or none. NaN where nothing is known.

    Returns
    -------
    column : int
    spread : float
        At least that of a uniform distribution within a column.
    probability : float
        Of so uneven a split by chance, by permutation of the columns; normal scores make outliers harmless.
    """
    n = series.shape[1]
    score = np.stack([_normal_scores(row) for row in series])
    score = score - score.mean(axis=1, keepdims=True)
    score /= np.maximum(score.std(axis=1, keepdims=True), 1e-12)
    statistic = _unevenness(score)
    best = int(np.argmax(statistic))
    random = np.random.default_rng(0)
    n_above = tried = 0
    while tried < _PERMUTATIONS and n_above < _CLEAR:
        n_above += int(_unevenness(score[:, random.permutation(n)]).max() >= statistic[best])
        tried += 1
    weight = np.exp((statistic - statistic[best]) / 2)
    place = np.arange(len(weight))
    mean = weight @ place / weight.sum()
    spread = np.sqrt(weight @ (place - mean) ** 2 / weight.sum() + 1 / 12)
    return best + _EDGE, float(spread), (1 + n_above) / (tried + 1)


def _normal_scores(row: FloatArray) -> FloatArray:
    """Return the normal quantiles of the ranks of values (n,), equal ones at their mean rank; 0 for NaN."""
    known = np.isfinite(row)
    values, ordered = row[known], np.sort(row[known])
    twice = np.searchsorted(ordered, values, "left") + np.searchsorted(ordered, values, "right")
    score = np.zeros(len(row))
    score[known] = list(map(NormalDist().inv_cdf, (twice / 2 / len(values)).tolist()))
    return score


def _unevenness(score: FloatArray) -> FloatArray:
    """Return the sum over series of the squared difference of means, over its variance, for each split (n_splits,)."""
    n = score.shape[1]
    left = np.arange(_EDGE, n - _EDGE + 1)
    sums = np.cumsum(score, axis=1)[:, left - 1]
    return np.asarray(np.sum(sums**2, axis=0) / (left * (n - left) / n))


def _series(windows: Windows, seed: ModalEstimate) -> tuple[FloatArray, FloatArray]:
    """Return log frequencies of blocks of time (n_modes, n_columns), NaN where unseen, and their times [ns].

    To first order: a frequency is the mean over its blocks' own, and the influence of a block is its share of it.
    """
    rows, times = [], []
    for estimate, moves in zip(windows.estimates, windows.frequency_moves, strict=True):
        n = moves.shape[1]
        per_window = max(1, min(n, _MAX_COLUMNS // len(windows.estimates)))
        partner = _partners(seed, estimate)
        blocks = np.log(estimate.frequency)[:, None] + n * moves / estimate.frequency[:, None]
        means = np.stack([part.mean(axis=1) for part in np.array_split(blocks, per_window, axis=1)], axis=1)
        rows.append(np.where(partner[:, None] >= 0, means[partner], np.nan))
        step = (estimate.end - estimate.start) / per_window
        times.append(estimate.start + step * (np.arange(per_window) + 0.5))
    return np.concatenate(rows, axis=1), np.concatenate(times)


def _partners(a: ModalEstimate, b: ModalEstimate) -> IndexArray:
    """Return the mode of `b` that each mode of `a` is (n_modes,), -1 without one: the nearest of the same shape."""
    common = [c for c in a.channels if c in b.channels]
    ours, theirs = (e.shape[:, [e.channels.index(c) for c in common]] for e in (a, b))
    away = np.abs(np.log(a.frequency[:, None] / b.frequency))
    cost = np.where((away < _MAX_SHIFT) & (mac_matrix(ours, theirs) > _MIN_MAC), away, np.inf)
    nearest = np.argmin(cost, axis=1)
    mutual = np.argmin(cost, axis=0)[nearest] == np.arange(len(nearest))
    return np.where(mutual & np.isfinite(cost.min(axis=1)), nearest, -1)


def _part(recording: Recording, first: int, last: int) -> Recording:
    """Return the samples from `first` up to `last`."""
    start = recording.start + round(first / recording.rate * 1e9)
    return replace(recording, data=recording.data[first:last], start=start)


def _sides(
    estimates: Sequence[ModalEstimate],
    time: int,
    recordings: Callable[[], Iterable[Recording]],
    method: Method | None,
    band: tuple[float, float] | None,
) -> tuple[ModalEstimate, ModalEstimate] | None:
    """Return the modes before and after a time: of whole windows where there are any, else of the part of one."""
    whole = [[e for e in estimates if e.end <= time], [e for e in estimates if e.start >= time]]
    recording = None if all(whole) else next((r for r in recordings() if r.start < time < r.end), None)
    sides = []
    with suppress(IdentificationError):
        for k, windows in enumerate(whole):
            if windows:
                sides.append(fuse(windows).estimate)
            elif recording:
                n = round((time - recording.start) * 1e-9 * recording.rate)
                part = _part(recording, n, len(recording.data)) if k else _part(recording, 0, n)
                sides.append(identify_all(part, method, band).estimate)
    return (sides[0], sides[1]) if len(sides) == 2 else None


_DAY = 86400.0  # s


def of_one_state(observation: "Observation") -> "tuple[Observation, tuple[ReferenceStep, ...]]":
    """Return the windows of the state that most of them show, and the changes to the others."""
    ordered, seconds = in_order_of_time(observation)
    kept, changes = windows_of_one_state(ordered.modes, seconds, ordered.temperature, ordered.rms)
    if not changes:
        return observation, ()
    lost = np.setdiff1d(np.arange(len(seconds)), kept)
    runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1)
    steps = tuple(_reference_step(ordered, kept, run, max(change.p_value for change in changes)) for run in runs)
    return ordered.chosen(kept), steps


def in_order_of_time(observation: "Observation") -> "tuple[Observation, FloatArray]":
    """Return the windows in the order of time, and their starts (n_windows,) from the first on [s]."""
    order = np.argsort([estimate.start for estimate in observation.estimates], kind="stable")
    ordered = observation.chosen(order)
    return ordered, _seconds([estimate.start for estimate in ordered.estimates])


def step_text(step: "ReferenceStep") -> str:
    """Return a sentence on windows that are left out."""
    k = int(np.argmax(np.abs(step.shift_percent)))
    return (
        f"the structure was in another state from {utc(step.start)} to {utc(step.end)}: the mode at "
        f"{step.frequency[k]:.4g} Hz moved by {step.shift_percent[k]:+.2g} ± {step.shift_std_percent[k]:.1g} %; "
        f"{step.n_windows} of {step.of_windows} windows are left out"
    )


def _reference_step(observation: "Observation", kept: IndexArray, run: IndexArray, p_value: float) -> "ReferenceStep":
    from updater.diagnosis import ReferenceStep  # slow to import, and few logs need it

    used, left = observation.modes.windows(kept), observation.modes.windows(run)
    seen = np.isfinite(used.log_frequency).any(0) & np.isfinite(left.log_frequency).any(0)
    mean = [np.nanmean(m.log_frequency[:, seen], axis=0) for m in (used, left)]
    n = [np.isfinite(m.log_frequency[:, seen]).sum(0) for m in (used, left)]
    std = np.nanstd(used.log_frequency[:, seen], axis=0, ddof=1) * np.sqrt(1 / n[0] + 1 / n[1])
    first, last = observation.estimates[run[0]], observation.estimates[run[-1]]
    return ReferenceStep(
        start=first.start,
        end=last.end,
        n_windows=len(run),
        of_windows=len(observation.estimates),
        frequency=tuple(np.exp(mean[0]).tolist()),
        shift_percent=tuple((100 * np.expm1(mean[1] - mean[0])).tolist()),
        shift_std_percent=tuple((100 * std).tolist()),
        p_value=p_value,
    )


def _seconds(starts: Sequence[int]) -> FloatArray:
    """Return the starts (n_windows,) from the first on [s]; a day apart where files do not state them."""
    seconds = (np.array(starts) - starts[0]) * 1e-9
    return seconds if np.all(np.diff(seconds) > 0) else _DAY * np.arange(len(starts), dtype=np.float64)

"""Distance of each window from the baseline: the live side of `monitor.detection`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import IndexArray
from monitor.analysis.window import Window
from monitor.detection import (
    CHUNK,
    DETECTORS,
    GUARD,
    NO_TREND,
    DetectionSettings,
    LawState,
    ScoredWindows,
    Shift,
    TrendWatch,
    accept,
    detectable_change,
    follow_trend,
    judge,
    least_unsure,
    shift_of,
    shifted,
    start,
)
from monitor.results.windows import DetectableChange, DetectorFigure, Novelty, SingleMode, TrendResult
from monitor.settings import Settings
from monitor.text.detection import trend_result
from updater import TrackedModes, stack_tracks

MAX_OUT = 100  #: windows that a standing alarm is explained by: the newest, so that years of it fit into memory
_YEAR = 365.25 * 86400  # s


@dataclass(frozen=True, eq=False, kw_only=True)
class DetectorState:
    """State of the evaluation of windows."""

    watched: LawState
    before: int  #: start of the last window [ns UTC]
    calm: tuple[ScoredWindows, ...] = ()  #: not learned from yet
    out: tuple[ScoredWindows, ...] = ()  #: windows above the limit, without interruption, the newest `MAX_OUT`
    trend: TrendWatch = NO_TREND

    @property
    def n_tracks(self) -> int:
        """Number of the tracks that it was learned from, hidden ones among them."""
        return len(self.watched.law.scale)


class Detector:
    """Judges windows in their order, and learns from calm ones.

    Parameters
    ----------
    state : from `first_state`, or kept from before; limits are those of the settings of now
    settings : of the site
    """

    def __init__(self, state: DetectorState, settings: Settings) -> None:
        self._per_year = settings.alarm.false_alarms_per_year / len(DETECTORS)
        self._step = settings.step_seconds
        self._watched = replace(state.watched, watching=watching_of(settings))
        self._before, self._calm, self._out = state.before, list(state.calm), list(state.out)
        self._trend, self._forgiven = state.trend, settings.alarm.trend == "forgive"
        #: smallest detectable change in the last window, if uncertain: see `least_unsure`
        self.least: float | None = None

    @property
    def state(self) -> DetectorState:
        """State to continue from."""
        return DetectorState(
            watched=self._watched,
            before=self._before,
            calm=tuple(self._calm),
            out=tuple(self._out),
            trend=self._trend,
        )

    @property
    def trend(self) -> TrendResult | None:
        """Return the significant trend, unless it is forgiven."""
        present = self._trend.present
        return None if present is None or self._forgiven else trend_result(present)

    @property
    def has_thermometer(self) -> bool:
        """Return whether most of the baseline's windows have a temperature."""
        return bool(self._watched.law.measured)

    @property
    def silent_hours(self) -> float | None:
        """Return the time since the last temperature reading [h]; None if the last window has one, or none ever had."""
        climate = self._watched.climate
        return float(climate.silent) / 3600 if climate.silent > 0 and np.isfinite(climate.air) else None

    def shift(self, n: int) -> Shift:
        """Return the shift (n_tracks,) of the last n windows, all above the limit, from the frequencies expected."""
        return shift_of(self._watched, self._out[-n:])

    def moved(self, n: int) -> tuple[DetectorState, Shift]:
        """Return the state after a move of the structure, by the last n windows, all above the limit."""
        shift = self.shift(n)
        return self._at(shifted(self._watched, shift)), shift

    def seen_again(self, modes: TrackedModes, tracks: IndexArray) -> tuple[DetectorState, Shift]:
        """Return the state with hidden modes monitored again, and their present shifts.

        Parameters
        ----------
        modes : (n_windows, n_tracks) of the last windows, which all stayed calm
        tracks : (n,) that are watched again
        """
        law = self._watched.law
        calm = self._calm[-len(modes.log_frequency) :]
        whitened = law.whiten(modes.log_frequency[-len(calm) :])
        now = shift_of(self._watched, [replace(j, whitened=w[None]) for j, w in zip(calm, whitened, strict=True)])
        again = np.isin(np.arange(len(law.scale)), tracks)
        own = Shift(log_frequency=np.where(again, now.log_frequency, 0.0), std=np.where(again, now.std, np.nan))
        return self._at(shifted(self._watched, own)), own

    def moved_back(self, shift: Shift) -> DetectorState:
        """Return the state after an undone move."""
        return self._at(shifted(self._watched, shift, back=True))

    def _at(self, watched: LawState) -> DetectorState:
        """Return the state by a law that was moved: windows judged by the former one are dropped."""
        return DetectorState(watched=watched, before=self._before, trend=self._trend)

    def evaluate(self, window: Window, track: IndexArray) -> Novelty:
        """Judge one window, whose modes `track` (n_tracks,) gives the tracks of; -1 where one is missing."""
        modes = stack_tracks([window.synchronized], [track])
        passed = (window.start - self._before) / 1e9
        seconds = np.array([passed if passed > 0 else self._step])  # a clock that was set back gives no interval
        temperature = np.array([window.temperature])
        judged, self._watched = judge(
            self._watched,
            modes.log_frequency,
            temperature,
            seconds,
            std=modes.log_frequency_std,
            rms=np.array([window.rms]),
        )
        self.least = least_unsure(self._watched, judged)
        self._before = window.start
        self._calm.append(judged)
        self._out = [*self._out, judged][-MAX_OUT:] if judged.over[0] else []
        return self._novelty(judged, np.flatnonzero(track >= 0))

    def _novelty(self, judged: ScoredWindows, seen: IndexArray) -> Novelty:
        figures = [
            DetectorFigure(detector=name, value=float(value), limit=float(limit), false_alarms_per_year=self._per_year)
            for name, value, limit in zip(DETECTORS, judged.value[:, 0], judged.limit[:, 0], strict=True)
        ]
        first = max(figures, key=lambda figure: figure.value / figure.limit)
        return Novelty(
            t2=first.value,
            limit=first.limit,
            modes=(seen + 1).tolist(),
            detectors=figures,
            single_mode=self._single_mode(int(judged.waiting[0])),
            detectable=self._detectable(judged),
            trend=self.trend,
        )

    def _detectable(self, judged: ScoredWindows) -> DetectableChange:
        found = detectable_change(self._watched, judged)
        return DetectableChange(
            alike_percent=100 * found.alike,
            modes_percent=(100 * found.each).tolist(),
            thermometer=self.has_thermometer,
        )

    def _single_mode(self, waiting: int) -> SingleMode | None:
        runs = self._watched.runs
        if waiting < 0:
            return None
        needed = int(runs.hold(self._watched.watching.rate))
        return SingleMode(mode=waiting + 1, windows=int(runs.length), needed=needed)

    def settle(self, *, calm: bool) -> bool:
        """Learn from windows that have been followed by enough calm ones; forget those that have not been.

        Returns
        -------
        bool
            Whether a slow trend has begun, ended or changed.
        """
        if not calm:
            self._calm = []
        elif len(self._calm) >= GUARD + CHUNK:
            chunk, self._calm = self._calm[:CHUNK], self._calm[CHUNK:]
            known = np.concatenate([j.terms for j in chunk])
            variance = np.concatenate([j.variance for j in chunk])
            teaching, age = np.concatenate([j.teaching for j in chunk]), np.concatenate([j.age for j in chunk])
            self._watched = accept(self._watched, known, teaching, variance, age)
            self._trend, new = follow_trend(self._trend, self._watched.weekly)
            if self._forgiven:  # it is reported as soon as the setting changes
                self._trend = replace(self._trend, reported=None)
            return new and not self._forgiven
        return False


def watching_of(settings: Settings) -> DetectionSettings:
    """Return how windows are judged."""
    return DetectionSettings(
        rate=settings.alarm.false_alarms_per_year / len(DETECTORS) * settings.step_seconds / _YEAR,
        overlap=settings.analysis.overlap,
        hold=settings.alarm.hold_windows,
    )


def first_state(modes: TrackedModes, windows: Sequence[Window], settings: Settings) -> DetectorState:
    """Return the state learned from a baseline.

    Parameters
    ----------
    modes : the baseline's
    windows : that they come from
    settings : of the site
    """
    starts = np.array([window.start for window in windows])
    watched = start(
        modes.log_frequency,
        modes.log_frequency_std,
        np.array([window.temperature for window in windows]),
        np.diff(starts / 1e9, prepend=starts[0] / 1e9 - settings.step_seconds),
        watching_of(settings),
        rms=np.array([window.rms for window in windows]),
    )
    return DetectorState(watched=watched, before=int(starts[-1]))

"""Many sites monitored at once by the detectors of the live monitor, with its learning and its alarm."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.stats import chi2

from daq import FloatArray
from monitor.detection import (
    CHUNK,
    DETECTORS,
    GUARD,
    NO_TREND,
    DetectionSettings,
    LawState,
    ScoredWindows,
    accept,
    follow_trend,
    judge,
    start,
)
from monitor.detection.alarm import Alarm, AlarmRules

RULES = AlarmRules(hold_windows=2, clear_windows=2, clear_below=0.8, cooldown=3600 * 10**9)
YEAR_SECONDS = 365.25 * 86400


@dataclass(frozen=True, eq=False, kw_only=True)
class Batch:
    """Successive windows of all sites."""

    log_frequency: FloatArray  #: (n_sites, n_windows, n_modes), NaN where missing
    std: FloatArray  #: (n_sites, n_windows, n_modes) stated
    rms: FloatArray  #: (n_sites, n_windows) of the acceleration [m/s2]
    temperature: FloatArray  #: (n_sites, n_windows) [degC], NaN where not measured
    seconds: FloatArray  #: (n_windows,) since the window before [s]


class Source(Protocol):
    """Windows of all sites, in time."""

    @property
    def step(self) -> float:
        """Seconds from one window to the next."""

    def batch(self, n_windows: int) -> Batch:
        """Return the next windows."""


@dataclass
class WatchedSites:
    """Sites with the detectors and the alarm of `modalwatch run` and its default rules."""

    source: Source
    n_baseline: int
    rules: AlarmRules = RULES

    def __post_init__(self) -> None:
        """Learn."""
        b = self.source.batch(self.n_baseline)
        rate = self.source.step / YEAR_SECONDS / len(DETECTORS)
        watching = DetectionSettings(rate=rate, overlap=0.0, hold=self.rules.hold_windows)
        self.watched: LawState = start(b.log_frequency, b.std, b.temperature, b.seconds, watching, b.rms)
        self.alarms = [Alarm(rules=self.rules) for _ in b.log_frequency]
        self.waiting: list[ScoredWindows] = []
        self.raised: list[tuple[int, int, str]] = []  # site, window, detector
        self.window = self.in_alarm = self.trend_events = 0
        self.trends = [NO_TREND for _ in b.log_frequency]

    def watch(self) -> None:
        """Judge and learn from one chunk of windows."""
        b = self.source.batch(CHUNK)
        judged, self.watched = judge(self.watched, b.log_frequency, b.temperature, b.seconds, b.std, b.rms)
        calm = self._alarm(judged)
        for waiting in (*self.waiting, judged):
            waiting.whitened[~calm] = np.nan
        self.waiting.append(judged)
        if len(self.waiting) > GUARD // CHUNK:
            first = self.waiting.pop(0)
            self.watched = accept(self.watched, first.terms, first.teaching, first.variance, first.age)
            self._follow_trends()

    def _follow_trends(self) -> None:
        weekly = self.watched.weekly
        if weekly.week[-1] == self.trends[0].week:
            return
        for site, trend in enumerate(self.trends):
            own = {name: getattr(weekly, name)[site] for name in ("count", "total", "n_terms", "terms")}
            self.trends[site], new = follow_trend(trend, replace(weekly, **own))
            self.trend_events += new

    def reset_alarms(self) -> None:
        """Forget alarms."""
        self.alarms = [Alarm(rules=self.rules) for _ in self.alarms]
        self.raised.clear()
        self.in_alarm = 0

    @property
    def years(self) -> float:
        """Site-years watched so far."""
        return len(self.alarms) * self.window * self.source.step / YEAR_SECONDS

    def _alarm(self, judged: ScoredWindows) -> np.ndarray:
        ratio = judged.value / judged.limit
        level, first = ratio.max(0), ratio.argmax(0)
        busy = (level > 1).any(1) | np.array([a.condition != "normal" or a.run > 0 for a in self.alarms])
        calm = np.ones(len(self.alarms), dtype=bool)
        for site in np.flatnonzero(busy):
            for k in range(level.shape[1]):
                window = self.window + k
                end = int(window * self.source.step * 1e9)
                self.alarms[site], changes = self.alarms[site].evaluate(end, float(level[site, k]))
                for change in changes:
                    if change.state == "alarm" and change.kind == "state":
                        self.raised.append((int(site), window, DETECTORS[first[site, k]]))
                self.in_alarm += self.alarms[site].state == "alarm"
                calm[site] &= self.alarms[site].state == "normal"
        self.window += level.shape[1]
        return calm


def poisson_interval(n: int, years: float) -> tuple[float, float]:
    """Return the 95 % interval of a rate per year after n events."""
    return (chi2.ppf(0.025, 2 * n) / 2 / years if n else 0.0), chi2.ppf(0.975, 2 * n + 2) / 2 / years


def hours_text(hours: float) -> str:
    """Return a delay as text."""
    if not np.isfinite(hours):
        return "not found"
    return f"{hours:.1f} h" if hours < 100 else f"{hours / 24:.0f} d"

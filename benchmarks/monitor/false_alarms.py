"""False alarms over simulated years, and how late masses are found: the tables of the documentation.

Sites are exposed to weather that the detectors' own model does not have: the structure follows the air with two
inertias and is heated by a sun that no thermometer measures, it stiffens smoothly where it freezes, something slow
(moisture, load) moves every mode in its own way, and identification has heavy tails, outliers and missing modes.

    python benchmarks/monitor/false_alarms.py [SITES [DAYS [alarms] [delays] [accepted]]]
"""

import sys
import time
from dataclasses import dataclass, field

import numpy as np

from benchmarks.monitor.watched_sites import Batch, WatchedSites, hours_text, poisson_interval
from daq import FloatArray
from monitor.detection import CHUNK, DETECTORS, judge, shift_of, shifted

P, STEP, DAY = 8, 600.0, 144
YEAR = 52596  # windows
MASSES = (0.0025, 0.005, 0.01, 0.02, 0.04)  # of the structure's
LOOK = 14  # days that a mass is looked for
REAL = 1.3  # real over stated deviation of identification


@dataclass
class Weather:
    """Sites as measured by their sensors; every call continues in time."""

    random: np.random.Generator
    n: int  #: sites
    window: int = 0
    state: dict[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Draw the sites."""
        draw, n = self.random, self.n
        self.season = draw.uniform(0, 1, n)  # when watching begins
        self.swing = draw.uniform(8, 14, n)  # K, half the seasons' difference
        self.mean = draw.uniform(6, 14, n)  # degC
        self.stated = draw.uniform(3e-4, 1e-3, (n, P))
        self.slope = -2e-4 * (1 + 0.2 * draw.standard_normal((n, P)))
        self.ice = draw.choice([0.0, 5e-4, 1.5e-3], n)[:, None] * (1 + 0.3 * draw.standard_normal((n, P)))
        self.moisture = 1.5e-4 * draw.standard_normal((n, P))
        self.absent = draw.uniform(0, 0.15, (n, P))
        self.inertia = draw.uniform(1, 10, n)  # h
        held = draw.random(n) < 1 / 3  # on bearings that stick, or between abutments
        self.slope[held] -= np.abs(draw.normal(0, 1e-3, (n, 1)) + draw.normal(0, 4e-4, (n, P)))[held]
        self.state = {name: np.zeros(n) for name in ("front", "cloud", "wet", "heat")} | {"core": self._air(0.0)}

    def _air(self, front: FloatArray | float) -> FloatArray:
        time_ = self.season + self.window / YEAR
        summer = np.sin(2 * np.pi * time_)
        daily = (5 + 3 * summer) * np.sin(2 * np.pi * (self.window / DAY + 0.6))
        return np.asarray(self.mean + self.swing * summer + daily + front)

    def _follow(self, name: str, towards: FloatArray | float, hours: FloatArray | float) -> FloatArray:
        share = -np.expm1(-STEP / 3600 / np.asarray(hours))
        self.state[name] = self.state[name] + share * (towards - self.state[name])
        return self.state[name]

    def _wander(self, name: str, std: float, hours: float) -> FloatArray:
        kept = np.exp(-STEP / 3600 / hours)
        noise = std * np.sqrt(1 - kept**2) * self.random.standard_normal(self.n)
        self.state[name] = kept * self.state[name] + noise
        return self.state[name]

    def next(self, n_windows: int) -> tuple[FloatArray, FloatArray]:
        """Return log frequencies (n, n_windows, P), NaN where missing, and thermometers' readings (n, n_windows)."""
        log_frequency = np.empty((self.n, n_windows, P))
        read = np.empty((self.n, n_windows))
        for k in range(n_windows):
            air = self._air(self._wander("front", 4.0, 60.0))
            day = np.maximum(np.sin(2 * np.pi * (self.window / DAY + 0.72)), 0.0)
            heat = self._follow("heat", 4 * day * np.clip(1 + self._wander("cloud", 1.0, 20.0), 0, 2), 2.0)
            core = self._follow("core", air + heat, self.inertia)
            inside = 0.7 * core + 0.3 * (air + heat)
            frozen = np.logaddexp(0.0, -inside / 1.5) * 1.5  # K below freezing, with a soft knee
            wet = self._wander("wet", 1.0, 120.0)
            log_frequency[:, k] = (
                self.slope * inside[:, None] + self.ice * frozen[:, None] + self.moisture * wet[:, None]
            )
            read[:, k] = air
            self.window += 1
        error = self.random.standard_t(5, log_frequency.shape) * np.sqrt(3 / 5)
        error *= np.where(self.random.random(error.shape) < 2e-3, 8.0, 1.0)
        log_frequency += REAL * self.stated[:, None, :] * error
        missing = self.random.random(error.shape) < self.absent[:, None, :]
        missing |= self.random.random((self.n, n_windows, 1)) < 5e-3
        log_frequency[missing] = np.nan
        return log_frequency, read + 0.2 * self.random.standard_normal(read.shape)


@dataclass
class Changed:
    """Weather's windows, the log frequencies changed by a shift, with or without thermometers."""

    weather: Weather
    thermometers: bool
    shift: FloatArray | float = 0.0  # (n, P)
    step: float = STEP

    def batch(self, n_windows: int) -> Batch:
        """Return the next windows."""
        y, read = self.weather.next(n_windows)
        y = y + np.broadcast_to(self.shift, (self.weather.n, P))[:, None, :]
        return Batch(
            log_frequency=y,
            std=np.where(np.isfinite(y), self.weather.stated[:, None, :], np.nan),
            rms=np.full(read.shape, 1e-3),
            temperature=read if self.thermometers else np.full_like(read, np.nan),
            seconds=np.full(n_windows, STEP),
        )


def accept_change(sites: WatchedSites, source: Changed, shift: FloatArray, n_windows: int) -> None:
    """Make the structure that windows changed by `shift` (n, P) show the reference, as `modalwatch accept` does."""
    source.shift = shift
    b = source.batch(n_windows)
    never = ~np.isfinite(b.log_frequency).any(axis=1, keepdims=True)  # a mode in no window: it would wait for it
    y = np.where(never, shift[:, None, :], b.log_frequency)
    judged, sites.watched = judge(sites.watched, y, b.temperature, b.seconds, b.std, b.rms)
    sites.watched = shifted(sites.watched, shift_of(sites.watched, [judged]))
    sites.waiting.clear()
    sites.reset_alarms()


def false_alarms(n_sites: int, days: int, n_baseline: int, *, thermometers: bool, seed: int) -> None:
    """Print a line of the first table."""
    began = time.process_time()
    sites = WatchedSites(Changed(Weather(np.random.default_rng(seed), n_sites), thermometers), n_baseline)
    for _ in range(days * DAY // CHUNK):
        sites.watch()
    years, n = n_sites * days / 365.25, len(sites.raised)
    low, high = poisson_interval(n, years)
    by = ", ".join(f"{sum(r[2] == d for r in sites.raised)}" for d in DETECTORS)
    share = sites.in_alarm / (n_sites * days * DAY)
    print(
        f"| {n_baseline} | {'yes' if thermometers else 'no'} | {years:.0f} | {n} ({by}) | {n / years:.2f} "
        f"| {low:.2f} to {high:.2f} | {100 * share:.2f} % | {time.process_time() - began:.0f} s |",
        flush=True,
    )


def delays(n_sites: int, n_baseline: int, *, settled_days: int, thermometers: bool, seed: int) -> None:
    """Print the second table: median delay until the alarm, compared with a test that knows everything but the time."""
    random = np.random.default_rng(seed)
    place = random.uniform(0.05, 0.95, n_sites)
    part = 2 * np.sin(np.pi * np.arange(1, P + 1) * place[:, None]) ** 2  # of a mass in each mode of a beam
    for mass in MASSES:
        source = Changed(Weather(np.random.default_rng((seed, 1)), n_sites), thermometers)
        sites = WatchedSites(source, n_baseline)
        for _ in range(settled_days * DAY // CHUNK):
            sites.watch()
        began, shift = sites.window, -0.5 * mass * part
        standing = np.array([a.state == "alarm" for a in sites.alarms])
        sites.raised.clear()
        source.shift = shift
        for _ in range(LOOK * DAY // CHUNK):
            sites.watch()
        first = np.full(n_sites, np.inf)
        for site, window, _ in sites.raised:
            first[site] = min(first[site], window - began + 1)
        found = first[~standing]
        size = ((shift / (REAL * source.weather.stated)) ** 2 * (1 - source.weather.absent)).sum(1)[~standing]
        best = np.maximum(np.log(YEAR) / (size / 2), 1.0)
        spread = " / ".join(hours_text(v * STEP / 3600) for v in np.quantile(found, [0.5, 0.9], method="higher"))
        ideal = " / ".join(hours_text(v * STEP / 3600) for v in np.quantile(best, [0.5, 0.9]))
        print(
            f"| {100 * mass:g} % | {n_baseline} + {settled_days} days | {100 * np.isfinite(found).mean():.0f} % "
            f"| {spread} | {ideal} | {100 * (best <= LOOK * DAY).mean():.0f} % |",
            flush=True,
        )


def after_acceptance(n_sites: int, days: int, n_windows: int, *, thermometers: bool, seed: int) -> None:
    """Print a line of the third table: false alarms after a change of 2 % was accepted from its first windows."""
    random = np.random.default_rng(seed)
    part = 2 * np.sin(np.pi * np.arange(1, P + 1) * random.uniform(0.05, 0.95, n_sites)[:, None]) ** 2
    shift = -0.5 * 0.02 * part
    source = Changed(Weather(np.random.default_rng((seed, 1)), n_sites), thermometers)
    sites = WatchedSites(source, DAY)
    for _ in range(7 * DAY // CHUNK):
        sites.watch()
    accept_change(sites, source, shift, n_windows)
    began = sites.window
    for _ in range(days * DAY // CHUNK):
        sites.watch()
    years, n = n_sites * days / 365.25, len(sites.raised)
    first = sum(window < began + 30 * DAY for _, window, _ in sites.raised)
    low, high = poisson_interval(n, years)
    print(
        f"| {n_windows} | {'yes' if thermometers else 'no'} | {years:.0f} | {n} | {n / years:.2f} "
        f"| {low:.2f} to {high:.2f} | {first / (n_sites * min(days, 30) / 365.25):.2f} |",
        flush=True,
    )


def main() -> None:
    """Print the tables, or one of them."""
    n_sites = int(sys.argv[1]) if len(sys.argv) > 1 else 550
    days = int(sys.argv[2]) if len(sys.argv) > 2 else 365
    wanted = sys.argv[3:] or ["alarms", "delays", "accepted"]
    if "alarms" in wanted:
        head = ("baseline windows", "thermometers", "years", "false alarms (jump, quick, slow)", "a year", "95 %")
        print(f"| {' | '.join(head)} | in alarm | CPU |")
        print("|---|---|---|---|---|---|---|---|")
        for n_baseline, thermometers in ((DAY, True), (24, True), (DAY, False)):
            false_alarms(n_sites, days, n_baseline, thermometers=thermometers, seed=1)
    if "delays" in wanted:
        print(f"\n| mass | baseline | found in {LOOK} days | delay, median / 9 of 10 | best, the same | best finds |")
        print("|---|---|---|---|---|---|")
        for n_baseline, coordinate_fit in ((DAY, 1), (28 * DAY, 60)):
            delays(max(n_sites * 60 // 550, 10), n_baseline, settled_days=coordinate_fit, thermometers=True, seed=2)
    if "accepted" in wanted:
        print("\n| accepted by windows | thermometers | years | false alarms | a year | 95 % | a year, first 30 days |")
        print("|---|---|---|---|---|---|---|")
        for n_windows, thermometers in ((6, True), (24, True), (6, False)):
            after_acceptance(max(n_sites // 5, 10), days, n_windows, thermometers=thermometers, seed=3)


if __name__ == "__main__":
    main()

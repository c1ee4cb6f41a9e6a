"""Simulated sites over years: frequencies of a few modes, their stated deviations, RMS and temperature.

Independent of the code under test: numpy only. The structure follows the air by its own inertia, the errors of
identification are Gaussian unless a kind states otherwise, and each kind of site adds one difficulty.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_HOUR, _DAY, _YEAR = 3600.0, 86400.0, 365.25 * 86400.0
_MIDSUMMER = 0.5  # of a year that begins in midwinter
_GAP = 30  # windows in a gap, in the mean


@dataclass(frozen=True, kw_only=True)
class SiteKind:
    """One kind of site; defaults: steel, a good thermometer, nothing but identification's Gaussian errors."""

    name: str
    n_modes: int = 6
    step: float = 600.0  #: from one window to the next [s]
    stated: tuple[float, float] = (3e-4, 8e-4)  #: least and largest stated deviation of a log frequency
    slope: tuple[float, float] = (-2e-4, 4e-5)  #: mean and standard deviation over modes [1/K]
    inertia_hours: tuple[float, float] = (0.5, 8.0)  #: time constant with which the structure follows the air [h]
    thermometer: Literal["good", "late", "badly placed", "absent"] = "good"
    silent_per_year: float = 0.0  #: outages of the thermometer, six hours each
    load: float = 0.0  #: relative change of frequency by traffic on working days
    correlated: float = 0.0  #: share of the error variance with a correlation time of two hours
    missing: float = 0.0  #: share of the windows that do not exist, in gaps
    outliers: float = 0.0  #: share of the windows in which one mode is a wrong pole
    burst: float = 1.0  #: mean number of windows in a row with that wrong pole
    wind: float = 1.0  #: ratio of the largest to the smallest deviation, which follow the wind
    wind_stated: bool = False  #: whether stated deviations follow, too
    frost: tuple[float, float] = (0.0, 0.0)  #: least and largest stiffening of a frozen structure
    summer_start: bool = False  #: whether the record begins at midsummer; else anywhere in the year
    drift: float = 0.0  #: relative change of all frequencies per year
    absent_modes: float = 0.03  #: probability of a mode to be missing in a window


KINDS = (
    SiteKind(name="linear temperature", n_modes=8),
    SiteKind(name="late thermometer", thermometer="late"),
    SiteKind(name="badly placed thermometer", n_modes=5, thermometer="badly placed"),
    SiteKind(name="no thermometer", thermometer="absent"),
    SiteKind(name="weekday loads", load=-5e-4),
    SiteKind(name="autocorrelated errors", correlated=0.5),
    SiteKind(name="missing windows", missing=0.2),
    SiteKind(name="single wrong poles", n_modes=7, outliers=0.01),
    SiteKind(name="thermometer silent for 6 h", silent_per_year=50.0),
    SiteKind(name="scatter x2 with wind", wind=2.0),
    SiteKind(name="scatter x4 with wind, stated", wind=4.0, wind_stated=True),
    SiteKind(name="scatter x4 with wind, not stated", wind=4.0),
    SiteKind(name="bursts of one wrong pole", outliers=0.01, burst=4.0),
    SiteKind(name="frost without thermometer", frost=(0.01, 0.03), thermometer="absent", summer_start=True),
    SiteKind(name="frost with thermometer", frost=(0.01, 0.03), summer_start=True),
    SiteKind(name="drift of 0.2 % per year", drift=-2e-3),
    SiteKind(name="quiet", stated=(5e-5, 1.5e-4)),
    SiteKind(name="bridge, hourly", n_modes=4, step=3600.0, stated=(1e-3, 2.5e-3), slope=(-8e-4, 3e-4), load=-1e-3),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class SiteWindows:
    """Successive windows of several sites, and the truth about them."""

    time: FloatArray  #: (n_windows,) since the start of the record [s]
    frequency: FloatArray  #: (n_sites, n_windows, n_modes) [Hz], NaN where a mode is not identified
    frequency_std: FloatArray  #: (n_sites, n_windows, n_modes) stated deviations [Hz]
    rms: FloatArray  #: (n_sites, n_windows) of the acceleration [m/s2]
    temperature: FloatArray  #: (n_sites, n_windows) reading [degC], NaN where there is none
    air: FloatArray  #: (n_sites, n_windows) true air temperature [degC]
    structure: FloatArray  #: (n_sites, n_windows) true temperature of the structure [degC]
    scatter: FloatArray  #: (n_sites, n_windows) true deviation over the smallest one of the site
    change: FloatArray  #: (n_sites, n_modes) relative change of frequency by damage
    wrong: BoolArray  #: (n_sites, n_windows, n_modes) whether a frequency is a wrong pole
    silent: BoolArray  #: (n_sites, n_windows) whether the thermometer is silent


@dataclass
class SimulatedSites:
    """Sites of one kind; every call of `windows` continues in time."""

    kind: SiteKind
    n_sites: int
    seed: int
    _state: dict[str, FloatArray] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        """Draw the sites."""
        kind, n = self.kind, self.n_sites
        number = KINDS.index(kind) if kind in KINDS else len(KINDS)
        self.random = draw = np.random.default_rng((self.seed, number))
        self._gaps = np.random.default_rng((self.seed, number, 1))
        self._slot = self._lived = 0  # of the last window, and of the last one that the weather was drawn for
        self._passed = kind.step
        shape = (n, kind.n_modes)
        self.frequency = np.sort(draw.uniform(1.0, 20.0, shape), axis=1)
        self.stated = draw.uniform(*kind.stated, shape)
        self.slope = kind.slope[0] + kind.slope[1] * draw.standard_normal(shape)
        self.inertia = draw.uniform(*kind.inertia_hours, n) * _HOUR
        self.frost = draw.uniform(*kind.frost, (n, 1)) * draw.uniform(0.5, 1.5, shape)
        self.load = kind.load * draw.uniform(0.5, 1.5, shape)
        self.start = np.full(n, _MIDSUMMER) if kind.summer_start else draw.uniform(0, 1, n)  # of a year
        self.hour = draw.integers(0, 24, n)  # of the day at which the record begins
        self.weekday = draw.integers(0, 7, n)
        self.mean, self.swing = draw.uniform(5, 12, n), draw.uniform(8, 13, n)
        self.daily = draw.uniform(3, 7, n)
        self.rms = 10 ** draw.uniform(-4, -2, n)
        self.loudness = draw.uniform(1.0, 2.0, n)  # power of the wind that the RMS follows
        self.change = np.zeros(shape)
        self._wrong = np.zeros((n, kind.n_modes))  # present offset of a mode's wrong pole
        self._silent = np.zeros(n, dtype=np.int64)  # windows left of an outage
        for name in ("front", "cloud", "wind"):
            self._state[name] = draw.standard_normal(n)
        self._state["error"] = draw.standard_normal(shape)
        self._state["core"] = self._state["lag"] = self._climate(0.0)

    def windows(self, n_windows: int) -> SiteWindows:
        """Return the next windows, the missing ones skipped."""
        slots = self._next_slots(n_windows)
        parts = [self._window(slot) for slot in slots]
        time = slots.astype(np.float64) * self.kind.step
        stacked = [np.stack(part, axis=1) for part in zip(*parts, strict=True)]
        log, std, rms, reading, air, core, scatter, wrong, silent = stacked
        return SiteWindows(
            time=time,
            frequency=self.frequency[:, None, :] * np.exp(log),
            frequency_std=self.frequency[:, None, :] * np.exp(log) * std,
            rms=rms,
            temperature=reading,
            air=air,
            structure=core,
            scatter=scatter,
            change=self.change.copy(),
            wrong=wrong,
            silent=silent,
        )

    def damage(self, size: float) -> None:
        """Lower all frequencies from now on by about that share, each by half to one and a half of it."""
        self.change = -size * self.random.uniform(0.5, 1.5, self.change.shape)

    def _next_slots(self, n: int) -> npt.NDArray[np.int64]:
        """Return the numbers of the next windows that exist: gaps have two windows to twice the mean."""
        slots: list[int] = []
        while len(slots) < n:
            self._slot += 1
            if self._gaps.random() < self.kind.missing / (1 - self.kind.missing) / _GAP and self._slot > 1:
                self._slot += int(self._gaps.integers(2, 2 * _GAP - 1))
            slots.append(self._slot)
        return np.array(slots)

    def _climate(self, time: float) -> FloatArray:
        summer = -np.cos(2 * np.pi * (self.start + time / _YEAR))
        daily = self.daily * (1 + 0.3 * summer) * -np.cos(2 * np.pi * (time / _DAY + (self.hour - 3) / 24))
        return np.asarray(self.mean + self.swing * summer + daily * np.clip(1 - 0.5 * self._state["cloud"], 0.1, 2))

    def _wander(self, name: str, hours: float) -> FloatArray:
        kept = np.exp(-self._passed / (hours * _HOUR))
        new = self.random.standard_normal(self._state[name].shape)
        self._state[name] = kept * self._state[name] + np.sqrt(1 - kept**2) * new
        return self._state[name]

    def _follow(self, name: str, towards: FloatArray, seconds: FloatArray | float) -> FloatArray:
        share = -np.expm1(-self._passed / np.asarray(seconds))
        self._state[name] = self._state[name] + share * (towards - self._state[name])
        return self._state[name]

    def _window(self, slot: int) -> tuple[FloatArray | BoolArray, ...]:
        """Return one window of all sites; long gaps are lived through in steps of one window."""
        kind, n = self.kind, self.n_sites
        for between in range(self._lived + 1, slot):
            self._weather(between * kind.step)
        self._lived = slot
        time = slot * kind.step
        air, core, sun = self._weather(time)
        hour = (time / _HOUR + self.hour) % 24
        day = (self.weekday + (time / _HOUR + self.hour) // 24) % 7
        busy = ((day < 5) & (hour > 6) & (hour < 20)) * np.sin(np.pi * np.clip((hour - 6) / 14, 0, 1))
        speed = 1 / (1 + np.exp(-1.7 * self._wander("wind", 12.0)))  # 0 to 1, nearly uniform
        scatter = kind.wind**speed
        frozen = np.clip(-core / 3.0, 0.0, 1.0)
        log = self.slope * (core - 15)[:, None] + self.load * busy[:, None] + self.frost * frozen[:, None]
        log = log + kind.drift * time / _YEAR + self.change
        error = np.sqrt(1 - kind.correlated) * self.random.standard_normal(log.shape)
        error += np.sqrt(kind.correlated) * self._wander("error", 2.0)
        log = log + self.stated * scatter[:, None] * error
        self._wrong_poles()
        wrong = self._wrong != 0
        log = np.where(wrong, log + self._wrong + self.stated * self.random.standard_normal(log.shape), log)
        seen = self.random.random(log.shape) > kind.absent_modes
        std = self.stated * self.random.lognormal(0.0, 0.15, log.shape)
        std = std * scatter[:, None] if kind.wind_stated else std
        rms = self.rms * 10 ** (speed * self.loudness / 2) * (1 + 0.5 * busy) * self.random.lognormal(0.0, 0.1, n)
        reading, silent = self._reading(air, sun)
        there = np.where(seen, 1.0, np.nan)
        return log * there, std * there, rms, reading, air, core, scatter, wrong, silent

    def _weather(self, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        self._wander("cloud", 20.0)
        air = self._climate(time) + 3.5 * self._wander("front", 70.0)
        hour = (time / _HOUR + self.hour) % 24
        sun = np.maximum(np.sin(np.pi * (hour - 6) / 12), 0.0) * np.clip(1 - 0.5 * self._state["cloud"], 0.1, 2)
        core = self._follow("core", air, self.inertia)
        self._follow("lag", air, 3 * _HOUR)
        return air, core, sun

    def _wrong_poles(self) -> None:
        kind, (n, p) = self.kind, self._wrong.shape
        self._wrong[self.random.random(n) < 1 / kind.burst] = 0.0
        starts = np.flatnonzero((self.random.random(n) < kind.outliers / kind.burst) & ~self._wrong.any(1))
        size = self.random.uniform(0.004, 0.03, len(starts)) * self.random.choice([-1, 1], len(starts))
        self._wrong[starts, self.random.integers(0, p, len(starts))] = size

    def _reading(self, air: FloatArray, sun: FloatArray) -> tuple[FloatArray, BoolArray]:
        kind, n = self.kind, self.n_sites
        begins = (self.random.random(n) < kind.silent_per_year * kind.step / _YEAR) & (self._silent == 0)
        self._silent = np.where(begins, round(6 * _HOUR / kind.step), np.maximum(self._silent - 1, 0))
        silent = (self._silent > 0) | (kind.thermometer == "absent")
        value = {"late": self._state["lag"], "badly placed": 1.2 * air - 2 + 8 * sun}.get(kind.thermometer, air)
        return np.where(silent, np.nan, value + 0.1 * self.random.standard_normal(n)), silent

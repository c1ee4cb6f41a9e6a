"""Self-test: probability that a simulated mass raises the alarm.

Nothing of it reaches the watch itself: the test judges by copies of the detectors and of the alarm.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from monitor.analysis.window import Window
from monitor.detection.alarm import Alarm
from monitor.results.windows import SelfTestResult
from monitor.settings import Settings
from monitor.watch.baseline.learned_baseline import LearnedBaseline
from monitor.watch.detector import Detector
from oma import ModalEstimate
from updater import Reference

DRAWS = 24  #: places that a mass is tried at
WITHIN = 6  #: windows within which it must be noticed: with small changes the quick average detects it
_DAY = 86400e9  # ns
_DAYS_AFTER_FAILURE = 1.0
_PASSED = 0.5  # share of places at which the alarm must be raised: at a support no mass is detectable


@dataclass(frozen=True, kw_only=True)
class Tested:
    """State of the self-tests."""

    last: int | None  #: when one was [ns UTC]
    passed: int | None  #: when one has passed [ns UTC]

    @property
    def failed(self) -> bool:
        """True if the last one has failed."""
        return self.passed != self.last


NEVER_TESTED = Tested(last=None, passed=None)


class SelfTests:
    """Tests a watch now and then, while all is calm.

    Parameters
    ----------
    settings : of the site
    state : of tests before
    """

    def __init__(self, settings: Settings, state: Tested) -> None:
        self._settings, self.state = settings, state
        self._recent: deque[Window] = deque(maxlen=max(WITHIN, settings.alarm.hold_windows))

    def after(self, learned: LearnedBaseline, alarm: Alarm, window: Window, *, over: bool) -> Iterator[SelfTestResult]:
        """Take one more window, over the limit or calm; yield a test if one is due. Without a model none is."""
        if over:
            self.forget()
            return
        self._recent.append(window)
        days = self._settings.alarm.self_test_days
        if self.state.failed:  # one bad day should not mark the site as faulty until the next is due
            days = min(days, _DAYS_AFTER_FAILURE)
        since = learned.learnt if self.state.last is None else self.state.last
        due = days > 0 and abs(window.end - since) >= days * _DAY  # a clock that is set back by years ends no tests
        if due and learned.model and alarm.condition == "normal" and len(self._recent) == self._recent.maxlen:
            self.state = replace(self.state, last=window.end)  # also of one that ends in an error
            windows, reference = tuple(self._recent), learned.model.reference
            result = self_test(learned, reference, alarm, windows, self._settings, window.end, self.state.passed)
            self.state = replace(self.state, passed=result.last_passed)
            yield result

    @property
    def recent(self) -> tuple[Window, ...]:
        """Calm windows without a break, the newest."""
        return tuple(self._recent)

    def restore(self, recent: Sequence[Window]) -> None:
        """Continue with calm windows of before."""
        self._recent.extend(recent)

    def forget(self) -> None:
        """Wait for calm windows without a break: of another reference, or after one over the limit."""
        self._recent.clear()


def self_test(
    learned: LearnedBaseline,
    reference: Reference,
    alarm: Alarm,
    windows: Sequence[Window],
    settings: Settings,
    time: int,
    last_passed: int | None,
) -> SelfTestResult:
    """Return at how many random places a mass would raise the alarm within `WITHIN` windows.

    Parameters
    ----------
    learned, alarm : as they are; they stay so
    reference : model of the structure, that the mass is put onto
    windows : the newest calm ones, `WITHIN` or as many as raise an alarm
    settings : of the site
    time : of the test [ns UTC]; the places are drawn by it, so that a replay draws the same
    last_passed : when a test has last passed [ns UTC]
    """
    random = np.random.default_rng(time // 10**9)
    mass = settings.alarm.self_test_percent / 100 * reference.model.total_mass()
    ratios = with_mass(reference, _places(reference, random, DRAWS), mass)
    found = sum(_raises(learned, alarm, _changed(windows, ratio, learned, settings), settings) for ratio in ratios)
    passed = found >= _PASSED * DRAWS
    return SelfTestResult(
        time=time,
        mass=mass,
        places=DRAWS,
        detected=found,
        passed=passed,
        last_passed=time if passed else last_passed,
    )


def with_mass(reference: Reference, places: FloatArray, mass: float) -> FloatArray:
    """Return the ratios (n, n_tracks) of the reference's frequencies with a mass at each place to those without.

    In mass-normalised modes the mass adds m Phi^T Phi to their unit masses, Phi being the translations there; of the
    changed modes, the one that has most of a mode is its successor.

    Parameters
    ----------
    reference : that the mass is put onto
    places : (n, 3) points on members [m]
    mass : [kg]
    """
    rows = reference.model.reader(places).toarray().reshape(len(places), 6, -1)[:, :3]
    motion = rows @ reference.shape
    stiffness = (2 * np.pi * reference.frequency) ** 2
    root = 1 / np.sqrt(stiffness)
    inertia = np.eye(len(stiffness)) + mass * np.swapaxes(motion, 1, 2) @ motion
    value, vector = np.linalg.eigh(root[:, None] * inertia * root)  # of 1 / omega'^2
    most = np.abs(vector[:, reference.paired]).argmax(2)
    return np.asarray(
        1 / np.sqrt(np.take_along_axis(value, most, 1)) / (2 * np.pi * reference.frequency[reference.paired])
    )


def _places(reference: Reference, random: np.random.Generator, n: int) -> FloatArray:
    """Return points (n, 3) on members, as likely on one metre as on any other [m]."""
    members = reference.structure.member
    length = np.array([member.length for member in members])
    chosen = random.choice(len(members), n, p=length / length.sum())
    return np.array([members[k].point(share * length[k]) for k, share in zip(chosen, random.random(n), strict=True)])


def _changed(
    windows: Sequence[Window], ratio: FloatArray, learned: LearnedBaseline, settings: Settings
) -> list[Window]:
    """Return the windows as the next ones, their tracked frequencies changed by a ratio (n_tracks,)."""
    later = round(len(windows) * settings.step_seconds * 1e9)
    return [
        replace(w, start=w.start + later, end=w.end + later, synchronized=_with_ratio(w.synchronized, ratio, learned))
        for w in windows
    ]


def _with_ratio(estimate: ModalEstimate, ratio: FloatArray, learned: LearnedBaseline) -> ModalEstimate:
    track = learned.modes_of(estimate)
    frequency = estimate.frequency.copy()
    frequency[track[track >= 0]] *= ratio[track >= 0]
    return replace(estimate, frequency=frequency)


def _raises(learned: LearnedBaseline, alarm: Alarm, windows: Sequence[Window], settings: Settings) -> bool:
    """Return whether copies of detector and alarm raise it by these windows."""
    tried = replace(learned, detector=Detector(learned.detector.state, settings))
    for window in windows:
        score = tried.judge(window)
        alarm, _ = alarm.evaluate(window.end, score.level)
        if alarm.state == "alarm":
            return True
    return False

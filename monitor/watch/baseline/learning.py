"""Learning of a baseline: windows are collected until it is long enough and of one state."""

import numpy as np

from monitor.analysis.window import Window
from monitor.results.windows import LearningProgress
from monitor.settings import Settings
from monitor.text.detectability import NO_THERMOMETER
from monitor.watch.baseline.checks import (
    MAX_RESTARTS,
    baseline_shortcomings,
    change_in_baseline,
    extended_text,
    longer_baseline,
    too_short_text,
)
from monitor.watch.baseline.learned_baseline import LearnedBaseline, learn_baseline
from monitor.watch.memory import Memory
from updater import Structure, UpdaterError


class BaselineLearning:
    """Windows from which a baseline will be learned.

    Parameters
    ----------
    structure, settings : of the site; None for one without a structure file
    memory : state of the run before, if its baseline is to be continued
    """

    def __init__(self, structure: Structure | None, settings: Settings, memory: Memory | None = None) -> None:
        self._structure, self._settings = structure, settings
        self._first = settings.analysis.first_windows
        self.windows: list[Window] = []
        self.target = self._first  #: number of windows to learn from
        self.restarts = 0  #: because the structure changed within the baseline
        if memory is not None and memory.detector is None:
            self.windows, self.restarts = list(memory.baseline), memory.restarts
            self.target = max(self.target, min(memory.target, settings.analysis.most_windows))

    @property
    def progress(self) -> LearningProgress:
        """Progress with the next window."""
        return LearningProgress(windows=len(self.windows) + 1, target=self.target)

    def add(self, window: Window) -> tuple[LearnedBaseline | None, str]:
        """Take a window; return the baseline once it is learned, and a message, empty if there is none."""
        self.windows.append(window)
        if len(self.windows) < self.target:
            return None, ""
        try:
            learned = learn_baseline(self._structure, self.windows, self._settings)
        except (UpdaterError, np.linalg.LinAlgError) as error:
            self.windows.pop(0)  # learning continues: the oldest window makes room
            return None, str(error)
        change = change_in_baseline(learned.baseline, learned.modes.windows)
        if change and self.restarts < MAX_RESTARTS:
            self.restarts += 1
            self.windows, self.target = self.windows[change[0] :], self._first
            return None, change[1]
        n = len(learned.baseline)
        lacking = baseline_shortcomings(learned.baseline, learned.modes.windows, self._settings.step_seconds)
        longer = longer_baseline(n, lacking, self._settings.analysis.most_windows)
        if longer > n and not change:
            is_first, self.target = self.target == self._first, longer
            return None, extended_text(n, lacking, longer, self._settings) if is_first else ""
        self.windows, self.restarts = [], 0
        text = f"baseline learnt from {n} windows"
        text += f", though {change[1].partition(';')[0]}" if change else ""
        text += f"; {too_short_text(lacking)}" if lacking else ""
        return learned, text if learned.detector.has_thermometer else f"{text}; {NO_THERMOMETER}"

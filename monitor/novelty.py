"""How far one window after the other lies from the baseline: the live side of `monitor.detection`."""

from collections.abc import Sequence

import numpy as np

from daq import IndexArray, Recording
from monitor.detection import CHUNK, DETECTORS, GUARD, Judged, Watching, accept, judge, start
from monitor.results import DetectorFigure, Novelty
from monitor.settings import Settings
from oma import ModalEstimate
from updater import TrackedModes, stack_tracks

_YEAR = 365.25 * 86400  # s


class Detector:
    """Judges windows in their order, and goes on learning from those that stayed calm.

    Parameters
    ----------
    modes : the baseline's
    recordings : the windows that they come from
    settings : of the site
    """

    def __init__(self, modes: TrackedModes, recordings: Sequence[Recording], settings: Settings) -> None:
        self._step = settings.step_seconds
        self._per_year = settings.alarm.false_alarms_per_year / len(DETECTORS)
        watching = Watching(
            rate=self._per_year * self._step / _YEAR,
            overlap=settings.analysis.overlap,
            hold=settings.alarm.hold_windows,
        )
        starts = np.array([recording.start for recording in recordings])
        self._watched = start(
            modes.log_frequency,
            modes.log_frequency_std,
            np.array([recording.temperature for recording in recordings]),
            np.diff(starts / 1e9, prepend=starts[0] / 1e9 - self._step),
            watching,
        )
        self._before = int(starts[-1])
        self._calm: list[Judged] = []  # not learnt from yet

    def consider(self, recording: Recording, estimate: ModalEstimate, track: IndexArray) -> Novelty:
        """Judge one window, whose modes `track` (n_tracks,) gives the tracks of; -1 where one is missing."""
        modes = stack_tracks([estimate], [track])
        seconds = np.array([(recording.start - self._before) / 1e9])
        temperature = np.array([recording.temperature])
        judged, self._watched = judge(self._watched, modes.log_frequency, temperature, seconds)
        self._before = recording.start
        self._calm.append(judged)
        return self._said(judged, np.flatnonzero(track >= 0))

    def _said(self, judged: Judged, seen: IndexArray) -> Novelty:
        figures = [
            DetectorFigure(detector=name, value=float(value), limit=float(limit), false_alarms_per_year=self._per_year)
            for name, value, limit in zip(DETECTORS, judged.value[:, 0], judged.limit[:, 0], strict=True)
        ]
        first = max(figures, key=lambda figure: figure.value / figure.limit)
        return Novelty(t2=first.value, limit=first.limit, modes=(seen + 1).tolist(), detectors=figures)

    def settle(self, *, calm: bool) -> None:
        """Learn from windows that have been followed by enough calm ones; forget those that have not been."""
        if not calm:
            self._calm = []
        elif len(self._calm) >= GUARD + CHUNK:
            chunk, self._calm = self._calm[:CHUNK], self._calm[CHUNK:]
            known = np.concatenate([j.terms for j in chunk])
            self._watched = accept(self._watched, known, np.concatenate([j.whitened for j in chunk]))

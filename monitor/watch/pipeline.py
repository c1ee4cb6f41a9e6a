"""From blocks to results: a deterministic function of the log, the same live and in replay."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from daq import Assembler, Block, Event, FloatArray, Recording
from monitor.analysis.temperature import SiteTemperature
from monitor.analysis.window import window_of
from monitor.results.convert import spectrum_result
from monitor.results.windows import Result, WindowResult
from monitor.settings import Settings
from monitor.watch.backlog import SKIPPED, Skip, none
from monitor.watch.memory import Memory
from monitor.watch.window_evaluator import WindowEvaluator
from oma import IdentificationError, identify_all
from updater import Structure


class Pipeline:
    """The monitoring loop without clocks, ports and files.

    Parameters
    ----------
    structure : of the site
    settings : of the site
    memory : state of the run before, to be continued; it must belong to the same baseline (see `recall`)
    skip : decides which windows are left out
    """

    def __init__(
        self, structure: Structure, settings: Settings, memory: Memory | None = None, skip: Skip = none
    ) -> None:
        analysis = settings.analysis
        self._settings, self._structure, self._skip = settings, structure, skip
        self._assembler = Assembler(
            settings.channels,
            {device.name: device.rate for device in settings.device},
            window_seconds=analysis.window_seconds,
            step_seconds=settings.step_seconds,
        )
        offset = memory.thermometer_offset if memory else math.nan
        self._weather = SiteTemperature(settings.temperature.stale_minutes, offset) if settings.temperature else None
        self._judge = WindowEvaluator(structure, settings, memory)
        self._resumed = memory is not None  # not reported yet

    @property
    def memory(self) -> Memory:
        """State to continue from after a restart."""
        memory = self._judge.memory
        return replace(memory, thermometer_offset=self._weather.offset) if self._weather else memory

    def push(self, item: Block | Event) -> Iterator[Result]:
        """Process one item in the log's order; yield the results."""
        if self._resumed and isinstance(item, Block):
            self._resumed = False
            yield from self._judge.resumed(item.arrival_time)
        if isinstance(item, Event):
            yield from self._judge.apply_command(item)
        windows = self._assembler.push(item) if isinstance(item, Block) else self._assembler.push_event(item)
        if self._weather and isinstance(item, Event):
            self._weather.take(item)
        for recording in windows:
            weather = self._weather
            yield from self.analyse(replace(recording, temperature=weather.of(recording)) if weather else recording)

    def analyse(self, recording: Recording) -> Iterator[Result]:
        """Analyse one window; yield the results."""
        index = self._judge.n_windows
        self._judge.n_windows += 1
        if self._skip(index, recording):
            yield self._bare(index, recording, SKIPPED).model_copy(update={"skipped": True})
            return
        try:
            found = identify_all(recording, band=self._settings.analysis.band).without_uncertain()
        except IdentificationError as error:
            yield self._bare(index, recording, str(error))
            return
        window = window_of(
            index, recording, found, self._settings.device_of, self._structure.delays, self._judge.delays
        )
        seen = {
            "channels": list(window.synchronized.channels),
            "faults": {channel: str(fault) for channel, fault in found.left_out.items()},
            "modes": self._judge.modes(window),
            "spectrum": spectrum_result(recording, found.poles),
            "problem": None,
        }
        yield from self._judge.evaluate(window, self._bare(index, recording, "").model_copy(update=seen))

    def _bare(self, index: int, recording: Recording, problem: str) -> WindowResult:
        return WindowResult(
            index=index,
            start=recording.start,
            end=recording.end,
            phase=self._judge.phase,
            channels=[channel.name for channel in recording.channels],
            modes=[],
            rms=_rms(recording),
            problem=problem,
        )


def _rms(recording: Recording) -> dict[str, float]:
    power: FloatArray = np.nanmean(np.where(np.isfinite(recording.data).any(0), recording.data, 0.0) ** 2, axis=0)
    return {c.name: float(np.sqrt(p)) for c, p in zip(recording.channels, power, strict=True)}

"""From blocks to results: a deterministic function of the log, the same live and in replay."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from daq import Assembler, Block, Event, Recording
from monitor.analysis.temperature import SiteTemperature
from monitor.analysis.window import IdentifiedWindow, RecordedWindow, identify_window, signals_of, window_of
from monitor.results.windows import Result, WindowResult
from monitor.settings import Settings
from monitor.watch.backlog import SKIPPED, Skip, none
from monitor.watch.memory import Memory, MidLogState
from monitor.watch.window_evaluator import WindowEvaluator
from updater import Reference, Structure


def assembler_of(settings: Settings) -> Assembler:
    """Return the assembler that cuts a site's streams into windows."""
    return Assembler(
        settings.channels,
        {device.name: device.rate for device in settings.device},
        window_seconds=settings.analysis.window_seconds,
        step_seconds=settings.step_seconds,
    )


class Pipeline:
    """The monitoring loop without clocks, ports and files.

    Parameters
    ----------
    structure : of the site; None if it has none: modes are watched without a model
    settings : of the site
    memory : state of the run before, to be continued; it must belong to the same baseline (see `recall`)
    skip : decides which windows are left out
    on_window : called before each window is identified
    """

    def __init__(
        self,
        structure: Structure | None,
        settings: Settings,
        memory: Memory | None = None,
        skip: Skip = none,
        on_window: Callable[[Recording], None] = lambda _: None,
    ) -> None:
        self._settings, self._skip, self._on_window = settings, skip, on_window
        self._late = structure.delays if structure else {}
        self._assembler = assembler_of(settings)
        self._weather = self._thermometer(memory.thermometer_offset if memory else math.nan)
        self._judge = WindowEvaluator(structure, settings, memory)
        self._resumed = memory is not None  # not reported yet

    @property
    def memory(self) -> Memory:
        """State to continue from after a restart."""
        memory = self._judge.memory
        return replace(memory, thermometer_offset=self._weather.offset) if self._weather else memory

    @property
    def reference(self) -> Reference | None:
        """Reference of the baseline; None before it is learned, and without a model."""
        return self._judge.reference

    def push(self, item: Block | Event) -> Iterator[Result]:
        """Process one item in the log's order; yield the results."""
        if isinstance(item, Block):
            yield from self.resume(item.arrival_time)
        if isinstance(item, Event):
            yield from self._judge.apply_command(item)
        windows = self._assembler.push(item) if isinstance(item, Block) else self._assembler.push_event(item)
        if self._weather and isinstance(item, Event):
            self._weather.take(item)
        for recording in windows:
            yield from self.analyse(recording)

    def push_identified(self, step: Event | IdentifiedWindow) -> Iterator[Result]:
        """Process an event, or a window that was identified elsewhere, in the log's order; yield the results."""
        if isinstance(step, IdentifiedWindow):
            yield from self._next(step.recorded, step)
            return
        yield from self._judge.apply_command(step)
        if self._weather:
            self._weather.take(step)

    def begin_log(self) -> None:
        """Continue in another log, as a new pipeline does from the saved state of this one."""
        self._assembler = assembler_of(self._settings)
        if self._weather:
            self._weather = self._thermometer(self._weather.offset)
        self._judge.begin_log()
        self._resumed = True

    @property
    def mid_log(self) -> MidLogState:
        """State to continue from in the middle of a log, in addition to `memory`; without signals."""
        readings = self._weather.readings if self._weather else ()
        return replace(self._judge.mid_log, unreported=self._resumed, readings=readings)

    def continue_log(self, state: MidLogState) -> None:
        """Continue in the middle of a log; for a new pipeline, made with the memory there.

        Windows and events are taken by `push_identified` alone from here on: blocks are not part of the state.
        """
        self._resumed = state.unreported
        self._judge.continue_log(state)
        if self._weather:
            self._weather.restore(state.readings)

    def _thermometer(self, offset: float) -> SiteTemperature | None:
        temperature = self._settings.temperature
        return SiteTemperature(temperature.stale_minutes, offset) if temperature else None

    def resume(self, time: int) -> Iterator[Result]:
        """Report the continued reference at the first block of a log [ns UTC], if there is one."""
        if self._resumed:
            self._resumed = False
            yield from self._judge.resumed(time)

    def analyse(self, recording: Recording) -> Iterator[Result]:
        """Analyse one window; yield the results."""
        if self._skip(self._judge.n_windows, recording.end):
            yield from self._next(RecordedWindow.of(recording), None)
        else:
            self._on_window(recording)
            window = identify_window(recording, self._settings.analysis.band)
            yield from self._next(window.recorded, window)

    def _next(self, recorded: RecordedWindow, window: IdentifiedWindow | None) -> Iterator[Result]:
        """Evaluate the next window; None for one that is left out."""
        index = self._judge.n_windows
        self._judge.n_windows += 1
        temperature = self._weather.of(recorded) if self._weather else recorded.temperature
        if window is None or window.modes is None:
            bare = self._bare(index, recorded, window.problem if window else SKIPPED)
            yield bare if window else bare.model_copy(update={"skipped": True})
            return
        known = self._judge.delays
        kept = window_of(index, recorded, window.modes, temperature, self._settings.device_of, self._late, known)
        seen = {
            "channels": list(kept.synchronized.channels),
            "faults": {channel: str(fault) for channel, fault in window.modes.left_out.items()},
            "modes": self._judge.modes(kept),
            "spectrum": window.spectrum,
            "problem": None,
        }
        signals = partial(signals_of, kept, window.signals, self._late) if window.signals else None
        yield from self._judge.evaluate(kept, self._bare(index, recorded, "").model_copy(update=seen), signals)

    def _bare(self, index: int, recorded: RecordedWindow, problem: str) -> WindowResult:
        return WindowResult(
            index=index,
            start=recorded.start,
            end=recorded.end,
            phase=self._judge.phase,
            channels=list(recorded.channels),
            modes=[],
            rms=dict(recorded.rms),
            problem=problem,
        )

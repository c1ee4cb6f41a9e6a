"""Pairs of log and analysis, replaced without loss of data."""

import math
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

from daq import Event, HostClock, Item
from daq.events import DeviceFailed, EventPayload
from daq.log import (
    CHANNELS,
    ChannelMap,
    DiskGuard,
    ResilientWriter,
    Retention,
    RotatingWriter,
    Rotation,
    WriterThread,
)
from daq.supervision import FAILURES, Backoff
from monitor.errors import StartError
from monitor.results.service_events import AnalysisFailed, AnalysisLagging, BaselineReset, Stopped
from monitor.results.windows import Result, result_event
from monitor.service.site import Site
from monitor.service.worker import AnalysisError, LiveState, SavedState, Worker, WorkerMessage
from monitor.settings import RecorderSettings, attached_structure
from monitor.watch import memory as saved
from monitor.watch.memory import MEMORY, LoadedState, MemoryFile

_BLOCK_SECONDS = 0.2  # of data in a block of a device
_MAX_WINDOWS, _MAX_SECONDS = 10.0, 600.0  # that may wait: windows, but seconds of wall time at least


@dataclass(frozen=True, eq=False, kw_only=True)
class Analysis:
    """Both, not started yet: data wait until the worker is ready."""

    keeper: ResilientWriter
    worker: Worker


def new_analysis(site: Site, clock: HostClock, tell: Callable[[Event], None], memory: str) -> Analysis:
    """Begin a log, with all attachments for a replay, and its analysis.

    Parameters
    ----------
    site : that is watched
    clock : of the data
    tell : called with events of the disk, in the log's thread
    memory : text of the state to be continued; empty for none

    Raises
    ------
    LogError
        If the log cannot be made.
    """
    recorder_settings = site.settings.recorder
    folder = logs_of(site)
    folder.mkdir(parents=True, exist_ok=True)
    attachments = {
        **site.attachments,
        CHANNELS: ChannelMap(channels=site.settings.channels, on_grid=False).to_json(),
    }
    if memory:
        attachments[MEMORY] = memory
    recorder = RotatingWriter(
        folder,
        attachments,
        clock.now(),
        Rotation(size=recorder_settings.rotate_mb * 1e6, seconds=recorder_settings.rotate_minutes * 60),
        view_rate=recorder_settings.view_rate,
    )
    return Analysis(
        keeper=ResilientWriter(recorder, DiskGuard(folder, _retention(recorder_settings)), tell),
        worker=Worker(site.structure_text, site.site_text, memory),
    )


def logs_of(site: Site) -> Path:
    """Return the folder of a site's logs."""
    return site.folder / site.settings.recorder.folder


def prepare_logs(site: Site) -> None:
    """Make the folder of a site's logs if need be, and try whether files can be made there.

    Raises
    ------
    StartError
        If not.
    """
    folder = logs_of(site)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        raise StartError(f"recorder.folder: expected a writable folder: {error}") from error


def blocks_a_second(site: Site) -> float:
    """Return how many blocks come from all devices, a second of data."""
    return len(site.settings.device) / _BLOCK_SECONDS


def most_waiting(site: Site) -> float:
    """Return how many items may wait for the analysis before it will never catch up: so many windows, but minutes."""
    clock = site.settings.clock
    least = _MAX_SECONDS * (clock.speed if clock else 1.0)
    return blocks_a_second(site) * max(_MAX_WINDOWS * site.settings.step_seconds, least)


def analysed_alike(one: Site, other: Site) -> bool:
    """Return whether two sites' settings have the same log and analysis."""
    return _key(one) == _key(other)


def _key(site: Site) -> tuple[object, ...]:
    settings = site.settings
    devices = tuple((device.name, device.driver, device.rate, device.channels) for device in settings.device)
    return site.structure_text, settings.recorder, settings.analysis, settings.alarm, settings.temperature, devices


def _retention(recorder: RecorderSettings) -> Retention:
    return Retention(
        seconds=(recorder.keep_days or math.inf) * 86400,
        size=(recorder.keep_gb or math.inf) * 1e9,
        least_free=recorder.min_free_gb * 1e9,
    )


_POLL = 0.2  # s
_LAST_SECONDS = 80.0  # that a stop waits for the analysis; systemd kills after 90, see unit_file.py
_LAST_RESULTS_SECONDS = 20.0  # longest wait for those of a replaced analysis: the watchdog is fed every 15 s
_RESTART_FIRST, _RESTART_LONGEST = 1.0, 600.0  # s until a dead analysis is restarted; doubled each time


@dataclass(frozen=True, kw_only=True)
class FinishedLog:
    """Contents of a log that is closed; its keeper holds all that was written in front of each file."""

    paths: tuple[Path, ...]
    problem: str | None


class LogAndAnalysis:
    """The log that is written and the analysis that is fed now, and all before them.

    All methods but `put`, `say` and `_take` are for one thread.

    Parameters
    ----------
    site : that is watched; another one may take its place
    clock : of the data
    on_result : called with everything that is found
    on_state : called with the residuals and innovations of blocks, which are not logged
    hand_on : called in the log's thread with all that is logged
    lost : returns the lost devices, for each new log
    recalled : state of the run before, to be continued
    """

    def __init__(
        self,
        site: Site,
        clock: HostClock,
        on_result: Callable[[Result], None],
        on_state: Callable[[LiveState], None],
        hand_on: Callable[[Item], None],
        lost: Callable[[], list[str]],
        recalled: LoadedState,
    ) -> None:
        self.site, self._clock, self._on_result, self._hand_on, self._lost = site, clock, on_result, hand_on, lost
        self._on_state = on_state
        self._refused, self._kept = recalled.refused, recalled.text or ""  # present state to be continued
        self._memory = MemoryFile(site.state / MEMORY)
        self._analysis = new_analysis(site, clock, self._take, self._kept)
        self._worker: Worker | None = self._analysis.worker  # that the log's thread feeds
        self._logs: list[ResilientWriter | FinishedLog] = [self._analysis.keeper]  # all so far
        seconds = site.settings.recorder.chunk_seconds
        self._log = WriterThread(self._analysis.keeper, self._take, chunk_seconds=seconds)
        self._restart_at, self._backoff = 0.0, Backoff(_RESTART_FIRST, _RESTART_LONGEST)

    def __enter__(self) -> Self:
        """Start to write and to analyse."""
        with ExitStack() as stack:
            stack.callback(lambda: self._analysis.worker.__exit__())
            self._analysis.worker.__enter__()
            stack.enter_context(self._memory)
            stack.enter_context(self._log)
            self._report_refusal()
            self._undo = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """End everything that is still running."""
        self._undo.close()

    def put(self, item: Item) -> None:
        """Have something logged, and analysed; never waits."""
        self._log.put(item)

    def report(self, payload: EventPayload) -> None:
        """Have an event logged that happens now."""
        self._log.put(payload.event(self._clock.now()))

    def poll(self) -> None:
        """Log and pass on results, for a moment; restart parts that have died or cannot catch up."""
        self._report()
        if self._restart_at and time.monotonic() >= self._restart_at:
            self.renew("the analysis had died")
        waiting = self._worker.waiting if self._worker else 0
        if waiting > most_waiting(self.site):
            self._report_lag(waiting)
            self._report_stop(why="the analysis was behind")
            self._worker = None
            self.renew("the analysis was behind")

    def renew(self, why: str) -> None:
        """Begin a new log and analysis amid the stream: each item goes into one of the logs, none into both.

        Data that arrive during the last results of the old analysis are in the old log, and are not analysed.
        """
        old = self._analysis
        if self._worker is not None:
            self._report_stop(why=why)
            self._await_results(_LAST_RESULTS_SECONDS)
        try:
            new = new_analysis(self.site, self._clock, self._take, self._remembered())
        except Exception as error:  # noqa: BLE001 - whatever it is, recording goes on
            self._continue_without_analysis(error)
            return
        self._analysis, self._restart_at = new, 0.0
        self._logs.append(new.keeper)
        self._log.switch(new.keeper, partial(self._switch_analysis, old.keeper, new))
        FAILURES.attempt("analysis", new.worker.__enter__)  # one that does not start is found dead
        FAILURES.attempt("analysis", old.worker.__exit__)
        self._report_refusal()
        for name in self._lost():
            self.report(DeviceFailed(device=name, why="it was lost before"))

    def finish(self) -> None:
        """Log the received data, and analyse them as far as possible in a while: service managers do not wait."""
        self._report_stop()
        self._await_results(_LAST_SECONDS)

    @property
    def learnt(self) -> bool:
        """True if there is anything to continue from."""
        return bool(self._kept)

    @property
    def files(self) -> tuple[Path, ...]:
        """All logs, in the order of writing."""
        return tuple(path for log in self._logs for path in log.paths)

    @property
    def dropped(self) -> int:
        """Items that the log's queue had no room for."""
        return self._log.dropped

    @property
    def turned(self) -> float:
        """Time of the last completed write of the log's thread [s, monotonic]."""
        return self._log.turned

    @property
    def losing(self) -> bool:
        """True if data are being lost because the disk cannot be written."""
        return self._analysis.keeper.losing

    @property
    def disk_failure(self) -> str | None:
        """Data that are not in the logs, and the reason."""
        return "; ".join(filter(None, map(self._problem, self._logs))) or None

    @property
    def problems(self) -> dict[str, str | None]:
        """Problem of each part, None while it works."""
        return {
            "disk": self._problem(self._analysis.keeper),
            "memory": self._memory.problem,
            "analysis": None if self._worker else "its process has died; it is started again",
        }

    @property
    def waiting(self) -> dict[str, int]:
        """Items that wait for the log, and for the analysis."""
        return {"log": self._log.waiting, "analysis": self._worker.waiting if self._worker else 0}

    def _problem(self, log: ResilientWriter | FinishedLog) -> str | None:
        """Return which part is not logged, and why."""
        if isinstance(log, FinishedLog) or self._log.failure is None:
            return log.problem
        return "; ".join(filter(None, (log.problem, f"nothing more is written: {self._log.failure}")))

    def _await_results(self, seconds: float) -> None:
        """Wait for the last results of the analysis, for a limited time; the log states what it leaves out."""
        end = time.monotonic() + seconds
        while self._report():
            if time.monotonic() > end:
                self._report_lag(self._analysis.worker.waiting)
                return

    def _report_lag(self, waiting: int) -> None:
        self.report(AnalysisLagging(left_out_s=round(waiting / blocks_a_second(self.site), 1)))

    def _report_stop(self, why: str | None = None) -> None:
        self.report(Stopped(dropped=self._log.dropped, why=why))

    def _report_refusal(self) -> None:
        if self._refused:
            self.report(BaselineReset(why=self._refused))
            self._refused = None

    def _remembered(self) -> str:
        """Return the starting state of the new analysis: the saved one of the old analysis, as far as it is valid."""
        if not self._kept:
            return ""
        structure = attached_structure(self.site.structure_text)
        found = saved.check_saved_state(self._kept, "what was learned", structure, self.site.settings)
        self._refused, self._kept = found.refused, found.text or ""
        return self._kept

    def _switch_analysis(self, old: ResilientWriter, new: Analysis) -> None:
        """Feed the new analysis, the old log being closed; in the log's thread."""
        self._logs[self._logs.index(old)] = FinishedLog(paths=old.paths, problem=self._problem(old))
        self._worker = new.worker

    def _report(self) -> bool:
        """Log and pass on the results of the analysis; False once it has ended, or has died."""
        if self._worker is None:
            time.sleep(_POLL)
            return False
        try:
            for result in self._analysis.worker.results(_POLL):
                if result is None:
                    return False
                self._pass_on(result)
            self._memory.write()
        except AnalysisError as error:
            self._continue_without_analysis(error)
            return False
        return True

    def _pass_on(self, result: WorkerMessage) -> None:
        if isinstance(result, SavedState):
            self._memory.expect(result.text)
            self._kept = result.text
            return
        if isinstance(result, LiveState):
            self._on_state(result)
            return
        event = result_event(result)
        self._memory.after(event)
        self._log.put(event)
        self._on_result(result)
        self._backoff.reset()

    def _continue_without_analysis(self, error: Exception) -> None:
        """Continue without an analysis for a while: one that dies at once, again and again, must not fill the disk."""
        self._worker = None
        pause = self._backoff.next()
        self._restart_at = time.monotonic() + pause
        self.report(AnalysisFailed(why=str(error) or type(error).__name__, again_in_s=pause))

    def _take(self, item: Item) -> None:
        """Hand on an item once it is logged; in the log's thread."""
        if self._worker is not None:
            FAILURES.attempt("analysis", self._worker.feed, item)
        self._hand_on(item)
        FAILURES.attempt("memory", self._memory.take, item)

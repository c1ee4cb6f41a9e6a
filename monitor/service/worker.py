"""Analysis process, separate from acquisition."""

import multiprocessing
import os
import queue
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from multiprocessing.queues import Queue
from typing import TYPE_CHECKING, Protocol, Self

from daq import Block, Event, Item
from monitor.optional import run_optional
from monitor.results.innovations import ModeInnovations
from monitor.results.residuals import ChannelResiduals
from monitor.results.service_events import Stopped
from monitor.results.windows import Result
from monitor.service.processes import (
    LastWords,
    deaf_to_stop_signals,
    environment,
    handed_over,
    queue_to_child,
    received,
    report_end,
    trim_memory,
)

if TYPE_CHECKING:
    from monitor.watch.pipeline import Pipeline


_ENVIRONMENT = {  # of the process: one thread of BLAS, and glibc returns large blocks of memory at once
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": "1000000",
}


@dataclass(frozen=True)
class SavedState:
    """State to continue from after a restart, once the results before it are logged."""

    text: str


LiveState = ChannelResiduals | ModeInnovations  #: of a block of signals, which no log holds
WorkerMessage = Result | SavedState | LiveState


class AnalysisError(RuntimeError):
    """The analysis process ended by itself."""


class Worker:
    """The pipeline in a process of its own.

    Parameters
    ----------
    structure, site : texts of the structure's TOML, empty for none, and of the site's
    memory : text of the saved state to be continued; empty for none
    """

    def __init__(self, structure: str, site: str, memory: str = "") -> None:
        context = multiprocessing.get_context("spawn")
        self._inbox: Queue[Item] = queue_to_child()
        self._outbox: Queue[WorkerMessage | None] = context.Queue()
        self._newest = context.Value("q", 0)  # until when signals have come [ns UTC]
        task = _Task(structure, site, memory, self._newest)
        self._last_words = LastWords()
        arguments = self._last_words.sender, _analyse, task, self._inbox, self._outbox
        self._process = context.Process(target=report_end, args=arguments, name="analysis", daemon=True)

    def __enter__(self) -> Self:
        with environment(_ENVIRONMENT), deaf_to_stop_signals():  # one thread of BLAS: the same sums on every run
            self._process.start()
        self._last_words.started()
        handed_over(self._inbox)
        return self

    def __exit__(self, *_: object) -> None:
        """End the process if it has not ended by itself."""
        self._inbox.cancel_join_thread()
        self._process.kill()  # it does not react to SIGTERM
        self._process.join()

    @property
    def waiting(self) -> int:
        """Number of items that the analysis has not taken yet."""
        return self._inbox.qsize()

    def feed(self, item: Item) -> None:
        """Hand on an item, in the log's order; results are not analysed again."""
        if isinstance(item, Block):
            self._newest.value = max(self._newest.value, item.arrival_time)
        if isinstance(item, Block) or item.topic.startswith(("/event/", "/measured/")):
            self._inbox.put(item)

    def results(self, timeout: float) -> Iterator[WorkerMessage | None]:
        """Yield the results and memories that are there within `timeout` [s]; None is the last one.

        Raises
        ------
        AnalysisError
            If the process has ended without saying so.
        """
        try:
            yield self._outbox.get(timeout=timeout)
            while True:
                yield self._outbox.get_nowait()
        except queue.Empty:
            if self._outbox.empty():
                self._check_alive()

    def _check_alive(self) -> None:
        if not self._process.is_alive():
            raise AnalysisError(f"the analysis: {self._last_words.text(self._process)}") from None


class _Shared(Protocol):
    """A number that two processes see."""

    value: int


@dataclass(frozen=True)
class _Task:
    """Task of the process; fields as the parameters of `Worker`."""

    structure: str
    site: str
    memory: str
    newest: _Shared  #: time up to which signals have arrived [ns UTC]


def _analyse(task: _Task, inbox: "Queue[Item]", outbox: "Queue[WorkerMessage | None]") -> None:
    """Run the pipeline until the last item."""
    os.nice(5)  # acquisition comes first
    from monitor.watch.memory import memory_text  # loads numpy, in this process, under the limits above

    pipeline = _pipeline(task)
    live = _OptionalMonitors(_live_monitors(task, pipeline))
    for item in received(inbox):
        if isinstance(item, Event) and item.topic == Stopped.topic:
            outbox.put(None)
            return
        for state in live.push(item):
            outbox.put(state)
        reported = False
        for result in pipeline.push(item):
            outbox.put(result)
            live.take(result)
            reported = True
        if reported:
            outbox.put(SavedState(memory_text(pipeline.memory)))
            trim_memory()  # a window's work leaves pieces of many sizes, which would grow from window to window
    outbox.cancel_join_thread()  # the parent was killed: the remaining items will not be read


def _pipeline(task: _Task) -> "Pipeline":
    from monitor.settings import attached_structure, parse_attached
    from monitor.watch.backlog import Backlog
    from monitor.watch.memory import parse_memory
    from monitor.watch.pipeline import Pipeline

    settings = parse_attached(task.site)
    known = parse_memory(task.memory) if task.memory else None
    skip = Backlog(settings, lambda: int(task.newest.value))
    return Pipeline(attached_structure(task.structure), settings, known, skip)


def _live_monitors(task: _Task, pipeline: "Pipeline") -> "dict[str, BlockMonitor]":
    from monitor.settings import parse_attached
    from monitor.watch.live.innovations import InnovationMonitor
    from monitor.watch.live.residuals import ResidualMonitor

    settings = parse_attached(task.site)
    return {
        "residuals of channels": ResidualMonitor(settings),
        "innovations of modes": InnovationMonitor(settings, lambda: pipeline.reference),
    }


class BlockMonitor(Protocol):
    """Part of the analysis that looks at blocks of signals."""

    def push(self, item: Item) -> Iterator[LiveState]:
        """Process one item in the log's order."""

    def take(self, result: Result) -> None:
        """Take a result of the pipeline."""


class _OptionalMonitors:
    """Monitors of blocks by name; one that fails is left out until the next start."""

    def __init__(self, monitors: dict[str, BlockMonitor]) -> None:
        self._monitors = monitors

    def push(self, item: Item) -> Iterator[LiveState]:
        for name, monitor in list(self._monitors.items()):
            yield from self._found(name, partial(list, monitor.push(item)))

    def take(self, result: Result) -> None:
        for name, monitor in list(self._monitors.items()):
            self._found(name, partial(_taken, monitor, result))

    def _found(self, name: str, find: Callable[[], list[LiveState]]) -> list[LiveState]:
        found = run_optional(name, find)
        if found is None:
            del self._monitors[name]
        return found or []


def _taken(monitor: BlockMonitor, result: Result) -> list[LiveState]:
    monitor.take(result)
    return []

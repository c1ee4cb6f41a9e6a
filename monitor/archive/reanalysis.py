"""Reanalysis: logs identified in parallel, and evaluated per site in order of time, as tasks of Dask.

Each log is two tasks. Its identification depends on the log alone; the steps that it returns (`steps`) are kept by the
hash of the log's content and of the settings that they depend on: a repeated run identifies only what is new. Its
evaluation (`evaluation`) continues from the state at the end of the log before it, as a monitor does after a restart.
Evaluations go ahead of identifications: sites are evaluated in parallel, each while its next logs are identified. The
state of a site is held here between two tasks: no worker has the only copy of anything.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from daq import LogError, McapWriter
from monitor.archive.catalog import ArchiveLog
from monitor.archive.dataset import keep_parts, write_tables
from monitor.archive.evaluation import EvaluatedLog, evaluate_task, unevaluated
from monitor.archive.log_texts import LogTexts, site_name, steps_key
from monitor.archive.steps import LogSteps, identify_log, no_steps, read_steps, write_steps
from monitor.errors import ArgumentError
from monitor.outputs.history import HistoryStore
from monitor.results.windows import AlarmResult, is_result
from monitor.settings import parse_attached
from monitor.watch.memory import MEMORY

if TYPE_CHECKING:
    from distributed import Client, Future


RESULTS_LOG = "results.mcap"  #: of a site: events and results of all its logs, without signals
_BATCH = 200  # results that are put into the history at once


class SiteResults:
    """Results of a site, begun anew.

    Parameters
    ----------
    folder : of the site's results
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: McapWriter | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the log of results, after the last log of the site."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def add(self, texts: LogTexts, found: EvaluatedLog) -> None:
        """Add a log."""
        if self._writer is None:
            self._writer = self._begin(texts)
        with HistoryStore(f"sqlite:///{self._folder / 'history.sqlite'}") as history:
            events = found.events
            while batch := list(islice(events, _BATCH)):
                for event in batch:
                    self._writer.write(event)
                history.write([event for event in batch if is_result(event)])
        if found.memory:
            (self._folder / MEMORY).write_text(found.memory, encoding="utf-8")

    def _begin(self, texts: LogTexts) -> McapWriter:
        self._folder.mkdir(parents=True, exist_ok=True)
        for name in ("history.sqlite", RESULTS_LOG):
            (self._folder / name).unlink(missing_ok=True)
        attached = {"site.toml": texts.site, "structure.toml": texts.structure, MEMORY: texts.memory}
        return McapWriter(self._folder / RESULTS_LOG, {name: text for name, text in attached.items() if text})


_NO_SITE = "unknown"  # in the tables, of logs that cannot be read
_WAITING = 4  # tasks of each kind per worker that are submitted at a time


@dataclass(frozen=True, kw_only=True)
class AnalysedLog:
    """Log after its reanalysis."""

    log: ArchiveLog
    site: str
    n_windows: int
    seconds: float  #: of data
    problem: str | None  #: reason why it was not analysed, or not to its end
    kept: bool  #: whether its steps were kept by an earlier run
    alarms: tuple[AlarmResult, ...] = ()  #: changes of the alarm and messages in it


OnLog = Callable[[AnalysedLog], None]


def identify_task(log: ArchiveLog, site: str, limit: float) -> LogSteps:
    """Identify one log, in a worker, within a time [s]; what is wrong with the log is part of the result."""
    try:
        return identify_log(log.log, parse_attached(site), limit)
    except LogError as error:
        return no_steps(str(error))


@dataclass(eq=False, kw_only=True)
class _Log:
    """Log that waits for its evaluation."""

    log: ArchiveLog
    texts: LogTexts
    key: str  # of its steps
    site: "_Site"
    identified: bool = False
    kept: bool = False  # whether an earlier run has identified it
    steps: LogSteps | None = None  # if they are not in the folder


@dataclass(eq=False, kw_only=True)
class _Site:
    """Site with the state at the end of its last evaluated log."""

    name: str
    results: SiteResults
    waiting: deque[_Log] = field(default_factory=deque)  # in order of time
    memory: str = ""
    worker: str | None = None  # that has evaluated its last log
    evaluating: bool = False


@dataclass(frozen=True, kw_only=True)
class _Task:
    """Task on the cluster."""

    then: Callable[[Any], None]  # called with its result
    failed: Callable[[str], object]  # makes a result from the reason of a failure


class _Tasks:
    """Tasks on the cluster, of two kinds: few of each are submitted at a time, evaluations go ahead."""

    def __init__(self, client: "Client") -> None:
        from distributed import as_completed

        self._client, self._ready = client, as_completed()
        self._scheduler = client.scheduler_info()["address"]
        self._most = _WAITING * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        self._identifying: dict[Future[Any], _Task] = {}
        self._evaluating: dict[Future[Any], _Task] = {}

    @property
    def can_identify(self) -> bool:
        """True if one more identification may be submitted."""
        return len(self._identifying) < self._most and self.can_evaluate

    @property
    def can_evaluate(self) -> bool:
        """True if one more evaluation may be submitted."""
        return len(self._evaluating) < self._most

    def identify(self, task: _Task, log: ArchiveLog, site: str, limit: float) -> None:
        """Submit an identification."""
        future = self._client.submit(identify_task, log, site, limit, pure=False)
        self._identifying[future] = task
        self._ready.add(future)

    def evaluate(
        self, task: _Task, worker: str | None, log: ArchiveLog, texts: LogTexts, memory: str, steps: LogSteps
    ) -> None:
        """Submit an evaluation, for a worker with the pipeline of the site or, if that one is busy, another one."""
        where: dict[str, Any] = {"workers": [worker], "allow_other_workers": True} if worker else {}
        future = self._client.submit(evaluate_task, log, texts, memory, steps, pure=False, priority=1, **where)
        self._evaluating[future] = task
        self._ready.add(future)

    def take_next(self) -> bool:
        """Wait for a task and hand its result on; return False if there is none.

        Raises
        ------
        ArgumentError
            If the scheduler is lost.
        """
        from distributed.client import FutureCancelledError

        if not (self._identifying or self._evaluating):
            return False
        future = next(self._ready)
        task = (self._identifying if future in self._identifying else self._evaluating).pop(future)
        try:
            result = future.result()
        except FutureCancelledError as error:  # no task is cancelled before the end
            lost = f"{self._scheduler}: the connection was lost: repeat the command"
            raise ArgumentError("--scheduler", lost) from error
        except Exception as error:  # noqa: BLE001 - a log that ends its workers, or fails otherwise, stops no other one
            result = task.failed(f"{type(error).__name__}: {error}")
        task.then(result)
        return True

    def cancel(self) -> None:
        """Give up what is not finished."""
        if self._client.status == "running":
            self._client.cancel([*self._identifying, *self._evaluating])


class _Run:
    """Run of a reanalysis.

    Parameters
    ----------
    tasks : on the cluster
    out : folder of the results
    on_log : called with each log once it is evaluated
    limit : on the time for the identification of one log [s]
    """

    def __init__(self, tasks: _Tasks, out: Path, on_log: OnLog, limit: float) -> None:
        self._tasks, self._out, self._on_log, self._limit = tasks, out, on_log, limit
        self._unidentified: deque[_Log] = deque()
        self._evaluable: deque[_Site] = deque()  # whose next log is identified

    def add(self, log: ArchiveLog, texts: LogTexts, site: _Site) -> None:
        """Add the next log of a site."""
        added = _Log(log=log, texts=texts, key=steps_key(log, texts), site=site)
        site.waiting.append(added)
        self._unidentified.append(added)

    def run(self) -> None:
        """Analyse all logs."""
        while True:
            if self._evaluable and self._tasks.can_evaluate:
                self._evaluate(self._evaluable.popleft())
            elif self._unidentified and self._tasks.can_identify:
                self._identify(self._unidentified.popleft())
            elif not self._tasks.take_next():
                return

    def _path(self, log: _Log) -> Path:
        return self._out / "steps" / log.key

    def _identify(self, log: _Log) -> None:
        log.kept = read_steps(self._path(log)) is not None
        if log.kept:
            self._identified(log)
        else:
            task = _Task(then=partial(self._keep, log), failed=no_steps)
            self._tasks.identify(task, log.log, log.texts.site, self._limit)

    def _keep(self, log: _Log, steps: LogSteps) -> None:
        if steps.retry:
            log.steps = steps
        else:
            with _writing(self._out):
                write_steps(self._path(log), steps)
        self._identified(log)

    def _identified(self, log: _Log) -> None:
        log.identified = True
        self._continue(log.site)

    def _continue(self, site: _Site) -> None:
        """Have the next log of a site evaluated if it is identified, and the one before is evaluated."""
        if site.waiting and site.waiting[0].identified and not site.evaluating:
            site.evaluating = True
            self._evaluable.append(site)

    def _evaluate(self, site: _Site) -> None:
        log = site.waiting.popleft()
        steps = log.steps or read_steps(self._path(log)) or no_steps(f"{self._path(log)}: cannot be read again")
        memory = site.memory or log.texts.memory
        task = _Task(then=partial(self._store, log, steps), failed=partial(unevaluated, log.log, memory, steps))
        self._tasks.evaluate(task, site.worker, log.log, log.texts, memory, steps)

    def _store(self, log: _Log, steps: LogSteps, found: EvaluatedLog) -> None:
        site = log.site
        site.memory, site.worker, site.evaluating = found.memory, found.worker, False
        self._continue(site)
        with _writing(self._out):
            write_tables(self._out, site.name, log.log.key, found.tables)
            site.results.add(log.texts, found)
            if not site.waiting:
                site.results.close()  # of a fleet, not all are open at a time
        self._on_log(
            AnalysedLog(
                log=log.log,
                site=site.name,
                n_windows=steps.n_windows,
                seconds=steps.seconds,
                problem=found.problem or steps.problem,
                kept=log.kept,
                alarms=found.alarms,
            )
        )


@contextmanager
def _writing(out: Path) -> Iterator[None]:
    """Raise ArgumentError if the folder of results has been removed, or cannot be written."""
    if not (out / "steps").is_dir():
        raise ArgumentError("--out", f"{out}: was removed during the run: repeat the command")
    try:
        yield
    except OSError as error:
        raise ArgumentError("--out", f"{out}: cannot be written: {error}") from error


def reanalyse(
    client: "Client",
    logs: Sequence[tuple[ArchiveLog, LogTexts | str]],
    out: Path,
    on_log: OnLog,
    limit: float = math.inf,
) -> None:
    """Reanalyse logs and write the results.

    Parameters
    ----------
    client : of Dask
    logs : with their texts, or the reasons why they cannot be analysed
    out : folder of the results: tables as Parquet, `steps`, and per site a log of results, a history, a saved state
    on_log : called with each log once it is evaluated
    limit : on the time for the identification of one log [s]; a repeated run begins such a log anew

    Raises
    ------
    ArgumentError
        If the results cannot be written, or the scheduler is lost. A repeated run continues.
    """
    try:
        (out / "steps").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError("--out", f"{out}: cannot be written: {error}") from error
    for log, why in ((log, texts) for log, texts in logs if isinstance(texts, str)):
        with _writing(out):
            write_tables(out, _NO_SITE, log.key, unevaluated(log, "", no_steps(why), why).tables)
        on_log(AnalysedLog(log=log, site=_NO_SITE, n_windows=0, seconds=0.0, problem=why, kept=False))
    readable = [(log, texts) for log, texts in logs if isinstance(texts, LogTexts)]
    sites: dict[str, _Site] = {}
    with ExitStack() as stack:
        tasks = _Tasks(client)
        stack.callback(tasks.cancel)
        run = _Run(tasks, out, on_log, limit)
        for log, texts in sorted(readable, key=lambda entry: entry[1].start):
            name = site_name(texts)
            if name not in sites:
                sites[name] = _Site(name=name, results=stack.enter_context(SiteResults(out / "sites" / name)))
            run.add(log, texts, sites[name])
        run.run()
    keep_parts(out, {log.key for log, _ in logs}, {*sites, _NO_SITE})

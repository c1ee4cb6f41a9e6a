"""Reanalysis: logs identified in parallel, and evaluated per site in order of time, as tasks of Dask.

A log is a run of a monitor, of any number of files. It is divided into pieces of whole files, from its beginning on:
when the run continues, only the last piece changes. Each piece is two tasks. Its identification depends on the log
alone; the steps that it returns (`steps`) are kept by the hash of the content up to there and of the settings that they
depend on: a repeated run identifies only what is new. Those of pieces that a run no longer has are removed. Its
evaluation (`evaluation`) continues in the middle of the log, or from the state at the end of the log before it, as a
monitor does after a restart.

A piece is identified from the state of the run where it begins (`run_state`). A third kind of task, the advance, finds
it from the state at the piece before, in order but several times faster than an identification: so the pieces of one
log are identified in parallel. The states behind the last complete pieces of a log are kept: a log that has grown is
continued from there.

Evaluations go ahead of advances, and these of identifications: sites are evaluated in parallel, each while its next
pieces are identified. The state of a site is held here between two tasks: no worker has the only copy of anything.
"""

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Self

from daq import McapWriter
from monitor.archive.catalog import ArchiveLog, LogPiece
from monitor.archive.dataset import keep_parts, write_tables
from monitor.archive.evaluation import EvaluatedLog, WatchState, unevaluated
from monitor.archive.log_texts import LogTexts, is_obsolete, site_name, steps_key
from monitor.archive.run_state import PieceStart, read_start, write_start
from monitor.archive.steps import LogSteps, no_steps, read_steps, write_steps
from monitor.archive.tasks import Task, Tasks
from monitor.errors import ArgumentError
from monitor.outputs.history import HistoryStore
from monitor.results.windows import AlarmResult, is_result
from monitor.watch.memory import MEMORY

if TYPE_CHECKING:
    from distributed import Client


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
        if found.state.memory:
            (self._folder / MEMORY).write_text(found.state.memory, encoding="utf-8")

    def _begin(self, texts: LogTexts) -> McapWriter:
        self._folder.mkdir(parents=True, exist_ok=True)
        for name in ("history.sqlite", RESULTS_LOG):
            (self._folder / name).unlink(missing_ok=True)
        attached = {"site.toml": texts.site, "structure.toml": texts.structure, MEMORY: texts.memory}
        return McapWriter(self._folder / RESULTS_LOG, {name: text for name, text in attached.items() if text})


_NO_SITE = "unknown"  # in the tables, of logs that cannot be read


@dataclass(frozen=True, kw_only=True)
class AnalysedLog:
    """Log, or piece of one, after its reanalysis."""

    log: LogPiece
    site: str
    n_windows: int
    seconds: float  #: of data
    problem: str | None  #: reason why it was not analysed, or not to its end
    kept: bool  #: whether its steps were kept by an earlier run
    alarms: tuple[AlarmResult, ...] = ()  #: changes of the alarm and messages in it


OnLog = Callable[[AnalysedLog], None]


@dataclass(eq=False, kw_only=True)
class _Piece:
    """Piece of a log that waits for its evaluation."""

    piece: LogPiece
    log: "_Log"
    key: str  # of its steps
    start: PieceStart | None = None  # if it is to be identified from there
    identified: bool = False
    kept: bool = False  # whether an earlier run has identified it
    steps: LogSteps | None = None  # if they are not in the folder


@dataclass(eq=False, kw_only=True)
class _Log:
    """Log with the beginning of its next piece that is known."""

    texts: LogTexts
    site: "_Site"
    pieces: list[_Piece] = field(default_factory=list)
    start: PieceStart = field(default_factory=PieceStart)
    next: int = 0  # piece that begins there
    end: int = 0  # last piece of which the beginning is needed
    evaluated: bool = False  # whether a piece has been evaluated

    @property
    def n_complete(self) -> int:
        """Number of pieces that stay as they are when the run continues; a log of one piece is read anew."""
        return sum(each.piece.complete for each in self.pieces) if len(self.pieces) > 1 else 0

    @property
    def lead(self) -> tuple[Path, ...]:
        """Files before the next piece that its identification begins with."""
        files = [path for each in self.pieces[: self.next] for path in each.piece.files]
        return tuple(files[len(files) - self.start.n_files :])


@dataclass(eq=False, kw_only=True)
class _Site:
    """Site with the state at the end of its last evaluated piece."""

    name: str
    results: SiteResults
    waiting: deque[_Piece] = field(default_factory=deque)  # in order of time
    state: WatchState = field(default_factory=WatchState)
    worker: str | None = None  # that has evaluated its last piece
    evaluating: bool = False


class _Run:
    """Run of a reanalysis.

    Parameters
    ----------
    tasks : on the cluster
    out : folder of the results
    on_log : called with each piece once it is evaluated
    limit : on the time of each task that reads a piece [s]
    """

    def __init__(self, tasks: Tasks, out: Path, on_log: OnLog, limit: float) -> None:
        self._tasks, self._out, self._on_log, self._limit = tasks, out, on_log, limit
        self._unopened: deque[_Log] = deque()
        self._advancing: deque[_Log] = deque()  # with pieces behind the next one, of which the beginning is needed
        self._unidentified: deque[tuple[_Piece, tuple[Path, ...]]] = deque()  # with a known beginning, and files before
        self._evaluable: deque[_Site] = deque()  # whose next piece is identified

    def add(self, log: ArchiveLog, texts: LogTexts, site: _Site) -> None:
        """Add the next log of a site."""
        added = _Log(texts=texts, site=site)
        added.pieces += [_Piece(piece=piece, log=added, key=steps_key(piece, texts)) for piece in log.pieces]
        site.waiting += added.pieces
        self._unopened.append(added)

    def run(self) -> None:
        """Analyse all logs."""
        while True:
            if self._evaluable and self._tasks.can_evaluate:
                self._evaluate(self._evaluable.popleft())
            elif self._advancing and self._tasks.can_advance and len(self._unidentified) < self._tasks.most:
                self._advance(self._advancing.popleft())
            elif self._unidentified and self._tasks.can_identify:
                self._identify(*self._unidentified.popleft())
            elif self._unopened and self._tasks.can_identify:
                self._open(self._unopened.popleft())
            elif not self._tasks.take_next():
                return

    def _steps_path(self, piece: _Piece) -> Path:
        return self._out / "steps" / piece.key

    def _start_path(self, piece: _Piece) -> Path:
        """Return the path of the state behind a piece."""
        return self._out / "states" / piece.key

    def _open(self, log: _Log) -> None:
        """Find the pieces that are to be identified, and the last known state before them."""
        missing = []
        for k, piece in enumerate(log.pieces):
            piece.kept = read_steps(self._steps_path(piece)) is not None
            if piece.kept:
                self._identified(piece)
            else:
                missing.append(k)
        if not missing:
            return
        log.end = max(missing[-1], log.n_complete)
        for k in range(missing[0], 0, -1):
            start = read_start(self._start_path(log.pieces[k - 1]))
            if start:
                log.start, log.next = start, k
                break
        self._begin_next(log)

    def _begin_next(self, log: _Log) -> None:
        """Have the next piece of a log identified, if it is to be, and those behind it found."""
        if log.next < len(log.pieces) and not log.pieces[log.next].kept:
            piece = log.pieces[log.next]
            piece.start = log.start
            self._unidentified.append((piece, log.lead))
        if log.next < log.end:
            self._advancing.append(log)

    def _advance(self, log: _Log) -> None:
        task = Task(then=partial(self._advanced, log), failed=str)
        self._tasks.advance(task, log.pieces[log.next].piece, log.texts.site, self._limit, log.start)

    def _advanced(self, log: _Log, start: PieceStart | str) -> None:
        log.next += 1
        if isinstance(start, str):
            for piece in log.pieces[log.next :]:
                if not piece.kept:
                    piece.steps = no_steps(f"{piece.piece.name}: is left out: the run before it: {start}")
                    self._identified(piece)
            return
        log.start = start
        if log.n_complete - 1 <= log.next <= log.n_complete:
            self._keep_start(log)
        self._begin_next(log)

    def _keep_start(self, log: _Log) -> None:
        """Keep the states behind the last two complete pieces: a file at the end of the last one may still grow."""
        with _writing(self._out):
            write_start(self._start_path(log.pieces[log.next - 1]), log.start)
            for piece in log.pieces[: max(0, log.n_complete - 2)]:
                self._start_path(piece).unlink(missing_ok=True)

    def _identify(self, piece: _Piece, lead: tuple[Path, ...]) -> None:
        start, piece.start = piece.start or PieceStart(), None
        task = Task(then=partial(self._keep, piece), failed=no_steps)
        self._tasks.identify(task, piece.piece, piece.log.texts.site, self._limit, start, lead)

    def _keep(self, piece: _Piece, steps: LogSteps) -> None:
        if steps.retry:
            piece.steps = steps
        else:
            with _writing(self._out):
                write_steps(self._steps_path(piece), steps)
        self._identified(piece)

    def _identified(self, piece: _Piece) -> None:
        piece.identified = True
        self._continue(piece.log.site)

    def _continue(self, site: _Site) -> None:
        """Have the next piece of a site evaluated if it is identified, and the one before is evaluated."""
        if site.waiting and site.waiting[0].identified and not site.evaluating:
            site.evaluating = True
            self._evaluable.append(site)

    def _evaluate(self, site: _Site) -> None:
        piece = site.waiting.popleft()
        path, log = self._steps_path(piece), piece.log
        steps = piece.steps or read_steps(path) or no_steps(f"{path}: cannot be read again")
        state = site.state if site.state.memory else WatchState(memory=log.texts.memory)
        task = Task(then=partial(self._store, piece, steps), failed=partial(unevaluated, piece.piece, state, steps))
        self._tasks.evaluate(task, site.worker, piece.piece, log.texts, state, steps, continued=log.evaluated)

    def _store(self, piece: _Piece, steps: LogSteps, found: EvaluatedLog) -> None:
        log, site = piece.log, piece.log.site
        site.state, site.worker, site.evaluating = found.state, found.worker, False
        log.evaluated |= not found.problem
        self._continue(site)
        with _writing(self._out):
            write_tables(self._out, site.name, piece.piece.key, found.tables)
            site.results.add(log.texts, found)
            if not site.waiting:
                site.results.close()  # of a fleet, not all are open at a time
        self._on_log(
            AnalysedLog(
                log=piece.piece,
                site=site.name,
                n_windows=steps.n_windows,
                seconds=steps.seconds,
                problem=found.problem or steps.problem,
                kept=piece.kept,
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
    out : folder of the results: tables as Parquet, `steps`, `states`, and per site a log of results, a history, a saved
        state
    on_log : called with each log, or piece of one, once it is evaluated
    limit : on the time of each task that reads a piece, identification or advance [s]; a repeated run begins
        such a piece anew

    Raises
    ------
    ArgumentError
        If the results cannot be written, or the scheduler is lost. A repeated run continues.
    """
    try:
        for name in ("steps", "states"):
            (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError("--out", f"{out}: cannot be written: {error}") from error
    for piece, why in ((piece, texts) for log, texts in logs if isinstance(texts, str) for piece in log.pieces):
        with _writing(out):
            write_tables(out, _NO_SITE, piece.key, unevaluated(piece, WatchState(), no_steps(why), why).tables)
        on_log(AnalysedLog(log=piece, site=_NO_SITE, n_windows=0, seconds=0.0, problem=why, kept=False))
    readable = [(log, texts) for log, texts in logs if isinstance(texts, LogTexts)]
    sites: dict[str, _Site] = {}
    with ExitStack() as stack:
        tasks = Tasks(client)
        stack.callback(tasks.cancel)
        run = _Run(tasks, out, on_log, limit)
        for log, texts in sorted(readable, key=lambda entry: entry[1].start):
            name = site_name(texts)
            if name not in sites:
                sites[name] = _Site(name=name, results=stack.enter_context(SiteResults(out / "sites" / name)))
            run.add(log, texts, sites[name])
        run.run()
    with _writing(out):
        keep_parts(out, {piece.key for log, _ in logs for piece in log.pieces}, {*sites, _NO_SITE})
        _remove_obsolete(out, {texts.run: {each.key for each in log.pieces} for log, texts in readable if texts.run})


def _remove_obsolete(out: Path, present: Mapping[str, Collection[str]]) -> None:
    """Remove steps and states of pieces that these runs no longer have, as after files were deleted."""
    for name in ("steps", "states"):
        for path in (out / name).iterdir():
            if is_obsolete(path.stem, present):
                path.unlink(missing_ok=True)

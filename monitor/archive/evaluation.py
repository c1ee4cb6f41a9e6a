"""Evaluation of a log in a worker: tracked, judged and diagnosed from the state at the end of the log before it.

The pieces of one log are evaluated as one: each continues from the state in the middle of the log.
"""

import json
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from daq import Event
from monitor.archive.catalog import LogPiece
from monitor.archive.dataset import LogTables
from monitor.archive.log_texts import LogTexts
from monitor.archive.steps import LogSteps, Packer, unpack, unpacked
from monitor.errors import MonitorError
from monitor.results.windows import AlarmResult, result_event
from monitor.settings import attached_structure, parse_attached
from monitor.watch.memory import MEMORY, MidLogState, check_saved_state, memory_text, parse_memory
from monitor.watch.memory.codec import decode, encode
from monitor.watch.pipeline import Pipeline
from updater import UpdaterError

_KEPT = 4  # pipelines in a process


@dataclass(frozen=True, kw_only=True)
class WatchState:
    """State of a site between two logs, or between two pieces of one, as texts."""

    memory: str = ""  #: that a new log continues from; empty if there is none
    mid_log: str = ""  #: in addition, that the next piece of the same log continues from


@dataclass(frozen=True, kw_only=True)
class EvaluatedLog:
    """Results of a log, or of a piece of one."""

    state: WatchState  #: at the end; that at the beginning if it could not be evaluated
    tables: dict[str, bytes]  #: name -> Parquet file
    packed: bytes = b""  #: events of the log and results, in order
    alarms: tuple[AlarmResult, ...] = ()
    problem: str | None = None  #: reason why it could not be evaluated
    worker: str | None = field(default=None, compare=False)  #: address of the worker that has the pipeline

    @property
    def events(self) -> Iterator[Event]:
        """Events of the log and results, in order."""
        return (Event(**entry) for entry in unpack(self.packed))


class _Pipelines:
    """Pipelines at the end of a log or piece, for the next one of their sites; results do not depend on them."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str, str, WatchState], Pipeline] = OrderedDict()

    def take(self, texts: LogTexts, state: WatchState, *, continued: bool) -> Pipeline:
        """Return a pipeline that continues from a state, in the same log or in a new one."""
        pipeline = self._kept.pop((texts.site, texts.structure, state), None)
        if pipeline:
            if not continued:
                pipeline.begin_log()
            return pipeline
        structure, settings = attached_structure(texts.structure), parse_attached(texts.site)
        known = check_saved_state(state.memory, MEMORY, structure, settings).text if state.memory else None
        pipeline = Pipeline(structure, settings, parse_memory(known) if known else None)
        if continued:
            pipeline.continue_log(decode(MidLogState, json.loads(state.mid_log)))
        return pipeline

    def keep(self, texts: LogTexts, state: WatchState, pipeline: Pipeline) -> None:
        """Keep a pipeline with its present state, and the last few of others."""
        self._kept[texts.site, texts.structure, state] = pipeline
        while len(self._kept) > _KEPT:
            self._kept.popitem(last=False)


_pipelines = _Pipelines()


def evaluate_task(
    piece: LogPiece, texts: LogTexts, state: WatchState, steps: LogSteps, *, continued: bool
) -> EvaluatedLog:
    """Evaluate a piece of a log, in a worker; what is wrong with it is part of the result.

    Parameters
    ----------
    piece : that the steps are of
    texts : of the log
    state : at the end of the log before it, or of the piece before it
    steps : of the piece
    continued : whether the piece before it has been evaluated
    """
    from distributed import get_worker

    try:
        found = evaluate_log(piece, texts, state, steps, continued=continued)
    except (MonitorError, UpdaterError) as error:
        return unevaluated(piece, state, steps, str(error))
    return replace(found, worker=get_worker().address)


def evaluate_log(
    piece: LogPiece, texts: LogTexts, state: WatchState, steps: LogSteps, *, continued: bool = False
) -> EvaluatedLog:
    """Evaluate a log from a saved state, or a piece of one from that in the middle of it."""
    pipeline = _pipelines.take(texts, state, continued=continued)
    packer, tables, alarms = Packer(), LogTables(piece.name), []
    for step in unpacked(steps.packed):
        results = pipeline.resume(step) if isinstance(step, int) else pipeline.push_identified(step)
        found = list(results)
        for event in ([step] if isinstance(step, Event) else []) + [result_event(result) for result in found]:
            packer.add({"topic": event.topic, "time": event.time, "payload": event.payload})
        for result in found:
            tables.add(result)
            alarms += [result] if isinstance(result, AlarmResult) else []
    end = WatchState(memory=memory_text(pipeline.memory), mid_log=json.dumps(encode(pipeline.mid_log)))
    _pipelines.keep(texts, end, pipeline)
    files = tables.files(piece.size, steps.n_windows, steps.seconds, steps.problem)
    return EvaluatedLog(state=end, tables=files, packed=packer.finish(), alarms=tuple(alarms))


def unevaluated(piece: LogPiece, state: WatchState, steps: LogSteps, problem: str) -> EvaluatedLog:
    """Return the results of a piece of a log that could not be evaluated."""
    tables = LogTables(piece.name).files(piece.size, steps.n_windows, steps.seconds, problem)
    return EvaluatedLog(state=state, tables=tables, packed=Packer().finish(), problem=problem)

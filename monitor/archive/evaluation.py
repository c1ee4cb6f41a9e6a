"""Evaluation of a log in a worker: tracked, judged and diagnosed from the state at the end of the log before it."""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from daq import Event
from monitor.archive.catalog import ArchiveLog
from monitor.archive.dataset import LogTables
from monitor.archive.log_texts import LogTexts
from monitor.archive.steps import LogSteps, Packer, unpack, unpacked
from monitor.errors import MonitorError
from monitor.results.windows import AlarmResult, result_event
from monitor.settings import attached_structure, parse_attached
from monitor.watch.memory import MEMORY, check_saved_state, memory_text, parse_memory
from monitor.watch.pipeline import Pipeline
from updater import UpdaterError

_KEPT = 4  # pipelines in a process
_State = tuple[str, str, str]  # settings, structure, saved state


@dataclass(frozen=True, kw_only=True)
class EvaluatedLog:
    """Results of one log."""

    memory: str  #: state at the end, as text; that at the beginning if the log could not be evaluated
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
    """Pipelines at the end of a log, for the next log of their sites; results do not depend on whether one is there."""

    def __init__(self) -> None:
        self._kept: OrderedDict[_State, Pipeline] = OrderedDict()

    def take(self, texts: LogTexts, memory: str) -> Pipeline:
        """Return a pipeline that continues from a saved state."""
        pipeline = self._kept.pop((texts.site, texts.structure, memory), None)
        if pipeline:
            pipeline.begin_log()
            return pipeline
        structure, settings = attached_structure(texts.structure), parse_attached(texts.site)
        known = check_saved_state(memory, MEMORY, structure, settings).text if memory else None
        return Pipeline(structure, settings, parse_memory(known) if known else None)

    def keep(self, texts: LogTexts, memory: str, pipeline: Pipeline) -> None:
        """Keep a pipeline with its present state, and the last few of others."""
        self._kept[texts.site, texts.structure, memory] = pipeline
        while len(self._kept) > _KEPT:
            self._kept.popitem(last=False)


_pipelines = _Pipelines()


def evaluate_task(log: ArchiveLog, texts: LogTexts, memory: str, steps: LogSteps) -> EvaluatedLog:
    """Evaluate a log, in a worker; what is wrong with the log is part of the result.

    Parameters
    ----------
    log : that the steps are of
    texts : of the log
    memory : state at the end of the log before it, as text; empty if there is none
    steps : of the log
    """
    from distributed import get_worker

    try:
        found = evaluate_log(log, texts, memory, steps)
    except (MonitorError, UpdaterError) as error:
        return unevaluated(log, memory, steps, str(error))
    return replace(found, worker=get_worker().address)


def evaluate_log(log: ArchiveLog, texts: LogTexts, memory: str, steps: LogSteps) -> EvaluatedLog:
    """Evaluate a log from a saved state."""
    pipeline = _pipelines.take(texts, memory)
    packer, tables, alarms = Packer(), LogTables(log.name), []
    for step in unpacked(steps.packed):
        results = pipeline.resume(step) if isinstance(step, int) else pipeline.push_identified(step)
        found = list(results)
        for event in ([step] if isinstance(step, Event) else []) + [result_event(result) for result in found]:
            packer.add({"topic": event.topic, "time": event.time, "payload": event.payload})
        for result in found:
            tables.add(result)
            alarms += [result] if isinstance(result, AlarmResult) else []
    end = memory_text(pipeline.memory)
    _pipelines.keep(texts, end, pipeline)
    files = tables.files(log.size, steps.n_windows, steps.seconds, steps.problem)
    return EvaluatedLog(memory=end, tables=files, packed=packer.finish(), alarms=tuple(alarms))


def unevaluated(log: ArchiveLog, memory: str, steps: LogSteps, problem: str) -> EvaluatedLog:
    """Return the results of a log that could not be evaluated."""
    tables = LogTables(log.name).files(log.size, steps.n_windows, steps.seconds, problem)
    return EvaluatedLog(memory=memory, tables=tables, packed=Packer().finish(), problem=problem)

"""Tasks of a reanalysis on the cluster, of three kinds: few of each are submitted at a time.

Evaluations go ahead, then advances of long logs, which make more identifications possible, then identifications.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq import LogError
from monitor.archive.catalog import LogPiece
from monitor.archive.evaluation import WatchState, evaluate_task
from monitor.archive.log_texts import LogTexts
from monitor.archive.run_state import PieceStart, TimeLimit, advance
from monitor.archive.steps import LogSteps, identify_log, no_steps
from monitor.errors import ArgumentError
from monitor.settings import parse_attached

if TYPE_CHECKING:
    from distributed import Client, Future

_WAITING = 4  # tasks of each kind per worker that are submitted at a time


def identify_task(piece: LogPiece, site: str, limit: float, start: PieceStart, lead: Sequence[Path]) -> LogSteps:
    """Identify one piece of a log, in a worker, within a time [s]; what is wrong with it is part of the result."""
    try:
        return identify_log(piece.log, parse_attached(site), limit, start, lead)
    except LogError as error:
        return no_steps(str(error))


def advance_task(piece: LogPiece, site: str, limit: float, start: PieceStart) -> PieceStart | str:
    """Return the beginning of the piece after this one, or the reason why it is not known within a time [s]."""
    try:
        return advance(piece.log, parse_attached(site), start, TimeLimit(limit))
    except LogError as error:
        return str(error)


@dataclass(frozen=True, kw_only=True)
class Task:
    """Task on the cluster."""

    then: Callable[[Any], None]  #: called with its result
    failed: Callable[[str], object]  #: makes a result from the reason of a failure


class Tasks:
    """Tasks on the cluster.

    Parameters
    ----------
    client : of Dask
    """

    def __init__(self, client: "Client") -> None:
        from distributed import as_completed

        self._client, self._ready = client, as_completed()
        self._scheduler = client.scheduler_info()["address"]
        #: largest number of tasks of a kind that are submitted at a time
        self.most = _WAITING * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        self._identifying: dict[Future[Any], Task] = {}
        self._advancing: dict[Future[Any], Task] = {}
        self._evaluating: dict[Future[Any], Task] = {}

    @property
    def can_identify(self) -> bool:
        """True if one more identification may be submitted."""
        return len(self._identifying) < self.most and self.can_evaluate

    @property
    def can_advance(self) -> bool:
        """True if one more log may be advanced."""
        return len(self._advancing) < self.most

    @property
    def can_evaluate(self) -> bool:
        """True if one more evaluation may be submitted."""
        return len(self._evaluating) < self.most

    def identify(
        self, task: Task, piece: LogPiece, site: str, limit: float, start: PieceStart, lead: Sequence[Path]
    ) -> None:
        """Submit an identification."""
        self._submit(self._identifying, task, 0, {}, identify_task, piece, site, limit, start, lead)

    def advance(self, task: Task, piece: LogPiece, site: str, limit: float, start: PieceStart) -> None:
        """Submit an advance through a piece."""
        self._submit(self._advancing, task, 1, {}, advance_task, piece, site, limit, start)

    def evaluate(
        self,
        task: Task,
        worker: str | None,
        piece: LogPiece,
        texts: LogTexts,
        state: WatchState,
        steps: LogSteps,
        *,
        continued: bool,
    ) -> None:
        """Submit an evaluation, for a worker with the pipeline of the site or, if that one is busy, another one."""
        where: dict[str, Any] = {"workers": [worker], "allow_other_workers": True} if worker else {}
        where["continued"] = continued
        self._submit(self._evaluating, task, 2, where, evaluate_task, piece, texts, state, steps)

    def _submit(
        self,
        kind: "dict[Future[Any], Task]",
        task: Task,
        priority: int,
        options: dict[str, Any],
        function: Callable[..., object],
        *arguments: object,
    ) -> None:
        future = self._client.submit(function, *arguments, pure=False, priority=priority, **options)
        kind[future] = task
        self._ready.add(future)

    def take_next(self) -> bool:
        """Wait for a task and hand its result on; return False if there is none.

        Raises
        ------
        ArgumentError
            If the scheduler is lost.
        """
        from distributed.client import FutureCancelledError

        kinds = (self._identifying, self._advancing, self._evaluating)
        if not any(kinds):
            return False
        future = next(self._ready)
        task = next(kind for kind in kinds if future in kind).pop(future)
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
            self._client.cancel([*self._identifying, *self._advancing, *self._evaluating])

"""An archive analysed again, in parallel."""

import logging
import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.archive import (
    AnalysedLog,
    ArchiveLog,
    LogPiece,
    LogTexts,
    find_logs,
    read_steps,
    reanalyse,
    steps_key,
    texts_of,
)
from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.terminal import echo, progress
from monitor.errors import ArgumentError
from monitor.service.site import load_site
from monitor.text.quantities import counted

if TYPE_CHECKING:
    from distributed import Client

_READERS = 8  # logs whose attachments are read at the same time


def reanalyse_archive(
    archives: Sequence[str],
    out: Path,
    site: Path | None,
    given: Sequence[str],
    scheduler: str | None,
    workers: int | None,
    *,
    limit: float | None,
    dry_run: bool,
) -> int:
    """Analyse the logs of an archive again; 1 if a log could not be analysed to its end, or a site ends in an alarm."""
    texts = _texts(site, given)
    logs = find_logs(archives)
    with ThreadPoolExecutor(_READERS) as pool:
        planned = list(zip(logs, pool.map(partial(texts_of, site=texts), logs), strict=True))
    n_pieces = sum(len(log.pieces) for log in logs)
    what = "log" if n_pieces == len(logs) else "piece"
    if dry_run:
        _print_plan(planned, out)
        return DONE
    with (
        _client(scheduler, workers) as client,
        progress("analysing") as work,
    ):
        analysed: list[AnalysedLog] = []
        states: dict[str, str] = {}

        def finished(about: AnalysedLog) -> None:
            analysed.append(about)
            work.note(f"{len(analysed)} of {counted(n_pieces, what)}")
            work.advance(sum(one.log.size for one in analysed), sum(log.size for log in logs))
            states[about.site] = about.alarms[-1].state if about.alarms else states.get(about.site, "normal")
            _say(about)

        reanalyse(client, planned, out, finished, math.inf if limit is None else limit)
    n_windows, n_problems = sum(one.n_windows for one in analysed), sum(one.problem is not None for one in analysed)
    echo(f"{counted(n_pieces, what)}, {counted(n_windows, 'window')}; {what}s with a problem: {n_problems}")
    echo(f"results: {out} (Parquet: windows, modes, alarms, logs)")
    echo(f"per site: {out}/sites/NAME/results.mcap (for `report` and `view`), history.sqlite")
    return NEEDS_A_PERSON if n_problems or "alarm" in states.values() else DONE


def _texts(site: Path | None, given: Sequence[str]) -> LogTexts | None:
    if site is None:
        if given:
            raise ArgumentError("--set", "requires --site")
        return None
    loaded = load_site(site, given)
    return LogTexts(site=loaded.site_text, structure=loaded.structure_text)


@contextmanager
def _client(scheduler: str | None, workers: int | None) -> "Iterator[Client]":
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise ArgumentError("reanalyse", "requires `pip install modalwatch[fleet]`") from error
    if scheduler:
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # a lost connection is reported as an error
        try:
            with Client(scheduler, timeout=10) as client:
                yield client
        except OSError as error:
            raise ArgumentError("--scheduler", f"{scheduler}: does not respond: {error}") from error
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the workers: one core each
    with (
        LocalCluster(
            n_workers=workers or os.cpu_count() or 1,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.ERROR,  # a warning is no more than that a worker was slow to end, or was replaced
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def _print_plan(planned: Sequence[tuple[ArchiveLog, LogTexts | str]], out: Path) -> None:
    new = 0
    for log, texts in planned:
        if isinstance(texts, str):
            state = f"not readable: {_without_name(texts, log)}"
        else:
            missing = [each for each in log.pieces if not read_steps(out / "steps" / steps_key(each, texts))]
            state, new = _state(len(missing), len(log.pieces)), new + sum(each.size for each in missing)
        echo(f"{log.name}: {state}")
    echo(f"{counted(len(planned), 'log')}, {new / 1e6:.1f} MB to be read; nothing is written")


def _state(n_missing: int, n_pieces: int) -> str:
    if not n_missing:
        return "identified by an earlier run"
    return "to be identified" if n_pieces == 1 else f"{n_missing} of {n_pieces} pieces to be identified"


def _say(about: AnalysedLog) -> None:
    problem = _without_name(about.problem or "", about.log)
    if problem and not about.n_windows:
        text = f"{about.log.name}: {problem}"
    else:
        text = f"{about.site}: {about.log.name}: {counted(about.n_windows, 'window')}"
        text += (", identified by an earlier run" if about.kept else "") + (f"; {problem}" if problem else "")
    echo(text, divide=True)
    for alarm in about.alarms:
        if alarm.state == "alarm" and not alarm.quiet:
            echo(f"    {alarm.text}", divide=True)


def _without_name(problem: str, log: ArchiveLog | LogPiece) -> str:
    """Return a problem of a log without the name of the log, which is printed before it."""
    return problem.removeprefix(f"{log.name}: ")

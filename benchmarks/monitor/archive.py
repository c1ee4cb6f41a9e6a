"""Reanalysis of an archive: time and memory with one worker and with two, from the first byte and with kept steps.

The logs are the recorded log of the repository up to the change, once per log and later each time. One log amid those
of a site is the whole one, with the mass. The second archive has them as the files of one run, in pieces of 10 MB.

Usage: OPENBLAS_NUM_THREADS=1 python benchmarks/monitor/archive.py [LOGS [RUNS]], or make bench-archive
"""

import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import pandas as pd
import psutil

from daq import Block, Item, McapWriter, read_attachments, read_log
from daq.log import RotatingWriter, Rotation
from monitor.results.service_events import Stopped

RECORDED = Path(__file__).parents[2] / "replay_data" / "t_frame_added_mass.mcap"
_UNTIL_CHANGE, _APART = 160 * 10**9, 240 * 10**9  # ns: scans of a log, from one log to the next
_PIECES = "from monitor.archive import catalog; catalog.PIECE_BYTES = 10 << 20"  # some files of a few minutes
COMMAND = [sys.executable, "-c", f"{_PIECES}; from monitor.cli.main import main; main()", "reanalyse"]


@dataclass(frozen=True, kw_only=True)
class Run:
    """Cost of one reanalysis."""

    seconds: float  #: wall time [s]
    cpu: float  #: processor time of all its processes [s]
    busiest: float  #: processor time of the worker that used most of it [s]
    memory: float  #: largest resident memory of a worker [MB]


def write_archive(folder: Path, n_sites: int, n_logs: int) -> None:
    """Write the logs of each site."""
    attached = read_attachments(RECORDED)
    name = 'name = "T-shaped steel frame"'
    assert name in attached["structure.toml"]
    for site in range(n_sites):
        own = attached | {"structure.toml": attached["structure.toml"].replace(name, f'name = "frame {site}"')}
        for k in range(n_logs):
            path = folder / f"frame{site}" / f"log{k:03d}.mcap"
            path.parent.mkdir(parents=True, exist_ok=True)
            writer = McapWriter(path, own)
            for item in _items(k, n_logs):
                writer.write(item)
            writer.close()


def write_run(folder: Path, n_files: int) -> None:
    """Write the logs of one site as one run; its indices continue."""
    folder.mkdir()
    writer = RotatingWriter(folder, read_attachments(RECORDED), 0, Rotation(size=1))
    for k in range(n_files):
        for item in _items(k, n_files):
            scans = round(k * _APART * 1e-9 * item.rate) if isinstance(item, Block) else 0
            writer.write(_with_index(item, scans))
        writer.flush()
    writer.close()


def _items(k: int, n_logs: int) -> list[Item]:
    """Return the content of a log."""
    items = _recorded()
    start = min(item.arrival_time for item in items if isinstance(item, Block))
    until = math.inf if k == n_logs // 2 else start + _UNTIL_CHANGE
    return [_later(item, k * _APART) for item in items if _time(item) < until]


@cache
def _recorded() -> list[Item]:
    """Return the recorded log without its end, which would end a run."""
    return [item for item in read_log(RECORDED) if isinstance(item, Block) or item.topic != Stopped.topic]


def _with_index(item: Item, later: int) -> Item:
    if isinstance(item, Block):
        return replace(item, first_index=item.first_index + later, arrival_index=item.arrival_index + later)
    return item


def _time(item: Item) -> int:
    return item.arrival_time if isinstance(item, Block) else item.time


def _later(item: Item, by: int) -> Item:
    if isinstance(item, Block):
        return replace(item, arrival_time=item.arrival_time + by)
    return replace(item, time=item.time + by)


def run(logs: Path, out: Path, workers: int) -> Run:
    """Reanalyse an archive."""
    start, before, largest = time.monotonic(), _cpu(), 0
    busy: dict[int, float] = {}
    command = [*COMMAND, str(logs), "-o", str(out), "--workers", str(workers)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            for pid, seconds, memory in _started_by(process.pid):
                busy[pid], largest = seconds, max(largest, memory)
            time.sleep(1.0)
    assert process.returncode in {0, 1}, "the command has failed"  # 1: an alarm is active
    cpu = _cpu() - before
    return Run(seconds=time.monotonic() - start, cpu=cpu, busiest=max(busy.values()), memory=largest / 1e6)


def _cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _started_by(pid: int) -> Iterator[tuple[int, float, int]]:
    """Yield the processes that a command has started: identifier, processor time [s], resident memory [bytes]."""
    with suppress(psutil.Error):
        for child in psutil.Process(pid).children(recursive=True):
            with suppress(psutil.Error):
                used = child.cpu_times()
                yield child.pid, used.user + used.system, child.memory_info().rss


def main() -> None:
    """Print the table of the documentation."""
    n_logs = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    n_runs = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    print("| archive | run | best time | all times | processor time | busiest worker | data over time | memory |")
    print("|:--|:--|---:|---:|---:|---:|---:|---:|", flush=True)
    for n_sites in (4, 1):
        with tempfile.TemporaryDirectory() as folder:
            logs, n_each = Path(folder) / "logs", n_logs // n_sites
            if n_sites > 1:
                write_archive(logs, n_sites, n_each)
            else:
                write_run(logs, n_each)
            measure(Path(folder), f"{n_sites} x {n_each} logs" if n_sites > 1 else f"1 run of {n_each} files", n_runs)
    print(f"\n{n_runs} runs of each; load at the end: {', '.join(f'{load:.1f}' for load in os.getloadavg())}")


def measure(folder: Path, name: str, n_runs: int) -> None:
    """Print the rows of one archive; runs of both kinds alternate, so that other load disturbs both."""
    logs, out = folder / "logs", folder / "out"
    runs: dict[str, list[Run]] = {}
    for _ in range(n_runs):
        for text, workers, fresh in (
            ("one worker", 1, True),
            ("two workers", 2, True),
            ("two workers, all windows identified by an earlier run", 2, False),
        ):
            if fresh:
                shutil.rmtree(out, ignore_errors=True)
            runs.setdefault(text, []).append(run(logs, out, workers))
            print(text, runs[text][-1], os.getloadavg()[0], file=sys.stderr, flush=True)
    seconds = float(pd.read_parquet(out / "logs").seconds.sum())
    for text, found in runs.items():
        best = min(found, key=lambda one: one.seconds)
        times = ", ".join(f"{one.seconds:.0f}" for one in found)
        cpu, busiest = min(one.cpu for one in found), min(one.busiest for one in found)
        archive = f"{name}, {seconds / 3600:.1f} h"
        print(
            f"| {archive} | {text} | {best.seconds:.1f} s | {times} s | {cpu:.0f} s |"
            f" {busiest:.0f} s | {seconds / best.seconds:.0f} | {max(one.memory for one in found):.0f} MB |"
        )
    one, two = runs["one worker"], runs["two workers"]
    ratio = min(each.seconds for each in one) / min(each.seconds for each in two)
    busy = min(each.busiest for each in one) / min(each.busiest for each in two)
    print(f"\none worker over two: {ratio:.2f} of the best times, {busy:.2f} of the busiest worker\n", flush=True)


if __name__ == "__main__":
    main()

"""`reanalyse` with real schedulers and workers: the tables, what is kept, damaged logs, a worker that is killed."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import duckdb
import pandas as pd
import polars as pl
import pytest
from distributed import LocalCluster

from daq import Event, read_attachments, read_log
from monitor.archive import catalog, reanalysis
from monitor.results.windows import event_result
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.recorded_runs import write_run

pytestmark = pytest.mark.timeout(300)

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
SITE = "T-shaped steel frame"


def archive(folder: Path, n: int) -> Path:
    """Make a folder of logs with three windows each, in folders of their own, and one file that is none."""
    whole = RECORDED.read_bytes()
    for k in range(n):
        path = folder / f"year{k}" / f"log{k}.mcap"
        path.parent.mkdir(parents=True)
        path.write_bytes(whole[: 1_200_000 + 1000 * k])
    (folder / "poisoned.mcap").write_bytes(b"not a log")
    return folder


def tables(out: Path) -> dict[str, pd.DataFrame]:
    """Read all tables by pandas, in a fixed order."""
    found = {}
    for name, order in (("windows", ["log", "window"]), ("modes", ["log", "window", "mode"]), ("logs", ["log"])):
        frame = pd.read_parquet(out / name)
        found[name] = frame.sort_values(order).reset_index(drop=True)
    return found


@pytest.mark.timeout(300)
@pytest.mark.usefixtures("undrawn")
def test_archive_is_analysed_once_and_read_by_three_libraries(modalwatch: Commands, tmp_path: Path) -> None:
    """A file that is no log is reported and stops nothing; a second run computes nothing."""
    logs, out = archive(tmp_path / "logs", 2), tmp_path / "out"
    planned = modalwatch("reanalyse", logs, "-o", out, "--dry-run")
    assert planned.code == 0, planned.err
    assert planned.out.count("to be identified") == 2
    assert not out.exists()
    first = modalwatch("reanalyse", logs, "-o", out, "--workers", 1)
    assert first.code == 1, first.err  # one log could not be read
    assert "is not an MCAP log" in first.out
    found = tables(out)
    assert found["windows"].groupby("log").size().tolist() == [3, 3]
    assert (found["modes"].frequency_std > 0).all()
    assert found["modes"]["shape"].map(len).eq(found["modes"]["channels"].map(len)).all()
    assert found["logs"].problem.notna().tolist() == [True, False, False]
    assert str(found["windows"].start.dt.tz) == "UTC"
    by_polars = pl.read_parquet(out / "modes" / "**" / "*.parquet")
    sql = f"select count(*), sum(frequency) from read_parquet('{out}/modes/*/*.parquet', hive_partitioning = true)"
    [counted] = duckdb.connect().execute(f"{sql} where site = '{SITE}'").fetchall()
    assert len(by_polars) == counted[0] == len(found["modes"]) > 20
    assert counted[1] == pytest.approx(found["modes"].frequency.sum())
    assert by_polars["frequency"].sum() == pytest.approx(counted[1])
    results = out / "sites" / SITE / "results.mcap"
    assert "/result/window 6" in modalwatch("log", "info", results).out
    assert modalwatch("report", results, "-o", tmp_path / "report.html").code == 0
    again = modalwatch("reanalyse", logs, "-o", out, "--dry-run")
    assert again.out.count("identified by an earlier run") == 2
    for name, frame in tables(out).items():
        pd.testing.assert_frame_equal(frame, found[name])


@pytest.mark.parametrize("obstacle", ["removed", "full"])
def test_results_that_cannot_be_written_are_one_clear_error(
    obstacle: str, modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is removed, or the disk full, once the first log is shown; the worker is a thread."""
    logs, out = archive(tmp_path / "logs", 1), tmp_path / "out"
    monkeypatch.setattr("distributed.LocalCluster", partial(LocalCluster, processes=False))

    def fail(*_: object) -> None:
        if obstacle == "removed":
            shutil.rmtree(out)
        else:
            monkeypatch.setattr(reanalysis, "write_steps", no_space)

    def no_space(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("monitor.cli.logs.reanalysis._say", fail)
    text = {
        "removed": "was removed during the run: repeat the command",
        "full": "cannot be written: [Errno 28] No space",
    }
    assert_refused(modalwatch("reanalyse", logs, "-o", out, "--workers", 1), f"--out: {out}: {text[obstacle]}")


@pytest.mark.thorough  # the S3 server's objects are in the default set
@pytest.mark.timeout(300)
def test_objects_of_a_url_give_the_same_tables(modalwatch: Commands, tmp_path: Path) -> None:
    logs = archive(tmp_path / "logs", 1)
    (logs / "poisoned.mcap").unlink()
    assert modalwatch("reanalyse", logs, "-o", tmp_path / "one", "--workers", 1).code == 0
    assert modalwatch("reanalyse", f"file://{logs}", "-o", tmp_path / "other", "--workers", 1).code == 0
    one, other = (tables(tmp_path / name)["modes"].drop(columns="log") for name in ("one", "other"))
    pd.testing.assert_frame_equal(one, other)


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a scheduler and two workers as processes; yield its address, and the three processes."""
    address = folder / "scheduler.json"
    quiet = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    python = [sys.executable, "-m"]
    options = [
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--dashboard-address",
        "127.0.0.1:0",
        "--scheduler-file",
        str(address),
    ]
    started = [
        subprocess.Popen([*python, "distributed.cli.dask_scheduler", *options], env=quiet, stderr=subprocess.DEVNULL)
    ]
    try:
        until(address.exists, started[0])
        worker = ["--scheduler-file", str(address), "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        for k in range(2):
            own = [*worker, "--local-directory", str(folder / f"worker{k}")]
            started.append(
                subprocess.Popen([*python, "distributed.cli.dask_worker", *own], env=quiet, stderr=subprocess.DEVNULL)
            )
        yield json.loads(address.read_text())["address"], started
    finally:
        for process in started:
            process.kill()
            process.wait()


def until(condition: Callable[[], object], process: subprocess.Popen[bytes], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, "it has ended"
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


def after_a_kill(folder: Path, logs: Path, piece_bytes: int) -> Path:
    """Return the results of a command of which one of two workers is killed once the first steps are kept."""
    out = folder / "out"
    program = f"from monitor.archive import catalog; catalog.PIECE_BYTES = {piece_bytes}; "
    with cluster(folder) as (address, processes):
        command = [sys.executable, "-c", program + "from monitor.cli.main import main; main()", "reanalyse", str(logs)]
        with subprocess.Popen([*command, "-o", str(out), "--scheduler", address], stdout=subprocess.PIPE) as run:
            until(lambda: list((out / "steps").glob("*")), run)
            processes[1].send_signal(signal.SIGKILL)
            shown, _ = run.communicate(timeout=120)
        assert run.returncode == 0, shown.decode()
    return out


def assert_same_tables(one: Path, other: Path) -> None:
    """Compare all tables, and the logs of results."""
    found = tables(other)
    for name, frame in tables(one).items():
        pd.testing.assert_frame_equal(found[name], frame)
    assert results(other) == results(one)


def results(out: Path) -> list[tuple[str, int, str]]:
    """Return all events and results in the log of the one site."""
    [path] = out.glob("sites/*/results.mcap")
    events = [item for item in read_log(path) if isinstance(item, Event)]
    return [(event.topic, event.time, json.dumps(event.payload)) for event in events]


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_killed_worker_costs_no_log(modalwatch: Commands, tmp_path: Path) -> None:
    """The scheduler gives its logs to the other one; the tables are those of a run without a loss."""
    logs = archive(tmp_path / "logs", 4)
    (logs / "poisoned.mcap").unlink()
    assert modalwatch("reanalyse", logs, "-o", tmp_path / "whole", "--workers", 1).code == 0
    out = after_a_kill(tmp_path, logs, catalog.PIECE_BYTES)
    assert tables(out)["windows"].groupby("log").size().tolist() == [3] * 4
    assert_same_tables(tmp_path / "whole", out)


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_killed_worker_costs_no_piece_of_a_run(
    modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nine files of one run, each a piece; the quick case is in `test_pieces`."""
    monkeypatch.setattr(catalog, "PIECE_BYTES", 1)
    items = [item for item in read_log(RECORDED) if not (isinstance(item, Event) and event_result(item))]
    write_run(tmp_path / "logs", items[:900], read_attachments(RECORDED), 7.0).close()
    assert modalwatch("reanalyse", tmp_path / "logs", "-o", tmp_path / "whole", "--workers", 1).code == 0
    out = after_a_kill(tmp_path, tmp_path / "logs", 1)
    assert len(tables(out)["logs"]) > 7
    assert len(tables(out)["windows"]) > 3
    assert_same_tables(tmp_path / "whole", out)


@pytest.mark.thorough
@pytest.mark.timeout(300)
def test_lost_scheduler_is_one_clear_error_and_a_repeated_run_continues(modalwatch: Commands, tmp_path: Path) -> None:
    logs, out = archive(tmp_path / "logs", 4), tmp_path / "out"
    (logs / "poisoned.mcap").unlink()
    with cluster(tmp_path) as (address, processes):
        command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "reanalyse", str(logs)]
        options = ["-o", str(out), "--scheduler", address]
        with subprocess.Popen([*command, *options], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as run:
            until(lambda: list((out / "steps").glob("*")), run)
            processes[0].send_signal(signal.SIGKILL)
            _, error = run.communicate(timeout=120)
        text = f"error: --scheduler: {address}: the connection was lost: repeat the command\n"
        assert (run.returncode, error.decode()) == (2, text)
    assert "identified by an earlier run" in modalwatch("reanalyse", logs, "-o", out, "--dry-run").out
    assert modalwatch("reanalyse", logs, "-o", out, "--workers", 1).code == 0
    assert tables(out)["windows"].groupby("log").size().tolist() == [3] * 4

"""The analysis process and the signals that a group of processes is sent."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from daq import Event
from monitor.results.innovations import ModeInnovations
from monitor.results.residuals import ChannelResiduals
from monitor.results.service_events import Stopped
from monitor.results.windows import ReferenceResult, WindowResult
from monitor.rig import draw_t_frame
from monitor.service.worker import AnalysisError, Worker, WorkerMessage
from tests.support.monitor.recorded_runs import START, site_toml
from tests.support.monitor.rig import rig_blocks, rig_site_text
from updater import t_structure_toml

pytestmark = pytest.mark.live

STOPPED = Stopped().event(START)
MOST_WAITING = 300  # blocks of 0.2 s of six devices: 10 s


def worker() -> Worker:
    return Worker(t_structure_toml(), site_toml(window=20.0, baseline_windows=8, rate=500.0))


def pid() -> int:
    (process,) = (p for p in multiprocessing.active_children() if p.name == "analysis")
    return process.pid or 0


def results(running: Worker) -> list[WorkerMessage | None]:
    """Wait for results, 40 s at the most."""
    end = time.monotonic() + 40
    while time.monotonic() < end:
        if found := list(running.results(0.5)):
            return found
    raise AssertionError("nothing came within 40 s")


def test_analysis_continues_after_stop_signals_to_the_process_group() -> None:
    """As a service manager and Ctrl-C do; waiting items are still analysed, and the last item ends it."""
    with worker() as running:
        for number in (signal.SIGINT, signal.SIGTERM):
            os.kill(pid(), number)
        running.feed(STOPPED)
        assert results(running) == [None]


def test_killed_analysis_raises_an_error() -> None:
    with worker() as running:
        os.kill(pid(), signal.SIGKILL)
        with pytest.raises(AnalysisError, match="ended with code -9"):
            results(running)


def test_queued_items_of_a_killed_analysis_are_discarded() -> None:
    """More than a pipe holds: the thread that hands it on would wait for good, with all of it."""
    before = feeders()
    with worker() as running:
        os.kill(pid(), signal.SIGKILL)
        with pytest.raises(AnalysisError, match="ended with code -9"):
            results(running)
        for _ in range(20):
            running.feed(Event(topic="/event/long", time=START, payload={"text": "x" * 100_000}))
        end = time.monotonic() + 20
        while feeders() > before and time.monotonic() < end:
            time.sleep(0.05)
        assert feeders() == before


def test_residuals_and_innovations_come_with_the_results() -> None:
    """They reach the service by the same queue as windows, from a process of its own; signals come as they are read."""
    print("seed 101")
    scenario = draw_t_frame("t_structure", 101, duration=0, between=None)
    site = rig_site_text(scenario, window=20.0, baseline_windows=8)
    found: list[WorkerMessage | None] = []
    with Worker(t_structure_toml(), site) as running:
        for block in rig_blocks(scenario, 390.0):
            while running.waiting > MOST_WAITING:
                found += running.results(0.1)
            running.feed(block)
        running.feed(STOPPED)
        while None not in found:
            found += results(running)
    windows = [one for one in found if isinstance(one, WindowResult)]
    assert len(windows) >= 18
    assert not any(window.skipped for window in windows)
    (reference,) = [one for one in found if isinstance(one, ReferenceResult)]
    innovations = [one for one in found if isinstance(one, ModeInnovations)]
    assert len(innovations) > 10
    assert sorted(innovations[0].mode) == sorted(mode.id for mode in reference.modes)
    assert found.index(reference) < found.index(innovations[0])
    assert any(isinstance(one, ChannelResiduals) for one in found)


def feeders() -> int:
    """Return how many threads hand items on to other processes."""
    return sum(thread.name == "QueueFeederThread" for thread in threading.enumerate())


ROOT = Path(__file__).parents[3]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}
ORPHAN = """
import os, signal
from tests.support.monitor.recorded_runs import site_toml
from monitor.service.worker import Worker
from updater import t_structure_toml
import multiprocessing
if __name__ == "__main__":
    with Worker(t_structure_toml(), site_toml(window=20.0, baseline_windows=8, rate=500.0)):
        print(multiprocessing.active_children()[0].pid, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_analysis_ends_when_its_parent_was_killed(tmp_path: Path) -> None:
    """The end of its pipe shows it, after a start of some seconds on a busy machine."""
    (tmp_path / "orphan.py").write_text(ORPHAN, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(tmp_path / "orphan.py")],
        capture_output=True,
        text=True,
        check=False,
        env=ENVIRONMENT,
        timeout=60,
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    stat = Path(f"/proc/{int(done.stdout)}/stat")
    end = time.monotonic() + 60
    while stat.exists() and " Z " not in stat.read_text() and time.monotonic() < end:
        time.sleep(0.2)
    assert not stat.exists() or " Z " in stat.read_text()


KILLED = """
import os, signal, time
from tests.support.monitor.recorded_runs import site_toml
from daq import Event
from monitor.service.worker import Worker
from updater import t_structure_toml
with Worker(t_structure_toml(), site_toml(window=20.0, baseline_windows=8, rate=500.0)) as running:
    print(running._process.pid, flush=True)
    running.feed(Event(topic="/event/long", time=0, payload={"text": 10_000_000 * "x"}))
    time.sleep(0.2)  # the pipe is full now: the child has yet to load numpy
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_analysis_ends_when_its_parent_was_killed_while_sending() -> None:
    with subprocess.Popen([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as killed:
        assert killed.stdout is not None
        child = int(killed.stdout.readline())
        assert killed.wait(30) == -signal.SIGKILL
    end = time.monotonic() + 60
    while psutil.pid_exists(child) and psutil.Process(child).status() != psutil.STATUS_ZOMBIE:
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            raise AssertionError("it still waits after 60 s")
        time.sleep(0.1)

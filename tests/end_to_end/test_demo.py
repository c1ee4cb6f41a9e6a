"""The demo as a process, the way a user starts it, at its shorter length."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from daq import read_log
from monitor.cli.demo.demonstration import SHORT
from monitor.results.windows import WindowResult
from monitor.service.replay import replay
from tests.support.monitor.recorded_runs import logged_results

pytestmark = [pytest.mark.live, pytest.mark.xdist_group("busy")]

MODALWATCH = [sys.executable, "-c", "from monitor.cli.main import main; main()"]
SEED = 7


def short_demo(out: Path) -> dict[str, Any]:
    """Run it; return its answer."""
    command = [*MODALWATCH, "demo", "--short", "--seed", str(SEED), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr
    found: dict[str, Any] = json.loads((out / "answer.json").read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a demo, and its answer."""
    print(f"seed {SEED}")
    out = tmp_path_factory.mktemp("demo")
    return out, short_demo(out)


@pytest.mark.timeout(500)
def test_short_demo_finds_the_body(demo: tuple[Path, dict[str, Any]]) -> None:
    """No scan is lost between rig and log."""
    out, answer = demo
    assert answer["right"] is True
    assert answer["dropped"] == 0
    assert answer["answer"]["mass_std"] > 0
    assert (out / "overview.rrd").stat().st_size > 100_000
    assert "The structure has changed" in (out / "report.html").read_text(encoding="utf-8")
    windows = [r for r in logged_results(next((out / "log").glob("*.mcap"))) if isinstance(r, WindowResult)]
    assert not any(window.skipped for window in windows)
    assert len(windows) <= SHORT.windows + 4  # the rig waits for the analysis: two windows, and those in progress


@pytest.mark.thorough  # by default the log of a restarted monitor is replayed, and the recorded log of the repository
@pytest.mark.timeout(500)
def test_replay_of_the_demo_is_identical(demo: tuple[Path, dict[str, Any]]) -> None:
    """The log alone gives the same modes and the same alarm."""
    report = replay(next((demo[0] / "log").glob("*.mcap")), None, lambda _: None)
    assert len(report.logged) > 15
    assert report.same


@pytest.mark.thorough
def test_ctrl_c_stops_cleanly_with_a_complete_log(tmp_path: Path) -> None:
    command = [*MODALWATCH, "demo", "--short", "--seed", "8", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    log = _growing_log(tmp_path, process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, out + err
    assert "Traceback" not in err, err
    items = list(read_log(log))
    assert items[-1].topic == "/event/stopped" or len(items) > 100  # type: ignore[union-attr]
    assert log.read_bytes()[-8:] == b"\x89MCAP0\r\n"  # finished: stock readers open it


def _growing_log(folder: Path, process: subprocess.Popen[str]) -> Path:
    """Wait for a log that holds some chunks, a second's data or more."""
    end = time.monotonic() + 40
    while time.monotonic() < end:
        for log in (folder / "log").glob("*.mcap"):
            if log.stat().st_size > 500_000:
                return log
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
    raise AssertionError("no log of 500 kB within 40 s")

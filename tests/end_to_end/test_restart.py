"""A monitor that is killed and restarted continues; its second log alone replays the same."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from daq import read_attachments
from monitor.results.windows import AlarmResult, ReferenceResult, WindowResult
from monitor.rig import T_DEVICES
from monitor.service.replay import replay
from monitor.watch.memory import MEMORY, Memory, parse_memory
from tests.support.monitor.recorded_runs import logged_results

pytestmark = pytest.mark.live  # its devices are a log, which waits: beside what must keep up with time it may run

RECORDED = Path(__file__).parents[2] / "replay_data" / "t_frame_added_mass.mcap"
MODALWATCH = [sys.executable, "-c", "from monitor.cli.main import main; main()"]
SPEED = 6.0  # a window per 2 s: few more than are compared wait for analysis when a run ends, also on a busy machine
SLOWER = 2.0  # the reload and what waits for analysis take up to 40 s on a busy machine: the log must last longer
DEVICES = ("col_111", "beam_left", "beam_right")
WINDOW = 12.0  # s: the frame's first modes have a hundred periods in it


def make_site(folder: Path, *, model: bool = True, speed: float = SPEED) -> Path:
    """Write settings that play the recorded log as three devices, learning from the first minute."""
    attached = read_attachments(RECORDED)
    (folder / "t_structure.toml").write_text(attached["structure.toml"], encoding="utf-8")
    (folder / "recorded.mcap").symlink_to(RECORDED)
    lines = ['structure = "t_structure.toml"'] * model
    lines += ["[analysis]", f"window_seconds = {WINDOW}", "baseline_windows = 5"]
    lines += ["[clock]", f"speed = {speed}"]
    for name in DEVICES:
        _, axes = T_DEVICES[name]
        mapped = ", ".join(f'{axis} = "{name}_{axis}"' for axis in axes)
        lines += ["[[device]]", f'name = "{name}"', 'driver = "replay"', "rate = 500", f"channels = {{{mapped}}}"]
        lines += [f'log = {{file = "recorded.mcap", device = "{name}"}}']
    (folder / "site.toml").write_text("\n".join(lines), encoding="utf-8")
    return folder / "site.toml"


def remembered(state: Path, process: subprocess.Popen[str], n_windows: int) -> Memory:
    """Wait until so many windows are remembered."""
    end = time.monotonic() + 100
    while time.monotonic() < end:
        if (state / MEMORY).exists():
            memory = parse_memory((state / MEMORY).read_text(encoding="utf-8"))
            if memory.n_windows >= n_windows:
                return memory
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    raise AssertionError(f"{n_windows} windows are not remembered within 100 s")


@contextmanager
def started(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Run a command; it is killed at the end of the context if it still runs."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment) as process:
        try:
            yield process
        finally:
            process.kill()


def test_killed_monitor_resumes_monitoring_after_restart(tmp_path: Path) -> None:
    command = [*MODALWATCH, "run", str(make_site(tmp_path))]
    with started(command) as first:
        memory = remembered(tmp_path / "state", first, 6)
    assert memory.detector is not None  # it was watching when it was killed

    with started(command) as second:
        now = remembered(tmp_path / "state", second, memory.n_windows + 1)
        second.send_signal(signal.SIGTERM)
        out, err = second.communicate(timeout=120)  # it analyses what it has received, for up to 80 s
    assert (second.returncode, err) == (0, ""), out
    assert "monitoring continues with the baseline of 5 windows" in out
    assert [w.start for w in now.baseline] == [w.start for w in memory.baseline]

    log = max((tmp_path / "log").glob("*.mcap"))
    kinds = [type(result) for result in logged_results(log)]
    assert kinds[:2] == [ReferenceResult, AlarmResult]
    windows = [result for result in logged_results(log) if isinstance(result, WindowResult)]
    assert windows[0].index == memory.n_windows
    assert all(window.phase != "learning" for window in windows)
    report = replay(log, None, lambda _: None)
    assert len(report.logged) >= 3
    assert report.same


def test_model_is_added_to_a_service_without_learning_anew(tmp_path: Path) -> None:
    """The settings are read again by SIGHUP: baseline, detector and numbers of the modes stay."""
    site = make_site(tmp_path, model=False, speed=SLOWER)
    with started([*MODALWATCH, "run", str(site)]) as service:
        before = remembered(tmp_path / "state", service, 6)
        assert before.without_model
        site.write_text('structure = "t_structure.toml"\n' + site.read_text(encoding="utf-8"), encoding="utf-8")
        service.send_signal(signal.SIGHUP)
        after = remembered(tmp_path / "state", service, before.n_windows + 1)
        while after.without_model:  # windows of the first log are still analysed
            after = remembered(tmp_path / "state", service, after.n_windows + 1)
        service.send_signal(signal.SIGTERM)
        out, err = service.communicate(timeout=120)
    assert (service.returncode, err) == (0, ""), out
    assert "the model of the structure file is learned from this baseline" in out
    assert [w.start for w in after.baseline] == [w.start for w in before.baseline]
    first, second = sorted((tmp_path / "log").glob("*.mcap"))
    (bare,), (modelled,) = (
        [r for r in logged_results(log) if isinstance(r, ReferenceResult)] for log in (first, second)
    )
    assert not bare.has_model
    assert modelled.has_model
    assert len(modelled.modes) >= 3
    frequency = {mode.id: mode.frequency for mode in bare.modes}
    assert {mode.id: mode.frequency for mode in modelled.modes}.items() <= frequency.items()
    windows = [result for result in logged_results(second) if isinstance(result, WindowResult)]
    assert all(window.phase != "learning" for window in windows)

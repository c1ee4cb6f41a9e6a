"""`replay`, `report`, `view` and `log export` of a range of a log."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from daq import Block, McapWriter, read_data
from daq.drivers import EPSON_SCALE
from monitor.analysis.time_range import time_range
from monitor.errors import ResultsError
from monitor.results.run_results import RunResults
from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult, result_event
from monitor.service.replay import replay, write_watched
from monitor.text.verdicts import changed_between, last_state
from monitor.views.report.content import run_content
from monitor.views.run import load_run
from monitor.watch.memory import MEMORY
from tests.support.monitor.cli import Commands, assert_refused

REPLAY = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
START = 1_767_225_600_000_000_000  # 2026-01-01T00:00:00Z
SECOND = 10**9


def test_replay_of_a_range(tmp_path: Path) -> None:
    """Up to --to it repeats the live run; from --from on it is a separate run."""
    begun = replay(time_range(None, "40").of_log(REPLAY), None, lambda _: None)
    assert [r.index for r in begun.found if isinstance(r, WindowResult)] == [0, 1]
    watched = tmp_path / "watched.mcap"
    write_watched(time_range(None, "40").of_log(REPLAY), watched, begun)
    again = replay(time_range(None, "30").of_log(watched), None, lambda _: None)
    assert (again.from_beginning, len(again.logged), again.comparison.kind) == (True, 1, "identical")
    later = replay(time_range("12", None).of_log(watched), None, lambda _: None)
    assert (later.from_beginning, later.logged, MEMORY in later.attached) == (False, [], False)
    (window,) = (r for r in later.found if isinstance(r, WindowResult))
    assert window.index == 0
    begin = next(r.start for r in begun.found if isinstance(r, WindowResult))
    assert begin + 3 * SECOND < window.start < begin + 13 * SECOND


def second(k: int) -> Block:
    """Return a second of a device."""
    return Block(
        device="a",
        rate=200.0,
        first_index=200 * k,
        counts=np.full((200, 3), k, np.int32),
        scale=EPSON_SCALE,
        arrival_index=200 * k,
        arrival_time=START + k * SECOND,
        temperature=20.0,
    )


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a log of 60 windows of a second: a baseline at 10 s, alarms from 20 to 30 s and from 40 s on."""
    path = tmp_path / "run.mcap"
    writer = McapWriter(path, {})
    for k in range(60):
        end = START + (k + 1) * SECOND
        writer.write(second(k))
        phase: Literal["learning", "watching", "alarm"] = (
            "learning" if k < 10 else "alarm" if 20 <= k < 30 or k >= 40 else "watching"
        )
        results: list[Result] = [
            WindowResult(index=k, start=end - SECOND, end=end, phase=phase, channels=["a_x"], modes=[])
        ]
        if k == 9:
            results.append(
                ReferenceResult(time=end, n_windows=10, nodes=[], lines={}, sensors={}, modes=[], calibrated={})
            )
        if k in {19, 29, 39}:
            state: Literal["normal", "alarm"] = "normal" if k == 29 else "alarm"
            results.append(AlarmResult(time=end, state=state, text=f"{state} {k}", window=k))
        for result in results:
            writer.write(result_event(result))
        writer.flush()
    writer.close()
    return path


@pytest.mark.parametrize(
    ("start", "stop", "windows", "alarms", "state"),
    [
        (None, None, (0, 59), ["alarm 19", "normal 29", "alarm 39"], "alarm"),
        (None, "15", (0, 14), [], "normal"),
        ("15", "25.5", (15, 24), ["alarm 19"], "alarm"),
        ("22.5", "25.5", (23, 24), ["alarm 19"], "alarm"),
        ("33", "38", (33, 37), [], "normal"),
        ("-5", None, (55, 59), ["alarm 39"], "alarm"),
    ],
)
def test_results_loaded_from_a_range(
    run: Path, start: str | None, stop: str | None, windows: tuple[int, int], alarms: list[str], state: str
) -> None:
    found = load_run(run, time_range(start, stop))
    run_results = found.results
    # a window that ends with the range has its result at that time, which is not within it
    last = windows[1] - (stop is not None and float(stop).is_integer())
    assert (run_results.windows[0].index, run_results.windows[-1].index) == (windows[0], last)
    assert [alarm.text for alarm in run_results.alarms] == alarms
    assert last_state(run_results) == state
    assert run_results.reference is not None
    if start in {"22.5", "-5"}:
        assert changed_between(run_results) is None
    span = len(range(windows[0], windows[1] + 1))
    assert abs(found.devices[0].scans / 200 - span) <= 1.0


def test_report_of_a_range_counts_baseline_windows_separately(run: Path) -> None:
    facts = dict(run_content(load_run(run, time_range("5", "15.5")), None)["facts"])
    assert facts["Range"] == "5 to 15.5 s of the log"
    assert facts["Windows"] == (
        "10 in the range, 5 of them before the end of the baseline; the baseline has 10 windows of the log"
    )
    assert dict(run_content(load_run(run), None)["facts"])["Windows"] == "10 baseline, 50 monitored"


def test_a_range_without_a_whole_window_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    writer = McapWriter(path, {})
    for k in range(5):
        writer.write(second(k))
    writer.close()
    with pytest.raises(ResultsError, match=r"run\.mcap \(0 to 2\.5 s\): holds no result of a whole window"):
        load_run(path, time_range(None, "2.5"))


def test_commands_accept_a_range(
    modalwatch: Commands, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[RunResults] = []
    monkeypatch.setattr("monitor.cli.data.log_views.run_report", lambda run, *_, **__: drawn.append(run.results))
    monkeypatch.setattr("monitor.views.viewer.write_recording", lambda _, run_results: drawn.append(run_results))
    for command, *options in (("report",), ("view", "--no-open")):
        done = modalwatch(command, run, "--from", 35, "--to", 50, "--out", tmp_path / command, *options)
        assert (done.code, done.err) == (0, "")
        assert "range: 35 to 50 s of 60 s, 2026-01-01T00:00:35Z to 2026-01-01T00:00:50Z" in done.out
    assert [(run_results.windows[0].index, run_results.windows[-1].index) for run_results in drawn] == [(35, 48)] * 2
    done = modalwatch("report", run, "--from", 35, "--to", 49.5)  # does not replace the page of the whole log
    assert f"report: {run.with_name('run_35-49.5s.html')}" in done.out
    done = modalwatch("view", "rerun+http://127.0.0.1:1/proxy", "--to", 50)
    assert_refused(done, "--from, --to: expected a log, found the address of a monitor")
    done = modalwatch("log", "export", REPLAY, "--from", 20, "--to", 30, "-o", tmp_path / "part.npz")
    assert (done.code, done.err) == (0, "")
    found = read_data(tmp_path / "part.npz")
    assert 9.5 < found.duration < 10
    done = modalwatch("log", "expand", run, "--from", 20, "--to", 30, "-o", tmp_path / "part.mcap")
    assert (done.code, done.err) == (0, "")
    assert "2000 messages" in done.out

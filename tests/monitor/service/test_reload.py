"""Settings read again during a run: unchanged parts continue without a gap."""

import json
import time
from itertools import pairwise
from pathlib import Path

import pytest

from daq import Flag
from tests.support.monitor.history import rows, sqlite_url
from tests.support.monitor.runs import LawState, QuietWorker, blocks, watched_site
from tests.support.monitor.service.manager import Listener
from tests.support.processes import script_process


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LawState:
    return watched_site(tmp_path, monkeypatch)


@pytest.mark.live
def test_reload_loses_no_scan_of_unchanged_devices(
    watched: LawState, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A device moves to another port, gets another rate; a bad file is refused; the other one streams on.

    The service manager is informed; a dead analysis, and one that has fallen behind, are replaced.
    """
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setenv("WATCHDOG_USEC", "400000")
    script, notifications = (
        Path(__file__).parents[2] / "support" / "daq" / "emulated_ports.py",
        Listener(str(tmp_path / "notify")),
    )
    now = time.time_ns()
    with script_process(script, 3, 1, now, now) as (_, reported):
        left, right, spare = json.loads(reported)
        watched.write({"beam_left": (left, 500.0), "beam_right": (right, 500.0)})
        with watched.running() as ended:
            watched.until(lambda: watched.scans("beam_left") and watched.scans("beam_right"))
            for place, rate, stated in ((spare, 500.0, 1), (spare, -1.0, 1), (spare, 200.0, 2)):
                watched.write({"beam_left": (left, 500.0), "beam_right": (place, rate)})
                watched.reload()
                what = "reloaded" if rate > 0 else "reload_refused"
                watched.until_told(what, stated)
                watched.flows("beam_right")
            QuietWorker.made[-1].died = True
            watched.until(lambda: len(QuietWorker.made) == 3)
            QuietWorker.made[-1].waiting = 60_001  # ten windows of ten minutes of two devices
            watched.until(lambda: len(QuietWorker.made) == 4)
            watched.flows("beam_right")
            watched.stop()
            report = ended.result()
        assert notifications.received("STOPPING=1", 5.0)
    _assert_told(watched)
    [state] = rows(sqlite_url(tmp_path / "state"), "site_states")
    assert (state["state"], state["window_age"]) == ("learning", None)
    assert len(report.logs) == 4  # another rate takes another log, and so does another analysis
    steady = blocks(report.logs, "beam_left")
    assert [b.first_index for b in steady] == [0, *(b.end_index for b in steady[:-1])]  # every scan, once, in order
    assert not any(block.flags & Flag.RESTARTED for block in steady)
    first = blocks(report.logs[:1], "beam_right")
    assert len([block for block in first if block.flags & Flag.RESTARTED]) == 1
    assert all(b.first_index >= a.end_index for a, b in pairwise(first))
    assert {block.rate for block in blocks(report.logs[1:], "beam_right")} == {200.0}
    assert [reported.split("=")[0] for reported in notifications.reported if reported.startswith(("READY", "REL"))] == [
        "READY",
        *_ANEW,
        *_ANEW,
    ]
    assert {"WATCHDOG=1", "STATUS=no window yet; 2 of 2 devices"} <= set(notifications.reported)


_ANEW = ("RELOADING", "READY")


def _assert_told(watched: LawState) -> None:
    """Assert that the log contains the change, and that only the device that was moved has a gap."""
    moved, rated = (event.payload for event in watched.events("reloaded"))
    assert moved == {"changed": "device beam_right"}
    assert rated == {"changed": "device beam_right, log and analysis"}
    [refused] = watched.events("reload_refused")
    assert "site.toml: device.1.rate: expected greater than or equal to 0.001" in refused.payload["why"]
    assert [event.payload["device"] for event in watched.events("gap")] == ["beam_right"]
    assert [event.payload["left_out_s"] for event in watched.events("analysis_lagging")] == [6000.1]
    assert [event.payload["again_in_s"] for event in watched.events("analysis_failed")] == [1.0]

"""Demos of shipped scenarios, as processes: devices over the wire, alarm, and the answer compared with the events."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from monitor.results.windows import WindowResult
from monitor.service.replay import replay
from tests.support.monitor.recorded_runs import logged_results

MODALWATCH = [sys.executable, "-c", "from monitor.cli.main import main; main()"]


def assert_is_found(scenario: str, folder: Path) -> None:
    """A demo plays a scenario from emulated devices, and the answer is right."""
    command = [*MODALWATCH, "demo", "--scenario", scenario, "--speed", "8", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, check=False)
    print(done.stdout[-3000:], done.stderr)
    assert done.returncode == 0
    assert json.loads((folder / "answer.json").read_text(encoding="utf-8"))["right"] is True


@pytest.mark.live
@pytest.mark.thorough
@pytest.mark.xdist_group("busy")
@pytest.mark.timeout(1500)
def test_crack_of_the_rig_is_stated_to_open_and_close(tmp_path: Path) -> None:
    """Place within 5 cm, share within three deviations; the log gives the same answers again, bit for bit."""
    assert_is_found("breathing-crack", tmp_path)
    assert "it opens and closes" in (tmp_path / "report.html").read_text(encoding="utf-8")
    log = next((tmp_path / "log").glob("*.mcap"))
    found = [r.diagnosis for r in logged_results(log) if isinstance(r, WindowResult) and r.diagnosis]
    (cause,) = found[-1].causes
    print(cause)
    assert cause.where
    assert cause.where.position == pytest.approx((0.0, 0.0, 0.3), abs=0.05)
    assert cause.breathing
    assert cause.breathing.significant
    assert abs(cause.breathing.share.value - 1) < 3 * cause.breathing.share.std
    assert replay(log, None, lambda _: None).same


@pytest.mark.live
@pytest.mark.thorough
@pytest.mark.xdist_group("busy")
@pytest.mark.timeout(1500)
def test_tank_that_fills_is_found_within_the_record(tmp_path: Path) -> None:
    """Place within 10 cm, rate within 15 % or three deviations; the log of the run is diagnosed."""
    assert_is_found("filling-tank", tmp_path)
    found = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))["within_record"]
    assert found["kind"] == "gradual"
    assert [cause["cause"] for cause in found["causes"]] == ["added_mass"]

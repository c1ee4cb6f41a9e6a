"""A body is hidden in a fresh simulation of another structure than the reference model: the replay must find it."""

import json
from pathlib import Path

import numpy as np
import pytest

from monitor.cli.data.importing.import_ import import_
from monitor.cli.logs.export import export
from monitor.cli.logs.replay import replay as replay_command
from monitor.rig import draw_t_frame
from monitor.service.replay import replay
from tests.support.monitor.recorded_runs import site_toml, write_log
from updater import t_structure_toml

WINDOW, BASELINE, AFTER, RATE = 20.0, 8, 3, 500.0
SITE = site_toml(window=WINDOW, baseline_windows=BASELINE, rate=RATE)


def hidden(tmp_path: Path, seed: int, *, added: bool) -> tuple[Path, np.ndarray, float]:
    """Write a log in which something happens, or nothing; return it with the truth."""
    print(f"seed {seed}")
    before = (BASELINE + 1) * WINDOW
    scenario = draw_t_frame("t_structure", seed, duration=0, between=(before, before + 5), rate=RATE)
    body = scenario.event[0].body
    assert body
    scenario = scenario if added else scenario.model_copy(update={"event": ()})
    log = tmp_path / "log.mcap"
    write_log(log, scenario, before + (AFTER + 1) * WINDOW, SITE)
    return log, np.array(body.at), body.mass


def through_a_table(log: Path) -> Path:
    """Export a log as a table and import that, as measurements come that another system made."""
    table, imported, site = log.with_name("table.csv"), log.with_name("imported.mcap"), log.with_name("site.toml")
    site.write_text(SITE, encoding="utf-8")
    log.with_name("t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    assert export([log], table) == 0
    assert import_([table], imported, site=site) == 0
    return imported


@pytest.mark.thorough
def test_replay_of_an_imported_table_finds_the_hidden_mass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Within 0.10 m and 15 %, though windows are short and only six or seven modes are in the band.

    The repository's own log, straight from a rig, is replayed in test_replay_data.py.
    """
    log, at, mass = hidden(tmp_path, 33, added=True)
    assert replay_command([through_a_table(log)], json=tmp_path / "found.json") == 1  # an alarm: a person is needed
    assert "`-o WATCHED.mcap` writes a log with these results" in " ".join(capsys.readouterr().out.split())
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))["results"]
    alarms = [r for r in found if r.get("state") == "alarm"]
    assert len(alarms) == 1
    before_event = [r for r in found if r.get("phase") == "watching"]
    assert before_event, "there was a quiet window after the baseline"
    answer = [r["answer"] for r in found if r.get("answer")][-1]
    assert np.linalg.norm(np.subtract(answer["position"], at)) < 0.10
    assert answer["mass"] == pytest.approx(mass, rel=0.15)


@pytest.mark.thorough
def test_replay_without_change_raises_no_alarm_and_is_repeatable(tmp_path: Path) -> None:
    """Results do not depend on later data, either: the second log is cut."""
    log, _, _ = hidden(tmp_path, 41, added=False)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size * 3 // 4])
    first, second = (replay(path, None, lambda _: None) for path in (log, cut))
    assert len(second.found) > BASELINE + 1  # with windows that were watched
    assert [r.payload() for r in first.found[: len(second.found)]] == [r.payload() for r in second.found]
    assert not [r for r in first.found if getattr(r, "state", "normal") != "normal"]
    assert not first.logged

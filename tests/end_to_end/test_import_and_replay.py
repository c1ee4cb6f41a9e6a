"""Measurements that come as a table are watched like a site's own: exported, imported, replayed, the mass is found."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from daq import read_attachments
from monitor.cli.importing import ImportOptions, import_command
from monitor.cli.logs import export_command
from monitor.cli.watch import replay_command

FOLDER = Path(__file__).parents[2] / "replay_data"


def test_a_table_of_the_recorded_log_holds_the_same_change(tmp_path: Path) -> None:
    truth = tomllib.loads((FOLDER / "manifest.toml").read_text(encoding="utf-8"))["log"][0]
    recorded = FOLDER / truth["file"]
    attached = read_attachments(recorded)
    (tmp_path / "site.toml").write_text(attached["site.toml"], encoding="utf-8")
    (tmp_path / "t_structure.toml").write_text(attached["structure.toml"], encoding="utf-8")

    table, log, found = tmp_path / "table.csv", tmp_path / "log.mcap", tmp_path / "found.json"
    assert export_command([recorded], table) == 0
    assert import_command(table, log, ImportOptions(site=tmp_path / "site.toml")) == 0
    assert replay_command([log], None, found) == 1  # it ends in an alarm

    windows = [r for r in json.loads(found.read_text(encoding="utf-8"))["results"] if "modes" in r and "index" in r]
    answer = [window["answer"] for window in windows if window["answer"]][-1]
    # the demo's own limits for what is found rightly
    assert np.linalg.norm(np.subtract(answer["position"], truth["position"])) < 0.10
    assert answer["mass"] == pytest.approx(truth["mass"], rel=0.15)

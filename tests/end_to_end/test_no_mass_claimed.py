"""A change that is no mass: the monitor raises its alarm, and states the cause instead of the position of a mass."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq import write_recording
from monitor.results.windows import AlarmResult, WindowResult
from monitor.service.replay import replay
from monitor.settings import parse_settings
from monitor.text.causes import change_text
from tests.measured.accelerometers import Rig
from tests.support.monitor.recorded_runs import site_toml
from updater import t_structure_toml

WINDOW, BASELINE, RATE = 20.0, 8, 500.0


def watch(folder: Path, seed: int, after: Rig) -> list[WindowResult]:
    """Monitor a rig that changes after the baseline; return the windows in which the alarm is active."""
    print(f"seed {seed}")
    quiet = Rig(seed=seed).record(0, (BASELINE + 1) * WINDOW, rate=RATE)
    changed = after.record(1, 4 * WINDOW, rate=RATE)
    log = folder / "log.mcap"
    site = site_toml(window=WINDOW, baseline_windows=BASELINE, rate=RATE)
    devices = {c.name: c for c in parse_settings(site, "site.toml").channels}
    whole = replace(
        quiet,
        channels=tuple(devices[c.name] for c in quiet.channels),
        data=np.concatenate([quiet.data, changed.data]),
    )
    write_recording(log, whole, {"site.toml": site, "structure.toml": t_structure_toml()})
    found = replay(log, None, lambda _: None).found
    alarms = [r for r in found if isinstance(r, AlarmResult) and r.state == "alarm"]
    assert len(alarms) == 1
    assert alarms[0].window > BASELINE
    return [r for r in found if isinstance(r, WindowResult) and r.phase == "alarm"]


@pytest.mark.thorough
def test_loosened_foot_is_not_reported_as_a_mass(tmp_path: Path) -> None:
    windows = watch(tmp_path, 61, Rig(seed=61, foot=(0.5, 0.5, 1.0)))
    diagnoses = [w.diagnosis for w in windows if w.diagnosis]
    print(*(change_text(d) for d in diagnoses), sep="\n")
    assert diagnoses
    assert not [w.answer for w in windows if w.answer]
    assert "support_stiffness" in {name for c in diagnoses[-1].causes for name in (c.cause, *c.cannot_be_told_from)}

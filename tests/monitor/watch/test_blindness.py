"""A sensor that dies during monitoring is reported by the windows, the page and the check of the sensors."""

from pathlib import Path

import numpy as np
import pytest

from daq import SystemClock
from monitor.results.site_status import FILE_NAME, read_status
from monitor.results.windows import WindowResult, result_event
from monitor.service.servers.web.source import problems
from monitor.service.status import MonitorStatus, Pace
from monitor.watch.blindness import MissingChannels
from tests.support.monitor.played_windows import BASELINE, Played, judged, run
from tests.support.monitor.service.status import WELL

DEAD = "beam_left_y"


def test_failed_sensor_is_reported_and_excluded_from_the_sensor_check(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    played = Played(31, monkeypatch)
    pipeline = played.pipeline()
    calm = judged(run(pipeline, played.windows(BASELINE + BASELINE // 2)))
    played.dead = {DEAD: "constant"}
    last = judged(run(pipeline, played.windows(BASELINE - BASELINE // 2)))
    assert all(window.faults == {} for window in calm)
    assert all(window.faults == {DEAD: "constant"} and DEAD not in window.channels for window in last)
    looked = [window for window in (*calm, *last) if window.sensors]
    assert looked == [last[-1]]
    assert DEAD not in looked[0].sensors
    assert len(looked[0].sensors) == 11
    for n, message in ((0, []), (1, []), (2, [f"{DEAD} is left out: constant"])):
        status = MonitorStatus(tmp_path / FILE_NAME, (), Pace(step=600.0, window=600.0), SystemClock())
        for window in (calm[-1], *last[:n]):
            status.take(result_event(window))
        status.write(*WELL)
        assert problems(read_status(tmp_path / FILE_NAME)) == message
    assert np.isfinite([window.novelty.t2 for window in last if window.novelty]).all()


def test_dead_channel_removed_from_settings_is_not_reported_as_recovered() -> None:
    dead = WindowResult(
        index=0, start=0, end=1, phase="watching", channels=["a", "b"], faults={"c": "constant"}, modes=[], rms={}
    )
    known = MissingChannels().after(dead).after(dead)
    assert known.gone == ((("c",), "constant"),)
    without = known.after(dead.model_copy(update={"faults": {}}))
    assert (without.texts, without.back) == ([], ())
    again = known.after(dead.model_copy(update={"faults": {}, "channels": ["a", "b", "c"]}))
    assert (again.texts, again.back) == ([], ("c",))

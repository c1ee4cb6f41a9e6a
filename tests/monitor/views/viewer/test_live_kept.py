"""Content of a live view in years of monitoring: no more than it shows, and all of it is sent once."""

from collections import Counter
from pathlib import Path

import pytest
import rerun as rr

from monitor.results.run_results import RunResults
from monitor.results.windows import AlarmResult, WindowResult
from monitor.settings import parse_settings
from monitor.views.viewer.live import LiveResults
from monitor.views.viewer.primitives import APPLICATION
from monitor.views.viewer.state_lanes import events, state_changes
from tests.support.monitor import answers
from tests.support.monitor import results as made
from tests.support.monitor.rrd_reader import Rrd

SITE = made.Site()
N_LEARNING, N_WATCHED = 5, 85
SETTINGS = """structure = "t_structure.toml"
[analysis]
baseline_windows = 5
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y"}
"""


@pytest.fixture(scope="module")
def run() -> RunResults:
    """Return a watch with troubled windows now and then, the last in the very last one, and two alarms."""
    template = made.whole_run(SITE, n_learning=N_LEARNING, n_before=2, n_after=2)
    windows: list[WindowResult] = template["windows"][:N_LEARNING]
    calm = template["windows"][N_LEARNING]
    for index in range(N_LEARNING, N_LEARNING + N_WATCHED):
        start = made.START + index * made.WINDOW
        place = {"index": index, "start": start, "end": start + made.WINDOW, "spectrum": None}
        window = calm.model_copy(update=place)
        windows.append(made.without_modes(window, "channel mid is flat") if index % 29 < 2 else window)
    alarms: list[AlarmResult] = template["alarms"][:1]
    for index in (40, 70):
        alarms.append(made.alarm(windows[index], "alarm", f"ALARM of window {index}"))
        alarms.append(made.alarm(windows[index + 7], "normal", f"over since window {index + 7}"))
    return RunResults(
        name="bridge", reference=template["reference"], windows=tuple(windows), alarms=tuple(alarms), signals=None
    )


def test_long_run_is_sent_once_with_limited_memory(run: RunResults, tmp_path: Path) -> None:
    recording = rr.RecordingStream(APPLICATION, recording_id="long")
    recording.save(tmp_path / "long.rrd")
    live = LiveResults(recording, run.name, parse_settings(SETTINGS))
    alarms = {alarm.time: alarm for alarm in run.alarms}
    kept = []
    for window in run.windows:
        live.add(window)
        if run.reference and window.end == run.reference.time:
            live.add(run.reference)
        live.add(alarms.get(window.end))
        kept.append(len(live._windows))
    recording.disconnect()
    rrd = Rrd(tmp_path / "long.rrd")
    assert max(kept) == 1 + 2 * 12  # of which the trends show the newest two dozen
    for lane in ("/state/daemon", "/state/structure"):
        times, states = rrd.rows(lane, "StateChange:state")
        expected = [(time, state) for path, time, state in state_changes(run) if path == lane]
        assert list(zip(times.tolist(), [state for (state,) in states], strict=True)) == expected
    times, _ = rrd.rows("/events", "TextLog:text")
    assert sorted(times.tolist()) == sorted(time for time, _, _ in events(run))


def test_static_data_are_sent_once_during_a_long_alarm(tmp_path: Path) -> None:
    """A server keeps all of it, before anything that has a time."""
    found = answers.with_findings(SITE, made.whole_run(SITE, n_learning=5, n_before=2, n_after=6))
    recording = rr.RecordingStream(APPLICATION, recording_id="alarm", send_properties=False)
    recording.save(tmp_path / "alarm.rrd")
    live = LiveResults(recording, "bridge", parse_settings(SETTINGS))
    live.add(found["reference"])
    for window in found["windows"]:
        live.add(window)
    recording.disconnect()
    batches = [(chunk.entity_path, chunk.to_record_batch()) for chunk in Rrd(tmp_path / "alarm.rrd").chunks]
    static = Counter(
        (path, name)
        for path, batch in batches
        if not {"time", "phase", "log_time", "log_tick"} & set(batch.schema.names)
        for name in batch.num_rows * batch.schema.names
        if ":" in name
    )
    assert static["/increments/x/supports", "Boxes3D:centers"] == 1
    assert not [what for what, times in static.items() if times > 1]


def test_axes_of_the_live_spectrum_follow_the_windows(run: RunResults, tmp_path: Path) -> None:
    """The frequencies of the second window are twice as high: its ticks reach as far, at its own time."""
    first = made.whole_run(SITE, n_learning=N_LEARNING, n_before=2, n_after=2)["windows"][0]
    assert first.spectrum
    higher = first.spectrum.model_copy(update={"frequency": [2 * f for f in first.spectrum.frequency]})
    modes = [mode.model_copy(update={"frequency": 2 * mode.frequency}) for mode in first.modes]
    place = {"index": 1, "start": first.end, "end": first.end + made.WINDOW}
    second = first.model_copy(update={"spectrum": higher, "modes": modes, **place})
    recording = rr.RecordingStream(APPLICATION, recording_id="axes")
    recording.save(tmp_path / "axes.rrd")
    live = LiveResults(recording, run.name, parse_settings(SETTINGS))
    live.add(first)
    live.add(second)
    recording.disconnect()
    times, labels = Rrd(tmp_path / "axes.rrd").rows("/spectrum/ticks", "Points2D:labels")
    assert times.tolist() == [first.end, second.end]
    ends = [float(next(label for label in row if label.endswith(" Hz")).removesuffix(" Hz")) for row in labels]
    assert ends[1] == pytest.approx(2 * ends[0], rel=0.2)


def test_live_view_has_the_channels_once_there_are_figures_of_them(run: RunResults, tmp_path: Path) -> None:
    windows = [w.model_copy(update={"rms": {"beam_left_y": 0.01 * (w.index + 1)}}) for w in run.windows[:3]]

    def recorded(name: str, shown: list[WindowResult], temperatures: list[tuple[int, float]]) -> Rrd:
        recording = rr.RecordingStream(APPLICATION, recording_id=name)
        recording.save(tmp_path / f"{name}.rrd")
        live = LiveResults(recording, run.name, parse_settings(SETTINGS))
        for time, celsius in temperatures:
            live.add_temperature("beam_left", time, celsius)
        for window in shown:
            live.add(window)
        recording.disconnect()
        return Rrd(tmp_path / f"{name}.rrd")

    second = 10**9
    start = windows[0].start
    warm = [(start, 20.0), (start + second, 21.0), (start + 2 * second, float("nan")), (start + 11 * second, 22.0)]
    rrd = recorded("with", windows, warm)
    assert {"/channels/rms", "/channels/temperature"} <= {view.origin for view in rrd.views}
    times, rms = rrd.scalars("/channels/rms/beam_left_y")
    assert times.tolist() == [w.end for w in windows]
    assert rms.tolist() == pytest.approx([0.01, 0.02, 0.03])
    times, celsius = rrd.scalars("/channels/temperature/beam_left")
    assert list(zip(times.tolist(), celsius.tolist(), strict=True)) == [warm[0], warm[3]]
    bare = [w.model_copy(update={"rms": {}}) for w in windows]
    assert not any(view.origin.startswith("/channels") for view in recorded("without", bare, []).views)

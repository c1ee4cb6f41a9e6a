"""A run read back from its log."""

import os
from pathlib import Path

import numpy as np
import pytest

from daq import Block, Channel, Event, Flag, McapWriter, Recording
from daq.drivers import EPSON_SCALE
from monitor.errors import ResultsError
from monitor.results.windows import Novelty, ReferenceResult, WindowResult
from monitor.views.run import find_log, last_signals, late_devices, load_run, slower

START = 1_767_225_600_000_000_000
RATE = 200.0
SITE = """structure = "t.toml"
[[device]]
name = "a"
driver = "epson-uart"
port = "/dev/a"
rate = 200.0
channels = {x = "a_x"}
[[device]]
name = "b"
driver = "epson-uart"
port = "/dev/b"
rate = 200.0
channels = {x = "b_x"}
"""


def block(device: str, second: int, flags: Flag = Flag.NONE) -> Block:
    """One second of a 3 Hz sine."""
    index = np.arange(200 * second, 200 * (second + 1))
    wave = np.round(1e5 * np.sin(2 * np.pi * 3 * index / RATE)).astype(np.int32)
    return Block(
        device=device,
        rate=RATE,
        first_index=int(index[0]),
        counts=np.column_stack([wave] * 3),
        scale=EPSON_SCALE,
        arrival_index=int(index[-1]),
        arrival_time=START + round(index[-1] / RATE * 1e9),
        temperature=20.0,
        flags=flags,
    )


def window(index: int) -> Event:
    end = START + (index + 1) * 10**9
    result = WindowResult(index=index, start=end - 10**9, end=end, phase="learning", channels=["a_x"], modes=[])
    return Event(topic="/result/window", time=end, payload=result.payload())


def log(path: Path, *items: Block | Event) -> Path:
    writer = McapWriter(path, {"site.toml": SITE})
    for item in items:
        writer.write(item)
    writer.close()
    return path


def happened(what: str, **payload: object) -> Event:
    return Event(topic=f"/event/{what}", time=START, payload=payload)


def test_lost_data_are_counted_per_device(tmp_path: Path) -> None:
    path = log(
        tmp_path / "run.mcap",
        block("a", 0),
        happened("gap", device="a", first_index=200, missing=400, exact=True),
        block("a", 3, Flag.BAD_FRAMES | Flag.AFTER_GAP),
        happened("device_failed", device="b", why="silent"),
        happened("gap", device="b", first_index=0, missing=10, exact=False),
        block("b", 1),
        window(0),
        happened("stopped", dropped=4),
    )
    run = load_run(path)
    a, b = run.devices
    assert (a.scans, a.gaps, a.missing, a.exact, a.damaged, a.lost) == (400, 1, 400, True, 1, 0)
    assert (b.scans, b.gaps, b.missing, b.exact, b.damaged, b.lost) == (200, 1, 10, False, 0, 1)
    assert (run.dropped, run.ended, run.results.name) == (4, True, "run")


def test_truncated_log_is_marked_as_not_ended(tmp_path: Path) -> None:
    run = load_run(log(tmp_path / "run.mcap", block("a", 0), window(0)))
    assert (run.dropped, run.ended) == (None, False)


def test_last_signals_equal_the_measured_signals() -> None:
    """The grid is interpolated to -80 dB, 1e-4 of the amplitude; times are the device's, to a microsecond."""
    signals = last_signals([block(d, s) for s in range(16) for d in ("a", "b")], SITE)
    assert signals is not None
    assert [c.name for c in signals.channels] == ["a_x", "b_x"]
    assert signals.duration == pytest.approx(11.0)
    time = (signals.start - START) * 1e-9 + np.arange(len(signals.data)) / signals.rate
    expected = 1e5 * EPSON_SCALE * np.sin(2 * np.pi * 3 * time)
    np.testing.assert_allclose(signals.data[:, 0], expected, atol=2e-4 * 1e5 * EPSON_SCALE)


def test_last_signals_are_corrected_for_device_delays() -> None:
    """Shifted by 0.3 of a sample: -80 dB as the grid itself, but for half a second at both ends."""
    late = 1.5e-3
    signals = last_signals([block(d, s) for s in range(16) for d in ("a", "b")], SITE, {"b": late})
    assert signals is not None
    time = (signals.start - START) * 1e-9 + np.arange(len(signals.data)) / signals.rate
    for column, shift in ((0, 0.0), (1, late)):
        expected = 1e5 * EPSON_SCALE * np.sin(2 * np.pi * 3 * (time + shift))
        np.testing.assert_allclose(signals.data[100:-100, column], expected[100:-100], atol=2e-4 * 1e5 * EPSON_SCALE)


def reference(time: int, **late: float) -> Event:
    delays = {device: (seconds, 1e-6) for device, seconds in late.items()}
    found = ReferenceResult(
        time=time, n_windows=6, nodes=[], lines={}, sensors={}, modes=[], calibrated={}, delays=delays
    )
    return Event(topic="/result/reference", time=time, payload=found.payload())


def test_device_delays_are_read_from_the_newest_reference(tmp_path: Path) -> None:
    path = log(tmp_path / "run.mcap", block("a", 0), reference(START, a=1e-3, b=-1e-3), reference(START + 1, a=2e-3))
    assert late_devices(path) == {"a": 2e-3}
    assert late_devices(log(tmp_path / "new.mcap", block("a", 0))) == {}


def test_device_without_data_at_the_end_is_omitted() -> None:
    signals = last_signals([block("a", s) for s in range(16)], SITE)
    assert signals is not None
    assert [c.name for c in signals.channels] == ["a_x"]


def test_short_log_or_missing_settings_give_no_signals() -> None:
    assert last_signals([block("a", 0)], SITE) is None
    assert last_signals([block("a", s) for s in range(16)], "") is None


def test_fast_signals_are_low_pass_filtered_before_decimation() -> None:
    """At 2000 Hz, 40 Hz stays within the filter's ripple (1 %); 470 Hz, that would fold to 30 Hz, is gone (-40 dB)."""
    time = np.arange(20_000) / 2000.0
    data = np.column_stack([np.sin(2 * np.pi * f * time) for f in (40.0, 470.0)])
    channels = tuple(Channel(name=n, device="a", axis=i) for i, n in enumerate("xy"))
    slow = slower(Recording(channels=channels, data=data, rate=2000.0, start=START))
    at = (slow.start - START) * 1e-9 + np.arange(len(slow.data)) / slow.rate
    assert slow.rate == 500.0
    np.testing.assert_allclose(slow.data[:, 0], np.sin(2 * np.pi * 40 * at), atol=0.01)
    assert np.abs(slow.data[:, 1]).max() < 0.01


def test_newest_log_of_a_folder_is_selected(tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    for age, name in enumerate(("log/new.mcap", "old.mcap")):
        path = log(tmp_path / name, window(0))
        os.utime(path, (1000 - age, 1000 - age))
    assert find_log(tmp_path).name == "new.mcap"
    assert find_log(tmp_path / "old.mcap").name == "old.mcap"


def test_infinite_value_is_read_back_as_nan(tmp_path: Path) -> None:
    strange = window(0)
    strange.payload["novelty"] = Novelty(t2=float("inf"), limit=1.0, modes=[]).payload()
    (read,) = load_run(log(tmp_path / "run.mcap", strange)).results.windows
    assert read.novelty is not None
    assert np.isnan(read.novelty.t2)


def test_result_of_another_version_is_refused(tmp_path: Path) -> None:
    strange = window(0)
    strange.payload["novelty"] = {"t2": "much", "limit": 1.0, "modes": []}
    with pytest.raises(ResultsError, match=r"run\.mcap: holds a result .* WindowResult, novelty\.t2: "):
        load_run(log(tmp_path / "run.mcap", strange))


def test_missing_or_empty_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"nowhere: there is no such"):
        load_run(tmp_path / "nowhere")
    with pytest.raises(ResultsError, match=r"holds no log: expected \*\.mcap"):
        load_run(tmp_path)
    with pytest.raises(ResultsError, match=r"bare\.mcap: holds no results"):
        load_run(log(tmp_path / "bare.mcap", block("a", 0)))


def test_temperatures_and_events_of_devices_are_kept(tmp_path: Path) -> None:
    gap = Event(topic="/event/gap", time=START + 10**9, payload={"device": "a", "missing": 7, "exact": True})
    site = Event(topic="/measured/temperature", time=START + 2 * 10**9, payload={"celsius": -3.5})
    found = load_run(log(tmp_path / "run.mcap", *(block("a", s) for s in range(25)), gap, site, window(3))).results
    assert found.device_events == ((START + 10**9, "Missing scans of device a: 7"),)
    times, values = found.temperatures["a"]
    assert values == [20.0] * 3  # one reading per ten seconds
    assert np.diff(times).min() >= 10 * 10**9
    assert found.temperatures["site"] == ([START + 2 * 10**9], [-3.5])

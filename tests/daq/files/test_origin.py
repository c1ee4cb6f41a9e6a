"""Exported files state the devices of their channels and their start, and are imported with both."""

from pathlib import Path

import numpy as np
import pytest

from daq import (
    Block,
    Channel,
    DataError,
    McapWriter,
    Recording,
    export_recording,
    load_recordings,
    read_data,
    write_recording,
)
from tests.support.daq.blocks import START, make_block

CHANNELS = (
    Channel(name="left_y", device="left", axis=1),
    Channel(name="left z (up), 2", device="left", axis=2),
    Channel(name="right_x", device="right", axis=0),
)
RATE = 100.0


def recording(n: int = 400) -> Recording:
    data = np.random.default_rng(3).standard_normal((n, 3))
    return Recording(channels=CHANNELS, data=data, rate=RATE, start=START + 123_456_789)


@pytest.mark.parametrize("ending", ["csv", "npz", "mat", "uff"])
def test_devices_and_start_time_are_kept_by_export_and_import(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"data.{ending}"
    export_recording(path, recording())
    found = read_data(path)
    assert (found.channels, found.start) == (CHANNELS, recording().start)
    np.testing.assert_allclose(found.data, recording().data, rtol=1e-6)
    write_recording(tmp_path / "log.mcap", found)
    (again,) = load_recordings(tmp_path / "log.mcap")
    assert (again.channels, again.start) == (CHANNELS, recording().start)
    some = read_data(path, columns={"right_x": "moved", "left_y": "left_y"}, start=5)
    assert {(c.name, c.device, c.axis) for c in some.channels} == {("moved", "right", 0), ("left_y", "left", 1)}
    assert some.start == 5


def test_exported_table_is_readable_by_numpy(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    export_recording(path, recording())
    np.testing.assert_allclose(np.loadtxt(path, delimiter=",", skiprows=2)[:, 1:], recording().data, rtol=1e-6)
    assert path.read_text().splitlines()[1] == 't,left_y,"left z (up), 2",right_x'


def test_edited_exported_table_is_imported(tmp_path: Path) -> None:
    """Rows cut from the beginning move the start; a new column is a device of its own; gaps split a device."""
    path = tmp_path / "data.csv"
    export_recording(path, recording())
    comment, header, *rows = path.read_text().splitlines()
    rows = [f"{row},{k}" for k, row in enumerate(rows)][50:]
    time, left_y, *others = rows[7].split(",")
    assert left_y
    rows[7] = ",".join([time, "", *others])
    path.write_text("\n".join([comment, f"{header},new", *rows]))
    found = read_data(path)
    assert found.start == recording().start + 500_000_000
    assert [channel.device for channel in found.channels] == ["left", "left-2", "right", "import"]


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "{no JSON",
        '{"start": -5, "channels": {"a": ["d", 0]}}',
        '{"start": 1e300, "channels": {"a": ["d", 0]}}',
        '{"start": Infinity, "channels": {"a": ["d", 0]}}',
        '{"start": 0, "channels": {"a": ["", 0]}}',
        '{"start": "now", "channels": {"a": ["d", 0]}}',
        '{"start": 0, "channels": {"a": ["d", 0], "b": ["d", 0]}}',
        '{"start": 0, "channels": {"a": ["d", -1]}}',
        '{"start": 0, "channels": {"a": ["d", 1000000000]}}',
        '{"start": 0, "channels": {"a": 5}}',
    ],
)
def test_invalid_origin_comment_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"# modalwatch {text}\nt,a,b\n0,1,2\n0.1,3,4\n")
    with pytest.raises(DataError, match=r"data\.csv: origin: expected start and channels, found"):
        read_data(path)


def test_new_column_in_exported_table_gets_an_unused_axis(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    places = '{"start": 0, "channels": {"b": ["import", 1], "c": ["import", 2]}}'
    path.write_text(f"# modalwatch {places}\nt,b,new,c,newer\n0,1,2,3,4\n0.1,3,4,5,6\n")
    assert [(c.name, c.device, c.axis) for c in read_data(path).channels] == [
        ("b", "import", 1),
        ("new", "import", 0),
        ("c", "import", 2),
        ("newer", "import", 3),
    ]


def test_other_comments_are_ignored(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("# modalwatch log of bridge 3\nt,a\n0,1\n0.1,3\n")
    assert [c.name for c in read_data(path).channels] == ["a"]


def test_channel_may_be_named_origin(tmp_path: Path) -> None:
    np.savez(tmp_path / "data.npz", origin=np.arange(5.0), other=np.arange(5.0), rate=10.0)
    found = read_data(tmp_path / "data.npz")
    assert [(c.name, c.device) for c in found.channels] == [("origin", "import"), ("other", "import")]


@pytest.mark.parametrize("clock", ["", "shared"])
def test_device_delays_are_removed_with_subsample_accuracy(tmp_path: Path, clock: str) -> None:
    """Both devices sample 20 Hz at 1000 Hz; `b` states times 3.3 ms late. Interpolation is good to -80 dB."""
    late, scale = 3.3e-3, 1e-6
    writer = McapWriter(tmp_path / "log.mcap", {})
    for first in range(0, 8000, 250):
        for device, delay in (("a", 0.0), ("b", late)):
            wave = np.sin(2 * np.pi * 20 * (np.arange(first, first + 250) / 1000 - delay)) / scale
            counts = np.repeat(np.rint(wave).astype(np.int32)[:, None], 3, axis=1)
            writer.write(Block(**{**vars(make_block(device, first)), "counts": counts, "scale": scale, "clock": clock}))
    writer.close()
    channels = tuple(Channel(name=device, device=device, axis=0) for device in "ab")
    (raw,) = load_recordings(tmp_path / "log.mcap", channels=channels)
    assert np.abs(raw.data[:, 0] - raw.data[:, 1]).max() > 0.3
    (found,) = load_recordings(tmp_path / "log.mcap", channels=channels, late={"b": late})
    assert np.isfinite(found.data).all()
    assert np.abs(found.data[:, 0] - found.data[:, 1]).max() < 2e-4
    time = (found.start - START) * 1e-9 + np.arange(len(found.data)) / found.rate
    assert np.abs(found.data[:, 0] - np.sin(2 * np.pi * 20 * time)).max() < 2e-4

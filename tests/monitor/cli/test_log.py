"""`repair` and `log info`."""

import json
from pathlib import Path

import numpy as np
import pytest

from daq import Block, Event, Flag, McapWriter, inspect_log, read_data
from daq.log import RotatingWriter, Rotation, repair_folder
from monitor.analysis.logs import log_channels, log_recordings
from monitor.views.run import late_devices
from tests.support.daq.blocks import START, make_block
from tests.support.monitor.cli import Commands, assert_refused


def block(first: int, *, flags: Flag = Flag.NONE, device: str = "beam") -> Block:
    made = make_block(device, first)
    return Block(**{**vars(made), "flags": flags})


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log: a gap of 500 scans, a restart after 2000 more; one event; cut."""
    path = tmp_path / "log.mcap"
    writer = McapWriter(path, {"site.toml": "x = 1\n"})
    for item in (
        block(0),
        block(250),
        Event(topic="/event/gap", time=START, payload={"device": "beam"}),
        block(1000),
        block(3250, flags=Flag.RESTARTED),
        block(0, device="other"),
    ):
        writer.write(item)
    writer.flush()
    whole = path.read_bytes()
    writer.write(block(3500))
    writer.close()
    path.write_bytes(path.read_bytes()[: len(whole) + 100])  # amid the second chunk
    return path


def test_info_counts_scans_gaps_and_events(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    done = modalwatch("log", "info", log, "--json", tmp_path / "info.json")
    assert (done.code, done.err) == (0, "")
    found = json.loads((tmp_path / "info.json").read_text())
    beam = found["devices"]["beam"]
    assert (beam["scans"], beam["gaps"], beam["missing"], beam["restarts"]) == (1000, 2, 500 + 2000, 1)
    assert (beam["rate"], beam["axes"], beam["temperature"]) == (1000.0, 3, 21.5)
    assert (beam["start"], beam["end"]) == (START, START + 3500 * 10**6)
    assert found["devices"]["other"]["scans"] == 250
    assert (found["events"], found["attachments"]) == ({"/event/gap": 1}, {"site.toml": 6})
    assert (found["whole"], found["messages"], found["state"]) == (False, 6, "cut, 100 bytes of an unfinished chunk")
    for text in ("beam", "2026-01-01 00:00:00 UTC", "3.50 s", "cut, 100 bytes", f"modalwatch repair {log}"):
        assert text in done.out


def test_repair_fixes_a_cut_log_and_skips_an_intact_one(modalwatch: Commands, log: Path) -> None:
    done = modalwatch("repair", log)
    assert done.code == 0, done.err
    assert f"{log}: repaired, 6 messages kept; it was cut, 100 bytes of an unfinished chunk" in done.out
    content = log.read_bytes()
    assert f"{log}: complete, 6 messages; not changed" in modalwatch("repair", log).out
    assert log.read_bytes() == content
    done = modalwatch("log", "info", log)
    assert "state: whole" in done.out
    assert "modalwatch repair" not in done.out


def test_startup_repairs_logs_of_a_killed_run(log: Path) -> None:
    (log.parent / "rest.mcap").write_bytes(b"")
    writer = McapWriter(log.parent / "open.mcap", {})
    reported = list(repair_folder(log.parent))
    writer.close()
    assert reported == [
        f"{log}: repaired, 6 messages kept",
        f"{log.parent}/open.mcap: is being written: it cannot be repaired now",
        f"{log.parent}/rest.mcap: is not an MCAP log",
    ]
    assert inspect_log(log).whole
    assert list(repair_folder(log.parent)) == reported[2:]


def test_info_of_a_damaged_log_counts_intact_chunks(modalwatch: Commands, tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    writer = McapWriter(path, {})
    writer.write(block(0))
    writer.flush()
    first = path.stat().st_size
    writer.write(block(250))
    writer.close()
    content = bytearray(path.read_bytes())
    content[first + 500] ^= 1
    path.write_bytes(content)
    done = modalwatch("log", "info", path, "--json", tmp_path / "info.json")
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "info.json").read_text())
    assert (found["state"], found["devices"]["beam"]["scans"]) == ("1 chunk damaged", 250)


def test_export_of_a_recorded_log(modalwatch: Commands, tmp_path: Path) -> None:
    path = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
    done = modalwatch("log", "export", path, "-o", tmp_path / "data.npz")
    assert done.code == 0, done.err
    late = late_devices(path)
    (expected,) = log_recordings(path, late=late)
    found = read_data(tmp_path / "data.npz")
    np.testing.assert_array_equal(found.data, expected.data)
    assert (found.channels, found.start) == (expected.channels, expected.start)
    assert not np.array_equal(expected.data, next(log_recordings(path)).data)
    for device, seconds in late.items():
        assert f"{device} {1e3 * seconds:+.3f} ms" in done.out
    assert f"12 channels, {found.duration:.6g} s at 500 Hz, " in done.out
    assert f"it starts at {expected.start} ns UTC" in done.out
    done = modalwatch("log", "export", path, "-o", tmp_path / "data.npz")
    assert_refused(done, tmp_path / "data.npz", "exists: give another name, or --force")
    size = (tmp_path / "data.npz").stat().st_size
    done = modalwatch("log", "export", path, "--force", "--to", 30, "-o", tmp_path / "data.npz")
    assert done.code == 0, done.err
    assert (tmp_path / "data.npz").stat().st_size < size / 3


def test_replaced_file_is_restored_if_the_new_one_fails(modalwatch: Commands, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    log.write_text("precious")
    assert_refused(modalwatch("log", "expand", log, "-o", log, "--force"), "log.mcap")
    assert log.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.parametrize("command", [("repair",), ("log", "info"), ("replay",), ("identify",)])
@pytest.mark.parametrize(
    ("content", "says"), [(None, "cannot be read: No such file"), (b"", "is not an MCAP log"), (b"t,a\n", "is not an")]
)
def test_file_that_is_not_a_log_is_refused(
    modalwatch: Commands, tmp_path: Path, command: tuple[str, ...], content: bytes | None, says: str
) -> None:
    path = tmp_path / "log.mcap"
    if content is not None:
        path.write_bytes(content)
    assert_refused(modalwatch(*command, path), f"{path}: {says}")


def test_info_covers_all_files_of_one_run(modalwatch: Commands, tmp_path: Path) -> None:
    recorder = RotatingWriter(tmp_path, {}, START, Rotation(size=1.0))
    for k in range(3):
        recorder.write(block(250 * k))
        recorder.flush()
    recorder.close()
    for arguments in ([tmp_path], recorder.paths[::-1]):
        done = modalwatch("log", "info", *arguments, "--json", tmp_path / "info.json", "--force")
        assert (done.code, done.err) == (0, "")
        found = json.loads((tmp_path / "info.json").read_text())
        assert found["files"] == list(map(str, recorder.paths))
        assert (found["devices"]["beam"]["scans"], found["devices"]["beam"]["gaps"]) == (750, 0)
    other = RotatingWriter(tmp_path, {}, START + 10**9)
    other.close()
    done = modalwatch("log", "info", recorder.paths[0], other.paths[0])
    assert_refused(done, "LOG: expected the files of one run, found those of 2", other.paths[0])


@pytest.mark.thorough
def test_modes_are_unchanged_by_export_and_import(modalwatch: Commands, tmp_path: Path) -> None:
    """Six devices with delays of up to 1.2 ms; with and without the comment that states the devices."""
    path = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
    table, bare = tmp_path / "data.csv", tmp_path / "bare.csv"
    assert modalwatch("log", "export", path, "--to", 70, "-o", table).code == 0
    bare.write_text("".join(table.read_text(encoding="utf-8").splitlines(keepends=True)[1:]), encoding="utf-8")
    modes = []
    for data in (None, table, bare):
        log, limit = (path, ("--to", 70)) if data is None else (data.with_suffix(".mcap"), ())
        if data is not None:
            assert modalwatch("import", data, "-o", log).code == 0
        done = modalwatch("identify", log, "--window", 60, "--json", tmp_path / "modes.json", "--force", *limit)
        assert (done.code, "channels are not synchronous" in done.out) == (0, False)
        modes.append(json.loads((tmp_path / "modes.json").read_text())["modes"])
    expected, *others = modes
    for found in others:
        for a, b in zip(found, expected, strict=True):
            assert abs(a["frequency"]["value"] - b["frequency"]["value"]) < b["frequency"]["std"]
            if b["quality"]["mpc"] > 0.7:  # two close modes that mix have no certain one
                assert abs(a["quality"]["mpc"] - b["quality"]["mpc"]) < 0.02
    devices = [{channel.device for channel in log_channels(one)} for one in (path, table.with_suffix(".mcap"))]
    assert devices[0] == devices[1]
    assert len(devices[0]) == 6


def test_json_on_standard_output_has_no_other_text(modalwatch: Commands, log: Path, tmp_path: Path) -> None:
    assert modalwatch("log", "info", log, "--json", tmp_path / "info.json").code == 0
    done = modalwatch("log", "info", log, "--json", "-")
    assert json.loads(done.out) == {"version": 1} | json.loads((tmp_path / "info.json").read_text())
    assert "beam" in done.err
    assert "beam" in modalwatch("log", "info", log).out  # of another call again

"""Files of CAN traffic to logs: written by python-can and cantools, read back by ours."""

import math
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest
from cantools.database import Database, load_string

from daq import Block, Channel, DataError, DbcSensor, Event, LogError, load_recordings, read_log
from daq.files import LoggedSensor, import_can_log

FILE = Path(__file__).parents[3] / "examples" / "imu.dbc"
SENSOR = DbcSensor(file=FILE, signals=("accX", "accY", "accZ"), counter="Counter", temperature="Temp")
IMU = LoggedSensor(device="imu", rate=400.0, sensor=SENSOR)
CHANNELS = (Channel(name="deck_z", device="imu", axis=2),)
BEGIN = 1_767_225_600.0  # s
N = 1200


def z_of(k: int) -> float:
    """Return the value of scan k: a sine of 20 Hz, in steps of the sensor."""
    return round(256 * 3.0 * math.sin(2 * math.pi * 20.0 * k / 400.0)) / 256


def traffic(n: int = N) -> list[can.Message]:
    """Return frames of a sensor whose counter wraps, among frames of others, as encoded by cantools."""
    database = load_string(FILE.read_text(), "dbc")
    assert isinstance(database, Database)
    found = []
    for k in range(n):
        time = BEGIN + k / 400.0
        counter = database.encode_message("GroupCounter", {"Counter": (65_000 + k) % 65_536})
        scan = database.encode_message("Acceleration", {"accX": k / 256, "accY": -k / 256, "accZ": z_of(k)})
        for late, identifier, data in ((0.0, 6, counter), (0.0002, 52, scan), (0.0004, 0x222, b"\1\2\3")):
            found.append(can.Message(timestamp=time + late, arbitration_id=identifier, data=data, is_extended_id=False))
        if k % 100 == 0:
            warm = database.encode_message("Temperature", {"Temp": 21.5})
            found.append(can.Message(timestamp=time + 0.001, arbitration_id=98, data=warm, is_extended_id=False))
    return found


def written(path: Path, messages: list[can.Message]) -> Path:
    """Let python-can write a file."""
    with can.Logger(path) as logger:
        for message in messages:
            logger.on_message_received(message)
    return path


@pytest.mark.parametrize("ending", [".log", ".blf", ".asc", ".trc"])
def test_all_scans_are_imported_with_their_times(tmp_path: Path, ending: str) -> None:
    data, out = written(tmp_path / f"bus{ending}", traffic()), tmp_path / "bus.mcap"
    (found,) = import_can_log(data, out, [IMU], CHANNELS)
    # the last acceleration waits for the counter after it: it has none of its own
    assert (found.device, found.scans, found.missing) == ("imu", N - 1, 0)
    assert found.seconds == pytest.approx((N - 2) / 400.0, abs=2e-3)  # .trc and .asc keep parts of a millisecond
    blocks = [item for item in read_log(out) if isinstance(item, Block)]
    counts = np.concatenate([block.counts for block in blocks])
    np.testing.assert_array_equal(counts, np.array([(i, -i, 256 * z_of(i)) for i in range(N - 1)]))
    assert {block.scale for block in blocks} == {2**-8}
    assert blocks[-1].temperature == pytest.approx(21.5)
    assert len([item for item in read_log(out) if isinstance(item, Event)]) == 0
    (recording,) = load_recordings(out)
    assert recording.channels == CHANNELS
    if ending in (".log", ".blf"):  # the others keep the day in words, of the zone they were written in
        assert abs(recording.start * 1e-9 - BEGIN) < 0.1


def test_lost_frames_become_gaps_and_other_scans_keep_their_indices(tmp_path: Path) -> None:
    lost = {3 * k for k in (300, 301, 302, 700)}  # counters
    messages = [m for m in traffic() if m.arbitration_id != 98]
    data = written(tmp_path / "bus.log", [m for k, m in enumerate(messages) if k not in lost])
    out = tmp_path / "bus.mcap"
    (found,) = import_can_log(data, out, [IMU], CHANNELS)
    assert (found.scans, found.missing) == (N - 1 - 4, 4)
    gaps = [item.payload for item in read_log(out) if isinstance(item, Event) and item.topic == "/event/gap"]
    assert [(gap["first_index"], gap["missing"]) for gap in gaps] == [(300, 3), (700, 1)]
    for block in read_log(out):
        if isinstance(block, Block):
            np.testing.assert_array_equal(block.counts[:, 0], np.arange(block.first_index, block.end_index))


def test_given_start_time_replaces_that_of_the_file(tmp_path: Path) -> None:
    data, out = written(tmp_path / "bus.log", traffic()), tmp_path / "bus.mcap"
    import_can_log(data, out, [IMU], CHANNELS, start=10**18)
    (recording,) = load_recordings(out)
    assert abs(recording.start - 10**18) < 1e8


@pytest.mark.parametrize(
    ("messages", "sensor", "message"),
    [
        (traffic(), replace(IMU, rate=1000.0), "imu: expected 1000 scans per second, found 400"),
        (
            [m for m in traffic(100) if m.arbitration_id != 52],
            IMU,
            "has no scan of imu: no frame of Acceleration (0x34) came",
        ),
        ([], IMU, "has no scan of imu: no frame of GroupCounter (0x6) came"),
    ],
    ids=["rate", "no frames", "empty"],
)
def test_failed_import_names_the_cause_and_writes_no_log(
    tmp_path: Path, messages: list[can.Message], sensor: LoggedSensor, message: str
) -> None:
    data, out = written(tmp_path / "bus.log", messages), tmp_path / "bus.mcap"
    with pytest.raises(DataError) as caught:
        import_can_log(data, out, [sensor], CHANNELS)
    assert str(caught.value).startswith(f"{data}: {message}")
    assert not out.exists()


@pytest.mark.parametrize("name", ["none.log", "words.log", "words.blf", "words.asc", "bus.doc"])
def test_missing_or_invalid_can_log_is_named_in_the_error(tmp_path: Path, name: str) -> None:
    data = tmp_path / name
    if name != "none.log":
        data.write_text("what is this, then?\n")
    with pytest.raises(DataError, match=f"^{data}: "):
        import_can_log(data, tmp_path / "out.mcap", [IMU], CHANNELS)


def test_error_for_damaged_line_states_its_position(tmp_path: Path) -> None:
    data = written(tmp_path / "bus.log", traffic(50))
    lines = data.read_text().splitlines()
    data.write_text("\n".join([*lines[:20], lines[20][:-1] + "x", *lines[21:]]))
    with pytest.raises(DataError, match="is no CAN log, or is damaged after frame 20: "):
        import_can_log(data, tmp_path / "out.mcap", [IMU], CHANNELS)


def test_backward_time_step_is_refused_with_frame_and_times(tmp_path: Path) -> None:
    data = written(tmp_path / "bus.log", traffic(50))
    lines = data.read_text().splitlines()
    data.write_text("\n".join([*lines[100:], *(line.replace("(17672256", "(17672255") for line in lines[:50])]))
    why = r"frame 52: its clock runs backwards, from 1767225600\.1\d+ s to 1767225500\.0"
    with pytest.raises(DataError, match=why):
        import_can_log(data, tmp_path / "out.mcap", [IMU], CHANNELS)


def test_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    data, out = written(tmp_path / "bus.log", traffic(50)), tmp_path / "bus.mcap"
    out.write_text("mine")
    with pytest.raises(LogError, match="cannot be written: File exists"):
        import_can_log(data, out, [IMU], CHANNELS)
    assert out.read_text() == "mine"

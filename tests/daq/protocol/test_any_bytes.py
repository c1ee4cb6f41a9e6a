"""Arbitrary bytes from a line, a bus or a file: they are read, or refused by the documented error."""

import os
from contextlib import suppress
from pathlib import Path

import can
import canopen
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq import (
    Channel,
    DataError,
    Event,
    LogError,
    McapWriter,
    Recording,
    SystemClock,
    export_recording,
    read_data,
    read_log,
)
from daq.drivers.can.heartbeat import HeartbeatConsumer
from daq.emulator import (
    EmulatedEpson,
    EmulatedEpsonCan,
    EmulatedNode,
    EmulatedSlcan,
    EmulatedTextLines,
    EmulatedWitmotion,
    EmulatedWitmotionCan,
)
from daq.emulator.serial_port import SerialEmulator
from daq.files import CAN_LOGS, LoggedSensor, import_can_log
from daq.protocol import epson, node
from tests.support.daq.can_buses import IMU
from tests.support.daq.emulated_can import imu
from tests.support.daq.emulated_ports import LINES, Ramp

#: bytes that are wrong, and where, as a share of the length; and the share that is left of the whole
Damage = tuple[list[tuple[float, int]], float]
damages = st.tuples(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=6), st.floats(0, 1))
CHANNELS = (Channel(name="deck", device="imu", axis=0),)
SENSOR = LoggedSensor(device="imu", rate=400.0, sensor=imu(IMU))


def damaged(data: bytes, damage: Damage) -> bytes:
    """Return bytes with some of them wrong, and cut; all of them where nothing else is."""
    wrong, left = damage
    found = bytearray(data)
    for where, byte in wrong:
        found[min(int(where * len(found)), len(found) - 1)] = byte
    return bytes(found[: round(left * len(found))]) if wrong else bytes(found[: max(1, round(left * len(found)))])


@given(st.binary(max_size=8))
def test_arbitrary_register_reply_is_parsed_or_refused(reply: bytes) -> None:
    with suppress(ValueError):
        assert 0 <= epson.parse_reply(reply, 0x4C) <= 0xFFFF


@given(st.binary(max_size=200))
def test_command_decoder_accepts_arbitrary_bytes(data: bytes) -> None:
    for command, _ in node.CommandDecoder().feed(data):
        assert isinstance(command, int)


@pytest.fixture(scope="module")
def emulators() -> list[SerialEmulator]:
    clock = SystemClock()
    return [
        EmulatedEpson(Ramp(), clock, serial_number="E"),
        EmulatedNode(Ramp(), clock, serial_number="E"),
        EmulatedTextLines(Ramp(), clock, LINES, rate=10.0),
        EmulatedWitmotion(Ramp(), clock),
    ]


@given(
    st.one_of(st.binary(max_size=60), st.lists(st.sampled_from([b"\xff\xaa", b"\x0d", b"\0", b"\xff"])).map(b"".join))
)
def test_emulated_serial_devices_accept_arbitrary_bytes(emulators: list[SerialEmulator], received: bytes) -> None:
    for device in emulators:
        device.receive(received)
        device.serve()


@given(st.lists(st.tuples(st.sampled_from([0, 0x50, 0x080, 0x603, 0x7FF]), st.binary(max_size=8)), max_size=12))
def test_emulated_can_nodes_accept_arbitrary_frames(frames: list[tuple[int, bytes]]) -> None:
    nodes = (
        EmulatedEpsonCan(Ramp(), SystemClock(), node=3, serial_number=1),
        EmulatedWitmotionCan(Ramp(), SystemClock()),
    )
    for can_id, data in frames:
        for device in nodes:
            assert all(len(answer) <= 8 for _, answer in device.receive(can_id, data))
    for device in nodes:
        device.beats()
        device.scans(10, device.syncs())


@pytest.mark.live
@settings(max_examples=30)
@given(st.one_of(st.binary(max_size=80), st.lists(st.sampled_from(list(b"tTrRzZO0128fF\r\a"))).map(bytes)))
def test_emulated_adapter_accepts_arbitrary_bytes(received: bytes) -> None:
    emulated = EmulatedSlcan([EmulatedEpsonCan(Ramp(), SystemClock(), node=3, serial_number=1)])
    host = os.open(emulated.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.write(host, b"O\r" + received)
    emulated.serve()
    emulated.serve()
    os.close(host)
    emulated.close()


@given(st.lists(st.one_of(st.integers(0, 127), st.binary(min_size=8, max_size=8)), max_size=30))
def test_heartbeat_consumer_accepts_arbitrary_frames(frames: list[int | bytes]) -> None:
    remote = canopen.RemoteNode(3, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    consumer = HeartbeatConsumer(remote)
    for frame in frames:
        if isinstance(frame, int):
            remote.nmt.on_heartbeat(0x703, bytes([frame]), 0.0)  # type: ignore[no-untyped-call]
        else:
            remote.emcy.on_emcy(0x083, frame, 0.0)  # type: ignore[no-untyped-call]
        assert isinstance(consumer.trouble() + consumer.warning(), str)


@pytest.fixture(scope="module")
def traffic(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the content of each kind of file for a few scans."""
    folder = tmp_path_factory.mktemp("traffic")
    frames = [(0x006, "000{}"), (0x034, "000{}00000000")] * 8
    for ending in CAN_LOGS:
        with can.Logger(folder / f"bus{ending}") as logger:
            for k, (can_id, data) in enumerate(frames):
                content = bytes.fromhex(data.format(k // 2))
                stamp = 1767225600.0 + k / 400
                logger(can.Message(timestamp=stamp, arbitration_id=can_id, data=content, is_extended_id=False))
    return {ending: (folder / f"bus{ending}").read_bytes() for ending in CAN_LOGS}


@pytest.mark.parametrize("ending", CAN_LOGS)
@given(damages)
@settings(max_examples=25)
def test_damaged_can_log_is_read_or_refused(
    ending: str, traffic: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory, damage: Damage
) -> None:
    folder = tmp_path_factory.mktemp("can")
    path = folder / f"bus{ending}"
    path.write_bytes(damaged(traffic[ending], damage))
    with suppress(DataError):
        import_can_log(path, folder / "bus.mcap", [SENSOR], CHANNELS)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the content of each kind of file for a short recording."""
    folder = tmp_path_factory.mktemp("tables")
    recording = Recording(channels=CHANNELS, data=np.arange(20.0)[:, None], rate=10.0, start=0)
    paths = [folder / f"data{ending}" for ending in (".npz", ".mat", ".uff")]
    for path in paths:
        export_recording(path, recording)
    return {path.suffix: path.read_bytes() for path in paths}


@pytest.mark.parametrize("ending", [".npz", ".mat", ".uff"])
@given(damages)
@settings(max_examples=25)
def test_damaged_data_file_is_read_or_refused(
    ending: str, tables: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory, damage: Damage
) -> None:
    path = tmp_path_factory.mktemp("data") / f"data{ending}"
    path.write_bytes(damaged(tables[ending], damage))
    with suppress(DataError):
        assert read_data(path).rate > 0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    writer = McapWriter(path, {"a": "b"})
    for k in range(4):
        writer.write(Event(topic="/event/note", time=k, payload={"k": k}))
    writer.close()
    return path.read_bytes()


@given(damages)
def test_damaged_log_is_read_or_refused(log: bytes, tmp_path_factory: pytest.TempPathFactory, damage: Damage) -> None:
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    Path(path).write_bytes(damaged(log, damage))
    with suppress(LogError):
        assert all(isinstance(item, Event) for item in read_log(path))

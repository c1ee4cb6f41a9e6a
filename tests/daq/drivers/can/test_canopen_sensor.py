"""Sensors that an EDS file describes: frames as the package canopen sends them, read by the driver can-dbc.

`eds/sample.eds` and `eds/e35.eds` are test and example files of canopen 2.4.1 (MIT, `eds/LICENSE.txt`).
"""

import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import cantools
import numpy as np
import pytest
from canopen.pdo.base import PdoVariable
from cantools.database.can import Database

from daq import Block, DbcAddress, DbcSensor, DeviceReader, Item, SystemClock, make_driver
from tests.support.daq.can_buses import wait_for
from tests.support.daq.readers import running

EXAMPLES = Path(__file__).parents[4] / "examples"
EDS = Path(__file__).parent / "eds"
NODE, RATE = 5, 200.0


def frames_of(eds: Path) -> str:
    """Return the text of the DBC file that the example makes of an EDS file."""
    run = [sys.executable, str(EXAMPLES / "eds_to_dbc.py"), str(eds), str(NODE)]
    return subprocess.run(run, capture_output=True, text=True, timeout=60, check=True).stdout


def signal(variable: PdoVariable) -> str:
    """Return the name of the signal of an object."""
    return re.sub(r"\W+", "_", variable.name.split(".")[-1])


@contextmanager
def local_node(eds: Path, channel: str) -> Iterator[canopen.LocalNode]:
    """Give a node of the package canopen on a bus of this process, with its PDOs as the EDS file has them."""
    with can.Bus(interface="virtual", channel=channel) as bus:
        network = canopen.Network(bus)
        node = network.create_node(NODE, str(eds))
        node.tpdo.read()  # type: ignore[no-untyped-call]
        yield node


def test_frames_of_a_drive_are_decoded_with_the_names_and_signs_of_its_eds_file() -> None:
    database = cantools.database.load_string(frames_of(EDS / "e35.eds"), "dbc")
    assert isinstance(database, Database)
    values = {
        "Statusword": 0x8237,
        "Velocity_actual_value": -123456,
        "Torque_actual_value": -321,
        "Current_actual_value": -32768,
        "DC_link_circuit_voltage": 4_000_000_000,
        "Position_actual_value": -(2**31),
        "Actual_temperature": -12_345_678,
    }
    with local_node(EDS / "e35.eds", "drive") as node, can.Bus(interface="virtual", channel="drive") as listener:
        sent = [pdo for pdo in node.tpdo.values() if pdo.map]
        for pdo in sent:
            for variable in pdo.map:
                variable.raw = values[signal(variable)]
            pdo.transmit()
        found: dict[str, object] = {}
        for _ in sent:
            message = listener.recv(5.0)
            assert message is not None
            found |= database.get_message_by_frame_id(message.arbitration_id).decode_simple(bytes(message.data))
    assert found == values


def test_mapped_objects_that_a_file_does_not_describe_have_their_number_as_name() -> None:
    database = cantools.database.load_string(frames_of(EDS / "sample.eds"), "dbc")
    assert isinstance(database, Database)
    found = {m.frame_id: {s.name: (s.start, s.length) for s in m.signals} for m in database.messages}
    assert found == {
        0x185: {"object_6041": (0, 16)},
        0x285: {"object_6041": (0, 16), "object_6061": (16, 8)},
        0x385: {"object_6041": (0, 16), "object_6064": (16, 32)},
        0x485: {"object_6041": (0, 16), "object_606C": (16, 32)},
    }


@pytest.mark.live
def test_scans_of_a_node_with_an_eds_file_arrive_with_their_numbers(tmp_path: Path) -> None:
    file, eds = tmp_path / "accelerometer.dbc", EXAMPLES / "accelerometer.eds"
    file.write_text(frames_of(eds), encoding="utf-8")
    signals = ("Acceleration_x", "Acceleration_y", "Acceleration_z")
    sensor = DbcSensor(file=file, signals=signals, counter="Scan_counter", scale=0.00980665)
    place = DbcAddress(interface="virtual", channel="sensor", sensor=sensor)
    items: list[Item] = []
    with local_node(eds, "sensor") as node:
        ended = threading.Event()

        def send() -> None:
            start, k = time.monotonic(), 0
            while not ended.wait(max(0.0, start + k / RATE - time.monotonic())):
                axes = dict(zip(signals, (k % 30000, -(k % 30000), 3 * k % 30000), strict=True))
                for pdo in (node.tpdo[1], node.tpdo[2]):
                    for variable in pdo.map:
                        variable.raw = k % 65536 if signal(variable) == "Scan_counter" else axes[signal(variable)]
                    pdo.transmit()
                k += 1

        thread = threading.Thread(target=send)
        thread.start()
        try:
            reader = DeviceReader("deck", make_driver("can-dbc", place, RATE), RATE, SystemClock(), items.append)
            with running([reader]):
                wait_for(lambda: sum(item.n_scans for item in items if isinstance(item, Block)) > 300)
        finally:
            ended.set()
            thread.join()
    blocks = [item for item in items if isinstance(item, Block)]
    counts = np.concatenate([block.counts for block in blocks])
    k = counts[0, 0] + np.arange(len(counts))
    np.testing.assert_array_equal(counts, np.stack([k, -k, 3 * k], axis=1))
    assert blocks[0].scale == 0.00980665
    assert blocks[-1].end_index == len(counts)

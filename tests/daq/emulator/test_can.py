"""The emulated CAN node under masters that are not ours: PyPI's canopen, and python-can's own SLCAN bus."""

import itertools
import os
import queue
import select
import time

import can
import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError

from daq import ScaledClock, SystemClock
from daq.drivers.can.bus import SlcanBus
from daq.emulator import EmulatedEpsonCan, EmulatedSlcan
from daq.protocol import epson_can
from daq.protocol.frames import can_frames
from daq.protocol.slcan import SlcanDecoder
from tests.support.daq.blocks import START
from tests.support.daq.can_buses import read, served
from tests.support.daq.emulated_ports import Ramp

pytestmark = pytest.mark.live

NAME = "M-A552AC10, a name of many segments"


def adapter(*nodes: int) -> EmulatedSlcan:
    clock = SystemClock()
    return EmulatedSlcan([EmulatedEpsonCan(Ramp(), clock, node=k, serial_number=40 + k, product=NAME) for k in nodes])


def test_canopen_master_reads_identity_and_starts_the_node() -> None:
    with served(adapter(3, 4)) as emulated, SlcanBus(emulated.port) as bus:
        network = canopen.Network(bus)
        network.connect()
        try:
            empty = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
            node = network.add_node(canopen.RemoteNode(3, empty))
            node.sdo.RESPONSE_TIMEOUT = 2.0  # s: its 0.3 are short on a busy machine
            frames: queue.Queue[tuple[int, bytes]] = queue.Queue()
            for kind in (epson_can.TPDO1, epson_can.TPDO2):
                network.subscribe(kind + 3, lambda number, data, _: frames.put((number, bytes(data))))
            states: queue.Queue[int] = queue.Queue()
            node.nmt.add_heartbeat_callback(states.put)
            node.nmt.send_command(129)  # reset
            assert states.get(timeout=2.0) == 0  # boot-up
            assert node.sdo.upload(0x1008, 0) == NAME.encode()
            assert node.sdo.upload(0x1018, 4) == (43).to_bytes(4, "little")
            with pytest.raises(SdoAbortedError, match="0x06020000"):
                node.sdo.upload(0x1234, 0)
            with pytest.raises(SdoAbortedError, match="0x06010002"):
                node.sdo.download(0x1008, 0, b"mine")
            with pytest.raises(SdoAbortedError, match="0x06090030"):
                node.sdo.download(0x2001, 0, (3).to_bytes(4, "little"))  # ms: not one of its periods
            node.sdo.download(0x1800, 2, b"\xfe")  # by its timer
            node.sdo.download(0x1017, 0, (20).to_bytes(2, "little"))
            assert node.nmt.wait_for_heartbeat(2.0) == "PRE-OPERATIONAL"
            node.nmt.state = "OPERATIONAL"
            assert node.nmt.wait_for_heartbeat(2.0) == "OPERATIONAL"
            found = [frames.get(timeout=2.0) for _ in range(41)]
        finally:
            network.disconnect()
    scans, counter = epson_can.ScanDecoder(3).feed(can_frames(found))
    assert counter.tolist() == list(range(1, 20))
    assert scans.tolist() == [[k, -k, 3 * k] for k in range(1, 20)]


def test_python_can_slcan_interface_reads_emulated_frames() -> None:
    with (
        served(adapter(5)) as emulated,
        can.Bus(interface="slcan", channel=emulated.port, bitrate=1_000_000, sleep_after_open=0) as bus,
    ):
        period, by_timer, apply = b"\x22\1\x20\0\x14\0\0\0", b"\x22\0\x18\2\xfe\0\0\0", b"\x22\5\x20\0\x11\0\0\0"
        for data in (by_timer, period, apply):  # 20 ms between scans
            bus.send(can.Message(arbitration_id=0x605, data=data, is_extended_id=False))
        time.sleep(0.1)
        bus.send(can.Message(arbitration_id=0, data=[1, 5], is_extended_id=False))
        ids = (m.arbitration_id for m in iter(lambda: bus.recv(5.0), None) if m)
        scans = list(itertools.islice((number for number in ids if number in (0x185, 0x285)), 10))
    assert scans == [0x185, 0x285] * 5


def test_emulated_adapter_replies_to_slcan_commands() -> None:
    emulated = adapter(1)
    host = os.open(emulated.port, os.O_RDWR | os.O_NOCTTY)
    os.write(host, b"\rV\rN\rF\rt0000\rS8\rO\rt0000\rT000000010\rt9\rq\r")
    emulated.serve()
    expected = b"\rV1013\rN0042\rF00\r\x07\r\rz\rZ\r\x07\x07"
    assert read(host, len(expected)) == expected
    os.close(host)
    emulated.close()
    emulated.serve()  # unplugged: does nothing


def test_full_line_does_not_block_adapter_and_drops_are_counted() -> None:
    clock = ScaledClock(speed=1000.0, origin_wall=time.time_ns(), origin=START)
    nodes = [EmulatedEpsonCan(Ramp(), clock, node=k, serial_number=k) for k in (1, 2)]
    emulated = EmulatedSlcan(nodes)
    host = os.open(emulated.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.write(host, b"O\rt601822001802fe000000\rt602822001802fe000000\rt00020100\r")  # by timer; all nodes: start
    emulated.serve()
    longest, end = 0.0, time.monotonic() + 0.4
    while time.monotonic() < end:
        began = time.monotonic()
        emulated.serve()
        longest = max(longest, time.monotonic() - began)
    assert longest < 0.5
    for node in nodes:
        assert node.dropped > 0
        assert node.sent > 0
        # half of what adapter and pty hold, in scans of 40 bytes; the kernel's share is not known exactly
        assert node.sent < (640 * 1024 + 65_536) / 40 / 2 + 10_000
    decoder, held = SlcanDecoder(), 0
    expected = len(nodes) + 2 * sum(node.sent for node in nodes)  # answers and scans
    # it hands on by itself what it holds; nothing new, it is not served
    while select.select([host], [], [], 5.0 if held < expected else 0.1)[0]:
        held += len(decoder.feed(os.read(host, 1 << 16)))
    os.close(host)
    emulated.close()
    assert held == expected
    assert decoder.bad_lines == 0

"""Our SLCAN bus on a pty: blocks and messages, damage, a pulled plug."""

import errno
import os
import re
import time

import can
import pytest

from daq.drivers import CanPlace
from daq.drivers.can.bus import SlcanBus, bus_reason, frames_of, messages_of, read_frames
from daq.drivers.can.hub import _open_bus
from daq.protocol.frames import can_frames
from daq.protocol.slcan import encode
from tests.support.daq.can_buses import pty, read

pytestmark = pytest.mark.live

FRAMES = [(0x181, b"\1\2\3"), (0x281, b""), (0x8000_0000 | 0x12345, bytes(8))]


def test_frames_are_equal_read_as_block_or_as_messages() -> None:
    with pty() as (device, port), SlcanBus(port) as bus:
        os.write(device, encode(can_frames(FRAMES)))
        assert list(bus.recv_frames(1.0)) == FRAMES
        os.write(device, encode(can_frames(FRAMES)))
        messages = [bus.recv(1.0) for _ in FRAMES]
        assert [(m.arbitration_id, bytes(m.data), m.is_extended_id) for m in messages if m] == [
            (0x181, b"\1\2\3", False),
            (0x281, b"", False),
            (0x12345, bytes(8), True),
        ]
        assert bus.recv(0.0) is None
        assert len(bus.recv_frames(0.0)) == 0


def test_unread_messages_are_in_the_next_block() -> None:
    with pty() as (device, port), SlcanBus(port) as bus:
        os.write(device, encode(can_frames(FRAMES)))
        assert bus.recv(1.0) is not None
        assert list(read_frames(bus, 1.0).frames) == FRAMES[1:]


def test_bus_receives_frames_after_any_damaged_input() -> None:
    good = encode(can_frames(FRAMES))
    with pty() as (device, port), SlcanBus(port) as bus:
        for damage in (b"t18", b"t1813zz\r", b"\xff" * 3000, b"T\r\r\x07V1013\r", good[:-7]):
            os.write(device, damage + b"\r" + good)
            found: list[tuple[int, bytes]] = []
            end = time.monotonic() + 10
            while found[-3:] != FRAMES:  # a pty hands what was written over in pieces
                assert time.monotonic() < end, damage
                found += bus.recv_frames(1.0)
        assert bus.bad_lines == 5


def test_opening_and_sending_write_the_expected_slcan_commands() -> None:
    with pty() as (device, port):
        with SlcanBus(port, 500_000) as bus:
            bus.send(can.Message(arbitration_id=0x603, data=b"\x40\x08\x10", is_extended_id=False))
            bus.send(can.Message(arbitration_id=0x1ABCDE, is_remote_frame=True, dlc=4))
            with pytest.raises(can.CanOperationError, match="CAN FD"):
                bus.send(can.Message(arbitration_id=1, is_fd=True))
        expected = b"\rC\rZ0\rS6\rO\rt6033400810\rR001ABCDE4\rC\r"
        assert read(device, len(expected)) == expected


def test_messages_are_unchanged_by_conversion_to_frames_and_back() -> None:
    messages = [
        can.Message(arbitration_id=0x603, data=b"\x40\x08", is_extended_id=False),
        can.Message(arbitration_id=0x1ABCDE, is_remote_frame=True, dlc=4),
    ]
    again = messages_of(frames_of([*messages, can.Message(is_error_frame=True)]), 12.5)
    assert all(a.equals(b, timestamp_delta=None) for a, b in zip(again, messages, strict=True))
    assert {message.timestamp for message in again} == {12.5}


def test_unplugged_adapter_raises_can_operation_error() -> None:
    device, slave = os.openpty()
    port = os.ttyname(slave)
    bus = SlcanBus(port)
    os.close(slave)
    os.close(device)
    with pytest.raises(can.CanOperationError, match=port):
        bus.recv_frames(1.0)
    with pytest.raises(can.CanOperationError, match=port):
        bus.send(can.Message(arbitration_id=1))
    bus.shutdown()
    bus.shutdown()  # once is enough, twice does no harm


def test_failure_to_open_names_the_port_in_the_error() -> None:
    with pytest.raises(ValueError, match=r"bitrate of /dev/none: expected one of \[10000, .* found 123"):
        SlcanBus("/dev/none", 123)
    with pytest.raises(can.CanInitializationError, match="/dev/none"):
        SlcanBus("/dev/none")
    with (
        pty() as (_, port),
        SlcanBus(port),
        pytest.raises(can.CanInitializationError, match=re.escape(port)),
    ):
        SlcanBus(port)


def test_reason_of_a_bus_error_has_no_port_and_no_number() -> None:
    unsupported = OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))  # socketcan without the kernel's module
    assert bus_reason(unsupported) == "Address family not supported by protocol"
    with pytest.raises(can.CanInitializationError) as missing:
        SlcanBus("/dev/none")
    assert str(missing.value) == "/dev/none: No such file or directory"
    assert bus_reason(missing.value) == "No such file or directory"
    assert bus_reason(can.CanOperationError("of a backend")) == "of a backend"


def test_python_can_opens_slcan_bus_by_interface_name() -> None:
    with pty() as (device, port), can.Bus(interface="modalwatch-slcan", channel=port, bitrate=1_000_000) as bus:
        assert isinstance(bus, SlcanBus)
        os.write(device, b"t1811FF\r")
        message = bus.recv(1.0)
        assert message is not None
        assert bytes(message.data) == b"\xff"


@pytest.mark.parametrize(
    ("interface", "channel", "passed"), [("gs_usb", "0", 0), ("gs_usb", "canable", "canable"), ("kvaser", "0", "0")]
)
def test_channel_of_gs_usb_is_its_number(
    interface: str, channel: str, passed: str | int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """python-can compares it with the number of adapters."""
    opened: list[object] = []
    monkeypatch.setattr(can, "Bus", lambda **options: opened.append(options["channel"]))
    _open_bus(CanPlace(interface=interface, channel=channel))
    assert opened == [passed]

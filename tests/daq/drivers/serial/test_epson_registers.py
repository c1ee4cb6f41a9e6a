"""Register commands and answers, and the emulator's registers as read by a host."""

import os
import select
import termios
import time
from collections.abc import Iterator

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from daq import IntArray, SystemClock, make_driver
from daq.emulator import EmulatedEpson
from daq.protocol import epson
from tests.support.daq.can_buses import serving

bytes_ = st.integers(0, 255)


class Still:
    """A source at rest."""

    def start(self, time: int, rate: float) -> None:
        self.started, self.rate = time, rate

    def read(self, index: int, n: int) -> IntArray:
        return np.zeros((n, 3), np.int32)


@pytest.fixture
def device() -> Iterator[EmulatedEpson]:
    emulated = EmulatedEpson(Still(), SystemClock(), serial_number="T0000042")
    yield emulated
    emulated.close()


@pytest.fixture
def line(device: EmulatedEpson) -> Iterator[int]:
    descriptor = os.open(device.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    yield descriptor
    os.close(descriptor)


def ask(device: EmulatedEpson, line: int, window: int, address: int) -> int:
    """Return a register as the host reads it."""
    os.write(line, epson.write_register(epson.WINDOW, window) + epson.read_register(address))
    return epson.parse_reply(_answer(device, line), address)


def _answer(device: EmulatedEpson, line: int) -> bytes:
    """Serve until four bytes were returned: a pty passes on written bytes when the kernel schedules it."""
    reply, until = b"", time.monotonic() + 5.0
    while len(reply) < 4 and time.monotonic() < until:
        device.serve()
        if select.select([line], [], [], 0.01)[0]:
            reply += os.read(line, 4 - len(reply))
    return reply


@pytest.mark.live
@pytest.mark.parametrize(("rate", "number"), [(1000, 10), (50, 6)])
def test_driver_sets_the_filter_of_the_vendor_driver(device: EmulatedEpson, rate: int, number: int) -> None:
    with serving(device.serve):
        driver = make_driver("epson-uart", device.port, rate)
        driver.open()
        driver.close()
    line = os.open(device.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    termios.tcflush(line, termios.TCIFLUSH)  # scans that were on their way
    assert ask(device, line, 1, epson.FILTER_CTRL) == number
    os.close(line)


@given(st.integers(0, 0x7F), bytes_)
def test_register_commands_have_three_bytes(address: int, value: int) -> None:
    assert epson.write_register(address, value) == bytes([0x80 + address, value, 0x0D])
    assert epson.read_register(address) == bytes([address, 0, 0x0D])


@given(st.integers(0, 0x7E), st.integers(0, 0xFFFF))
def test_register_reply_round_trip(address: int, value: int) -> None:
    assert epson.parse_reply(epson.register_reply(address, value), address) == value


@given(st.binary(max_size=6), st.integers(0, 0x7E))
def test_malformed_register_reply_is_refused(reply: bytes, address: int) -> None:
    if len(reply) == 4 and reply[0] == address and reply[3] == 0x0D:
        return
    with pytest.raises(ValueError, match=f"register {address:#04x}: expected 4 bytes"):
        epson.parse_reply(reply, address)


def test_reply_of_another_register_is_refused() -> None:
    with pytest.raises(ValueError, match="register 0x4c"):
        epson.parse_reply(epson.register_reply(0x4E, 1), 0x4C)


def test_emulator_returns_identity_product_and_serial_number(device: EmulatedEpson, line: int) -> None:
    assert ask(device, line, 0, epson.ID) == 0x5345
    words = [ask(device, line, 1, address) for address in (*epson.PRODUCT, *epson.SERIAL)]
    assert b"".join(word.to_bytes(2, "little") for word in words) == b"A352AD10T0000042"


def test_emulator_stores_low_and_high_byte_of_register(device: EmulatedEpson, line: int) -> None:
    for command in ((epson.WINDOW, 1), (epson.BURST_CTRL_LOW, 0x03), (epson.BURST_CTRL_HIGH, 0xC7)):
        os.write(line, epson.write_register(*command))
    assert ask(device, line, 1, epson.BURST_CTRL_LOW) == epson.BURST_ALL


def test_emulator_ignores_invalid_commands(device: EmulatedEpson, line: int) -> None:
    os.write(line, b"\x00\xff\x80\x13")
    assert ask(device, line, 0, epson.ID) == 0x5345


def test_emulator_streams_from_first_scan_until_stop_command(device: EmulatedEpson, line: int) -> None:
    os.write(line, epson.write_register(epson.WINDOW, 0) + epson.write_register(epson.MODE_CTRL, epson.MODE_SAMPLING))
    device.serve()
    device.serve()
    assert device.sampling_since is not None
    found = epson.BurstDecoder().feed(os.read(line, 4096)).counter.tolist()
    assert found == list(range(len(found)))
    assert found
    os.write(line, epson.write_register(epson.MODE_CTRL, epson.MODE_CONFIG))
    device.serve()
    assert device.sampling_since is None

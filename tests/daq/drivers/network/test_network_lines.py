"""Lines of text over a network: addresses, lost and exchanged datagrams, a second sender."""

import socket
import time

import numpy as np
import pytest

from daq import Block, DeviceReader, DriverError, Event, Item, ScaledClock, SystemClock, make_driver
from daq.drivers import LineFormat, TextAddress
from daq.drivers.network.ports import UdpPort, network_address
from daq.emulator import EmulatedAdapter, EmulatedTextLines, FaultyNetwork, free_port
from tests.support.daq.blocks import START
from tests.support.daq.can_buses import serving, wait_for
from tests.support.daq.emulated_ports import Ramp
from tests.support.daq.readers import running

FORM = LineFormat(columns=("counter", "x", "y", "z"), unit="g")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("tcp://192.0.2.7:23", ("tcp", "192.0.2.7", 23)),
        ("udp://:8888", ("udp", "", 8888)),
        ("udp://127.0.0.1:8888", ("udp", "127.0.0.1", 8888)),
        ("tcp://[::1]:5000", ("tcp", "::1", 5000)),
    ],
)
def test_addresses_have_kind_host_and_port(text: str, parts: tuple[str, str, int]) -> None:
    found = network_address(text)
    assert found is not None
    assert (found.kind, found.host, found.port) == parts


@pytest.mark.parametrize(
    "text", ["tcp://:23", "tcp://host", "udp://:0", "udp://", "http://host:80", "tcp://host:99999", "tcp://[:1"]
)
def test_other_addresses_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="port: expected tcp://HOST:PORT or udp://:PORT, found"):
        make_driver("serial-text", TextAddress(port=text, form=FORM), 100.0)


def test_paths_of_serial_ports_are_no_addresses() -> None:
    assert network_address("/dev/ttyUSB0") is None
    assert network_address("COM3") is None


@pytest.mark.live
def test_refused_connection_is_an_error_with_the_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
    driver = make_driver("serial-text", TextAddress(port=f"tcp://127.0.0.1:{number}", form=FORM), 100.0)
    with pytest.raises(DriverError, match=rf"^tcp://127\.0\.0\.1:{number}: no sensor .* answers: .*refused"):
        driver.open()


@pytest.mark.live
@pytest.mark.parametrize("seed", [1])
def test_lost_datagrams_are_exact_gaps_and_exchanged_ones_are_put_in_order_or_dropped(seed: int) -> None:
    clock = ScaledClock(speed=4.0, origin_wall=time.time_ns(), origin=START)
    network = FaultyNetwork(free_port(), lost=0.05, repeated=0.05, exchanged=0.05, seed=seed)
    device = EmulatedAdapter(EmulatedTextLines(Ramp(), clock, FORM, rate=500.0), "udp", network)
    items: list[Item] = []
    with serving(device.serve):
        driver = make_driver("serial-text", TextAddress(port=device.port, form=FORM), 500.0)
        reader = DeviceReader("d", driver, 500.0, clock, items.append, block_seconds=0.05)
        with running([reader]):
            wait_for(lambda: any(isinstance(item, Block) and item.end_index > 2500 for item in items))
    device.close()
    blocks = [item for item in items if isinstance(item, Block)]
    gaps = [item.payload for item in items if isinstance(item, Event) and item.topic == "/event/gap"]
    index = np.concatenate([np.arange(b.first_index, b.end_index) for b in blocks])
    k = np.concatenate([b.counts[:, 0] for b in blocks])
    np.testing.assert_array_equal(k - k[0], index - index[0])
    assert np.all(np.diff(index) > 0)
    assert network.lost > 0
    assert sum(gap["missing"] for gap in gaps) == index[-1] - index[0] + 1 - len(index)
    assert all(gap["exact"] for gap in gaps)
    assert not [item for item in items if isinstance(item, Event) and item.topic == "/event/device_failed"]


@pytest.mark.live
def test_datagrams_of_a_second_sender_are_dropped() -> None:
    number = free_port()
    address = network_address(f"udp://127.0.0.1:{number}")
    assert address is not None
    port = UdpPort(address)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
    ):
        for text in (b"a", b"b"):
            first.sendto(text, ("127.0.0.1", number))
            second.sendto(text.upper(), ("127.0.0.1", number))
        found = b""
        end = time.monotonic() + 5.0
        while len(found) < 2 and time.monotonic() < end:
            found += port.read()
        assert found + port.read() == b"ab"
    port.close()


@pytest.mark.live
def test_port_of_another_program_is_named() -> None:
    number = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", number))
        driver = make_driver("serial-text", TextAddress(port=f"udp://:{number}", form=FORM), 100.0)
        with pytest.raises(DriverError, match=rf"^udp://:{number}: .* the port is in use by another program$"):
            driver.open()


@pytest.mark.live
def test_adapter_serves_a_new_connection_after_the_last_one() -> None:
    device = EmulatedAdapter(EmulatedTextLines(Ramp(), SystemClock(), FORM, rate=500.0), "tcp")
    with serving(device.serve):
        driver = make_driver("serial-text", TextAddress(port=device.port, form=FORM), 500.0)
        for _ in range(2):
            driver.open()
            assert len(driver.read().counts)
            driver.close()
    device.close()

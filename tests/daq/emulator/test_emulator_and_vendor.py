"""The emulated M-A352: the vendor's driver takes it for the device, a full line never stops it, a pulled plug does."""

import itertools
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import serial

from daq import Block, DeviceReader, DriverError, Event, IntArray, Item, ScaledClock, SystemClock, make_driver
from daq.emulator import EmulatedEpson, EmulatedSlcan
from daq.protocol.epson import temperature_raw

pytestmark = pytest.mark.live

ORIGIN = 1_767_225_600_000_000_000  # ns UTC
RATE = 1000.0


class Steps:
    """A source whose counts contain the number of the scan, in steps so wide that their differences wrap."""

    def start(self, time: int, rate: float) -> None:
        """Begin."""

    def read(self, index: int, n: int) -> IntArray:
        return steps(np.arange(index, index + n))


def steps(index: np.ndarray[tuple[int], np.dtype[np.intp]]) -> IntArray:
    return np.asarray((index[:, None] * [1, 100_003, -1_000_000_007]).astype(np.int32))


@contextmanager
def served(*devices: EmulatedEpson) -> Iterator[None]:
    """Serve emulated devices from a thread."""
    stop = threading.Event()

    def serve() -> None:
        while not stop.wait(0.002):
            for device in devices:
                device.serve()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        for device in devices:
            device.close()


def test_vendor_driver_reads_the_emulated_device(monkeypatch: pytest.MonkeyPatch) -> None:
    esensorlib = pytest.importorskip("esensorlib.sensor_device")
    monkeypatch.setattr(serial.Serial, "set_low_latency_mode", lambda *_: None)  # a pty has none
    device = EmulatedEpson(Steps(), SystemClock(), serial_number="T0000042")
    with served(device):
        sensor = esensorlib.SensorDevice(port=device.port, speed=460800, if_type="uart")
        assert (sensor.info["prod_id"], sensor.info["serial_id"]) == ("A352AD10", "T0000042")
        sensor.set_config(output_rate=1000, uart_auto=True, ndflags=True, tempc=True, counter=True, chksm=True)
        sensor.goto("sampling")
        found = [sensor.read_sample_unscaled() for _ in range(200)]
        sensor.goto("config")
        sensor.port_io.close()
    first = found[0][5]
    index = np.arange(first, first + 200)
    assert [sample[5] for sample in found] == index.tolist()
    np.testing.assert_array_equal([sample[2:5] for sample in found], steps(index))
    assert {sample[1] for sample in found} == {temperature_raw(21.0)}


def test_full_line_does_not_block_device_and_drops_are_counted() -> None:
    clock = ScaledClock(speed=1000.0, origin_wall=time.time_ns(), origin=ORIGIN)
    device = EmulatedEpson(Steps(), clock, serial_number="A")
    port = serial.Serial(device.port, timeout=0)
    port.write(bytes.fromhex("fe000d 83010d"))  # window 0, sampling
    longest, sent = 0.0, list[int]()
    for seconds in (0.3, 0.2):
        start = time.monotonic()
        while time.monotonic() < start + seconds:
            began, asked = time.monotonic(), clock.now()
            device.serve()
            longest = max(longest, time.monotonic() - began)
            time.sleep(0.01)
        sent.append(device.sent)
    port.close()
    device.close()
    # 0.3 s are 300 000 scans, more than pty and adapter hold: from then on all are dropped, but for what the kernel
    # moves from the one to the other.
    assert sent[1] - sent[0] < 1000
    assert device.sampling_since is not None
    assert device.sent + device.dropped >= (asked - device.sampling_since) * 1e-9 * RATE
    assert longest < 0.4


def test_unplugged_device_sends_nothing_and_can_be_closed_twice() -> None:
    device = EmulatedEpson(Steps(), SystemClock(), serial_number="A")
    device.close()
    device.close()
    device.serve()
    assert (device.sent, device.dropped) == (0, 0)


def test_port_of_unplugged_device_is_not_reused() -> None:
    """The kernel gives the lowest number that is free to the next pty."""
    device = EmulatedEpson(Steps(), SystemClock(), serial_number="A")
    adapter = EmulatedSlcan([])
    for unplugged in (device, adapter):
        unplugged.close()
        assert not Path(unplugged.port).exists()
    another = EmulatedEpson(Steps(), SystemClock(), serial_number="B")
    assert another.port not in (device.port, adapter.port)
    another.close()


def test_port_lost_during_handshake_raises_driver_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(_: serial.Serial) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(serial.Serial, "reset_input_buffer", gone)
    device = EmulatedEpson(Steps(), SystemClock(), serial_number="A")
    with served(device), pytest.raises(DriverError, match="Input/output error"):
        make_driver("epson-uart", device.port, RATE).open()


def wait_for(items: list[Item], topic: str) -> None:
    end = time.monotonic() + 10
    while not any(isinstance(item, Event) and item.topic == topic for item in items):
        assert time.monotonic() < end, f"no {topic} within 10 s"
        time.sleep(0.02)


def test_device_recovers_when_its_link_points_to_new_port(tmp_path: Path) -> None:
    items: list[Item] = []
    clock = ScaledClock(speed=4.0, origin_wall=time.time_ns(), origin=ORIGIN)
    before, after = (EmulatedEpson(Steps(), clock, serial_number="A") for _ in range(2))
    link = tmp_path / "by-id"
    link.symlink_to(before.port)
    reader = DeviceReader("a", make_driver("epson-uart", str(link), RATE), RATE, clock, items.append)
    with served(after):
        with served(before):
            reader.connect()
            reader.start()
            time.sleep(0.5)
            link.unlink()
        wait_for(items, "/event/device_failed")
        link.symlink_to(after.port)
        wait_for(items, "/event/device_recovered")
        time.sleep(0.5)
        reader.stop()
        reader.join()
    events = [item for item in items if isinstance(item, Event)]
    assert [e.topic for e in events] == [
        f"/event/{what}" for what in ("device_open", "device_failed", "device_recovered", "gap")
    ]
    lost, gap = items.index(events[1]), items.index(events[3])
    assert_consecutive(items[1:lost], first=0)
    new = assert_consecutive(items[gap + 1 :], first=events[3].payload["first_index"] + events[3].payload["missing"])
    last = items[lost - 1]
    assert isinstance(last, Block)
    assert events[3].payload["first_index"] == last.end_index
    # Indices go on by the host's clock, to the latency of the first read (0.1 s of wall time at most).
    elapsed = (new[0].arrival_time - last.arrival_time) * 1e-9 * RATE
    assert new[0].arrival_index - last.arrival_index == pytest.approx(elapsed, abs=0.1 * 4 * RATE)


def assert_consecutive(items: list[Item], first: int) -> list[Block]:
    """Assert that items are blocks of a device's scans from its start on, from index `first` on."""
    blocks = [item for item in items if isinstance(item, Block)]
    assert len(blocks) == len(items) > 0
    assert blocks[0].first_index == first
    assert all(a.end_index == b.first_index for a, b in itertools.pairwise(blocks))
    counts = np.concatenate([b.counts for b in blocks])
    np.testing.assert_array_equal(counts, steps(np.arange(len(counts))))
    return blocks

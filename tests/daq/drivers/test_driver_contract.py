"""Contract of every driver of a port or a bus, tested with its emulated device in another process."""

import itertools
import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from daq import (
    Block,
    CanAddress,
    DbcAddress,
    DeviceLost,
    DeviceReader,
    Driver,
    DriverError,
    Event,
    HostClock,
    IntArray,
    Item,
    SystemClock,
    make_driver,
)
from daq.drivers import CanPlace, DaqmxAddress, TextAddress
from tests.support.daq.can_buses import can_process, wait_for
from tests.support.daq.emulated_can import imu
from tests.support.daq.emulated_ports import LINES
from tests.support.daq.ports import Emulators, emulators
from tests.support.daqmx_runtime import Ramp, installed

pytestmark = pytest.mark.live

RATE = 1000.0
DBC = Path(__file__).parents[3] / "examples" / "imu.dbc"
_COARSE = 2**-8  # m/s2 per count: 16 bits up to 13 g
WIT = CanAddress(interface="slcan", channel="/dev/none", node=0x50, bitrate=250_000)
#: a place where nothing is, and the serial number of the emulated device, if such a device can tell one
DRIVERS: dict[str, tuple[str | CanPlace | TextAddress, str | None]] = {
    "epson-uart": ("/dev/none", "E0000000"),
    "modalwatch-node": ("/dev/none", "E0000000"),
    "witmotion": ("/dev/none", None),
    "serial-text": (TextAddress(port="/dev/none", form=LINES), None),
    "epson-can": (CanAddress(interface="slcan", channel="/dev/none", node=1), "100"),
    "witmotion on CAN": (WIT, None),
    "can-dbc": (DbcAddress(interface="slcan", channel="/dev/none", sensor=imu(DBC)), None),
}
#: places on a network, and the error of a second driver there; the ports are those of the emulators
NETWORK: dict[str, tuple[str | TextAddress, str]] = {
    "serial-text over TCP": (TextAddress(port="", form=LINES), "the connection is closed$"),
    "serial-text over UDP": (TextAddress(port="", form=LINES), "the port is in use by another program$"),
    "raspberry-shake": ("", "the port is in use by another program$"),
}
#: inputs of the simulated vendor library, in this process
INPUTS = {
    "nidaqmx": DaqmxAddress(
        inputs=tuple(f"cDAQ1Mod1/ai{k}" for k in range(3)), sensitivity=(100.0, 100.0, 100.0), range_g=50.0
    )
}
SERIAL_NUMBERS = {name: serial for name, (_, serial) in DRIVERS.items()} | {"nidaqmx": "1A2B3C"}
EVERY = (*DRIVERS, *NETWORK, *INPUTS)
RATES = dict.fromkeys(EVERY, RATE) | {
    "serial-text": 200.0,
    "serial-text over TCP": 200.0,
    "serial-text over UDP": 200.0,
    "raspberry-shake": 100.0,
    "witmotion": 200.0,
    "witmotion on CAN": 200.0,
    "nidaqmx": 2048.0,
}
TEMPERATURES = dict.fromkeys(EVERY, 21.0) | {  # [degC]; of some the frames have no room for it
    "raspberry-shake": float("nan"),
    "witmotion on CAN": float("nan"),
    "can-dbc": float("nan"),
    "nidaqmx": float("nan"),
}
#: end of the error of a second driver at a place, but of a bus
TAKEN = dict.fromkeys(DRIVERS, "the port is in use by another program$") | {
    **{name: error for name, (_, error) in NETWORK.items()},
    "nidaqmx": "cDAQ1Mod1/ai0 is in use by another device$",
}
SERIAL = [*(name for name, (place, _) in DRIVERS.items() if isinstance(place, str)), *NETWORK]


@dataclass(frozen=True)
class Device:
    """An emulated device in another process."""

    place: str | CanPlace | TextAddress | DaqmxAddress
    clock: HostClock
    unplug: Callable[[], None]

    @property
    def where(self) -> str:
        """Return the start of errors as a pattern."""
        return f"^{re.escape(str(self.place))}: "


@pytest.fixture(scope="module")
def ports() -> Iterator[Emulators]:
    """Run one device of each kind that is on a serial port or a network."""
    with emulators(1, kind=",".join(SERIAL)) as found:
        yield found


def make(name: str, place: str | CanPlace | TextAddress | DaqmxAddress, rate: float) -> Driver:
    """Return the driver of a row of the table."""
    return make_driver(name.partition(" ")[0], place, rate)


@contextmanager
def device(name: str, ports: Emulators, folder: Path) -> Iterator[Device]:
    """Run the device that a driver is for."""
    if name in INPUTS:
        runtime = Ramp(make(name, INPUTS[name], RATES[name]).scale)
        with installed(runtime):
            yield Device(INPUTS[name], SystemClock(), partial(setattr, runtime, "unplugged", True))
        return
    place = (DRIVERS | NETWORK)[name][0]
    if name in SERIAL:
        number = SERIAL.index(name)
        port = ports.ports[number]
        found = replace(place, port=port) if isinstance(place, TextAddress) else port
        yield Device(found, ports.clock, partial(ports.unplug, number))
        return
    if isinstance(place, TextAddress):  # it sends from its start on: a pty would hold old lines
        with emulators(1, kind=name) as own:
            yield Device(replace(place, port=own.ports[0]), own.clock, partial(own.unplug, 0))
        return
    assert isinstance(place, CanPlace)
    sensor = {"can-dbc": (str(DBC), "0", "0"), "witmotion on CAN": ("witmotion",)}.get(name, ())
    with can_process(folder, 0 if sensor else 1, dbc=sensor) as bus:
        yield Device(replace(place, channel=bus.channel), bus.clock, partial(bus.say, "unplug"))


def scans_of(driver: Driver, n: int, temperature: float) -> tuple[IntArray, IntArray]:
    """Return counts and counters of at least n scans, all taken at a temperature."""
    counts: list[IntArray] = []
    counters: list[IntArray] = []
    until = time.monotonic() + 10.0
    while sum(len(part) for part in counts) < n:
        assert time.monotonic() < until, f"not {n} scans within 10 s"
        scans = driver.read()
        assert scans.bad_bytes == 0
        assert 0 <= scans.age < 1e9
        assert not len(scans.counts) or scans.temperature == pytest.approx(temperature, abs=0.005, nan_ok=True)
        counts.append(scans.counts)
        if len(scans.counts):
            assert scans.counter.dtype == (np.intp if scans.clock else np.int32)  # a common clock counts for good
        counters.append(scans.counter.astype(np.int64))
    return np.concatenate(counts), np.concatenate(counters)


def check_stream(driver: Driver, rate: float, temperature: float) -> None:
    """Read a ramp: scan k is (k, -k, 3 k), and the counter increases with it."""
    counts, counter = scans_of(driver, round(rate / 5), temperature)
    assert counts.dtype == np.int32
    k = counts[0, 0] + np.arange(len(counts), dtype=np.int32)
    most = np.iinfo(np.int16 if driver.scale == _COARSE else np.int32).max  # that the device can send
    np.testing.assert_array_equal(counts, np.minimum(np.stack([k, -k, 3 * k], axis=1), most))
    np.testing.assert_array_equal(np.remainder(np.diff(counter), driver.modulus), 1)
    assert 0 < driver.scale < 1e-2


def check_blocks_until_unplugged(driver: Driver, found: Device, rate: float) -> None:
    """Let a reader cut the stream into blocks, and pull the plug."""
    items: list[Item] = []
    reader = DeviceReader("d", driver, rate, found.clock, items.append, block_seconds=0.05)
    reader.connect()
    reader.start()
    wait_for(lambda: len(items) > 3)
    found.unplug()
    wait_for(lambda: isinstance(items[-1], Event))
    reader.stop()
    reader.join(10.0)
    lost = next(item for item in items[1:] if isinstance(item, Event))
    assert lost.topic == "/event/device_failed"
    silent = str(found.place).startswith("udp:")  # nothing else tells that such a device is gone
    assert re.match("d: silent for 1.7 s" if silent else found.where, lost.payload["why"])
    blocks = [item for item in items if isinstance(item, Block)]
    assert {block.scale for block in blocks} == {driver.scale}
    assert blocks[0].first_index == 0 or blocks[0].clock  # numbers of a common clock continue
    assert all(a.end_index == b.first_index for a, b in itertools.pairwise(blocks))


def check_life(found: Device, name: str) -> None:
    """Open, read, be alone at the port, close, open again, be unplugged."""
    driver, other = (make(name, found.place, RATES[name]) for _ in range(2))
    identity = driver.open()
    assert identity.payload() == json.loads(json.dumps(identity.payload()))
    assert (identity.serial or None) == SERIAL_NUMBERS.get(name)
    check_stream(driver, RATES[name], TEMPERATURES[name])
    taken = "" if isinstance(found.place, CanPlace) else TAKEN[name]
    with pytest.raises(DriverError, match=f"{found.where}.*{taken}"):
        other.open()
    driver.close()
    driver.close()
    with pytest.raises(DeviceLost, match=f"{found.where}is not open"):
        driver.read()
    check_blocks_until_unplugged(driver, found, RATES[name])


THOROUGH = {"serial-text over UDP"}  # as over TCP, and as the datagrams of a Raspberry Shake


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.thorough] * (n in THOROUGH)) for n in EVERY])
def test_driver_satisfies_the_driver_contract(name: str, ports: Emulators, tmp_path: Path) -> None:
    with device(name, ports, tmp_path) as found:
        check_life(found, name)


@pytest.mark.parametrize("name", DRIVERS)
def test_missing_port_is_named_in_the_error(name: str) -> None:
    with pytest.raises(DriverError, match=r"/dev/none.*: (no .* answers|the bus cannot be opened): .*No such file"):
        make(name, DRIVERS[name][0], RATES[name]).open()


@pytest.mark.parametrize("name", [*DRIVERS, *INPUTS])
@pytest.mark.parametrize("rate", [0.0, -1000.0, float("nan")])
def test_nonpositive_or_nan_rate_is_refused(name: str, rate: float) -> None:
    place = INPUTS[name] if name in INPUTS else DRIVERS[name][0]
    with pytest.raises(ValueError, match=f"rate of .*{re.escape(str(place))}.*: expected "):
        make(name, place, rate)

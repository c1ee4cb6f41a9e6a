"""NI-DAQmx without hardware: the library's own Python layer above a stand-in for its C library."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from nidaqmx.constants import AccelSensitivityUnits, AccelUnits, Coupling, ExcitationSource

from daq import Block, DeviceReader, DriverError, Event, Item, SystemClock, make_driver
from daq.drivers import DaqmxAddress, ni_daqmx
from tests.support.daqmx_runtime import Runtime, installed

RATE, GRAVITY = 2048.0, 9.80665


@pytest.fixture
def runtime() -> Iterator[Runtime]:
    with installed(Runtime()) as found:
        yield found


def address(*inputs: str, excitation: float = 4.0) -> DaqmxAddress:
    sensitivity = tuple(100.0 + k for k in range(len(inputs)))
    return DaqmxAddress(inputs=inputs, sensitivity=sensitivity, range_g=50.0, excitation=excitation)


def test_inputs_are_configured_as_the_settings_say(runtime: Runtime) -> None:
    driver = make_driver("nidaqmx", address("cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1"), RATE)
    identity = driver.open()
    assert (identity.product, identity.serial) == ("NI 9234", "1A2B3C")
    driver.read()
    [task] = [task for task in runtime.tasks.values() if task.started]
    limit, units = 50 * GRAVITY, AccelUnits.METERS_PER_SECOND_SQUARED.value
    per, source = AccelSensitivityUnits.MILLIVOLTS_PER_G.value, ExcitationSource.INTERNAL.value
    assert list(task.channels) == ["cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1"]
    for settings, sensitivity in zip(task.channels.values(), (100.0, 101.0), strict=True):
        assert settings[1:] == (-limit, limit, units, sensitivity, per, source, 0.004, "")
    assert set(runtime.coupling.values()) == {Coupling.AC.value}
    driver.close()
    assert not any(task.started for task in runtime.tasks.values())
    runtime.coupling.clear()
    driver = make_driver("nidaqmx", address("cDAQ1Mod1/ai0", excitation=0), RATE)
    driver.open()
    driver.close()
    assert runtime.coupling == {}


@pytest.mark.usefixtures("runtime")
def test_errors_are_one_message() -> None:
    with pytest.raises(DriverError, match=r"^cDAQ1Mod9/ai0: Device identifier is invalid\. Device Specified: x"):
        make_driver("nidaqmx", address("cDAQ1Mod9/ai0"), RATE).open()
    with pytest.raises(DriverError, match=r"rate: expected 1003\.921569 Hz, the nearest one of the device, found 1000"):
        make_driver("nidaqmx", address("cDAQ1Mod1/ai0"), 1000.0).open()
    first = make_driver("nidaqmx", address("cDAQ1Mod1/ai0"), RATE)
    first.open()
    with pytest.raises(DriverError, match="rate: expected 2048 Hz, as the other devices of cDAQ1, found 1024"):
        make_driver("nidaqmx", address("cDAQ1Mod2/ai0"), 1024.0).open()
    first.close()
    assert ni_daqmx.daqmx_devices()[1] == ("cDAQ1Mod2", "NI 9234", [f"cDAQ1Mod2/ai{k}" for k in range(4)])


def test_machine_without_the_runtime_has_no_devices() -> None:
    with pytest.raises(DriverError, match=r"^cDAQ1Mod1/ai0: needs the NI-DAQmx runtime of National Instruments"):
        make_driver("nidaqmx", address("cDAQ1Mod1/ai0"), RATE).open()
    assert ni_daqmx.daqmx_devices() == []


def until(true: Callable[[], object]) -> None:
    end = time.monotonic() + 20
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_two_devices_share_samples_and_return_after_an_error(runtime: Runtime) -> None:
    """Both have the same numbers; after an error these continue by the clock of the host, and the gap is counted."""
    items: list[Item] = []
    places = {"a": address("cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1", "cDAQ1Mod1/ai2"), "b": address("cDAQ1Mod2/ai0")}
    readers = [
        DeviceReader(name, make_driver("nidaqmx", place, RATE), RATE, SystemClock(), items.append)
        for name, place in places.items()
    ]
    for reader in readers:
        reader.connect()
    for reader in readers:
        reader.start()

    def blocks(name: str) -> list[Block]:
        return [item for item in tuple(items) if isinstance(item, Block) and item.device == name]

    def events(topic: str) -> list[Event]:
        return [item for item in tuple(items) if isinstance(item, Event) and item.topic.endswith(topic)]

    until(lambda: min(len(blocks("a")), len(blocks("b"))) >= 3)
    runtime.unplugged = True
    until(lambda: len(events("device_failed")) == 2)
    time.sleep(0.2)
    runtime.unplugged = False
    until(lambda: len(events("device_recovered")) == 2)
    n = len(blocks("a")), len(blocks("b"))
    until(lambda: len(blocks("a")) > n[0] + 2 and len(blocks("b")) > n[1] + 2)
    for reader in readers:
        reader.stop()
    for reader in readers:
        reader.join()
    assert runtime.most == 1
    clocks = {name: {block.clock for block in blocks(name)} for name in places}
    common = clocks["a"] & clocks["b"]
    assert len(common) >= 2  # before and after
    values: dict[tuple[str, int], float] = {}
    for block in blocks("a"):
        np.testing.assert_allclose(np.diff(block.counts, axis=1) * block.scale, 1000 / 64, atol=2 * block.scale)
        values |= {(block.clock, block.first_index + k): block.counts[k, 0] * block.scale for k in range(block.n_scans)}
    shared = 0
    for block in (block for block in blocks("b") if block.clock in common):
        for k in range(0, block.n_scans, 97):
            if (block.clock, block.first_index + k) in values:
                shared += 1
                other = values[block.clock, block.first_index + k]
                assert block.counts[k, 0] * block.scale == pytest.approx(other + 3000 / 64, abs=2 * block.scale)
    assert shared >= 10
    for name in places:
        starts = [block.first_index for block in blocks(name)]
        assert starts == sorted(starts)
        gaps = [event for event in events("gap") if event.payload["device"] == name]
        assert sum(event.payload["missing"] for event in gaps) >= 0.2 * RATE

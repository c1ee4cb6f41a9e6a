"""Times are of the motion, not of what a filter lets through later: against a device that filters as hardware does."""

import itertools
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from can_helpers import serving, wait_for
from daq_helpers import START
from scipy.signal import firwin

from daq import (
    Assembler,
    Block,
    Channel,
    DeviceReader,
    EmulatedEpson,
    EmulatedNode,
    Event,
    FloatArray,
    HostClock,
    IntArray,
    Item,
    ScaledClock,
    make_driver,
)
from daq.drivers.base import Driver
from daq.emulator.serial_port import SerialEmulator
from daq.protocol.epson_filters import CUTOFF, FILTERS, TAPS, group_delay

RATE = 1000.0
TONES = (3.3, 17.1, 41.7)  # Hz


def motion(t: FloatArray) -> FloatArray:
    """Return a motion (n,) at times since START (n,) [s]."""
    return np.asarray(2e4 * sum(np.sin(2 * np.pi * f * t + f) for f in TONES))


class Sensed:
    """The motion, through a low-pass that runs at 4000 Hz on what has been, or none."""

    def __init__(self, taps: FloatArray) -> None:
        self._taps = taps

    def start(self, time: int, rate: float) -> None:
        """Note when it begins."""
        self._start, self._rate = (time - START) * 1e-9, rate

    def read(self, index: int, n: int) -> IntArray:
        """Return counts (n, 3)."""
        past = np.arange(len(self._taps)) / 4000.0
        t = self._start + np.arange(index, index + n) / self._rate
        moved = motion((t[:, None] - past).ravel()).reshape(n, -1) @ self._taps
        return np.repeat(np.rint(moved)[:, None], 3, axis=1).astype(np.int32)


class Undelayed(EmulatedEpson):
    """An M-A352 whose source filters, so that it need not send later."""

    def start(self, rate: float, delay: float = 0.0) -> None:
        super().start(rate, 0.0)


@contextmanager
def reading(devices: dict[str, tuple[SerialEmulator, Driver]], clock: HostClock) -> Iterator[list[Item]]:
    """Read devices that are served."""
    items: list[Item] = []
    readers = [DeviceReader(name, driver, RATE, clock, items.append) for name, (_, driver) in devices.items()]

    def serve() -> None:
        for device, _ in devices.values():
            device.serve()

    with serving(serve):
        for reader in readers:
            reader.connect()
            reader.start()
        yield items
        for reader in readers:
            reader.stop()
        for reader in readers:
            reader.join(10.0)
    for device, _ in devices.values():
        device.close()


def lateness(signal: FloatArray, t: FloatArray) -> float:
    """Return how late a signal (n,) is after the motion at times (n,) [s], by the phase of its slowest tone."""
    tone = np.exp(-2j * np.pi * TONES[0] * t) * np.hanning(len(t))
    turned = np.angle(np.vdot(motion(t), tone) / np.vdot(signal, tone))
    return float(turned / (2 * np.pi * TONES[0]))


@pytest.mark.live
def test_what_a_filter_delays_is_told_when_it_was() -> None:
    clock = ScaledClock(speed=6.0, origin_wall=time.time_ns(), origin=START)
    low_pass = np.asarray(firwin(512, 460.0, window=("kaiser", 5.65), fs=4000.0))  # 60 dB
    filtering = Undelayed(Sensed(low_pass), clock, serial_number="E")
    plain = EmulatedNode(Sensed(np.ones(1)), clock, serial_number="N")
    late = EmulatedEpson(Sensed(np.ones(1)), clock, serial_number="L")  # as emulated: it sends later
    devices: dict[str, tuple[SerialEmulator, Driver]] = {
        "filtering": (filtering, make_driver("epson-uart", filtering.port, RATE)),
        "plain": (plain, make_driver("modalwatch-node", plain.port, RATE)),
        "late": (late, make_driver("epson-uart", late.port, RATE)),
    }
    with reading(devices, clock) as items:
        wait_for(lambda: sum(isinstance(item, Block) for item in items) > 57)
    opened = {e.payload["device"]: e.payload.get("filter_delay") for e in items if isinstance(e, Event)}
    assert opened == {"filtering": 0.063875, "plain": None, "late": 0.063875}
    channels = tuple(Channel(name=name, device=name, axis=0) for name in devices)
    assembler = Assembler(channels, dict.fromkeys(devices, RATE), window_seconds=1.2, step_seconds=1.2)
    recording = next(itertools.chain.from_iterable(assembler.push(i) for i in items if isinstance(i, Block)))
    t = (recording.start - START) * 1e-9 + np.arange(len(recording.data)) / RATE
    found = dict(zip(devices, (lateness(column, t) for column in recording.data.T), strict=True))
    # Each is as late as its way to a busy host at six times real time; a filter's 64 ms that were left would show.
    assert all(-1e-3 < seconds < 0.03 for seconds in found.values()), found


def test_lateness_is_measured_in_seconds() -> None:
    t = np.arange(1200) / RATE
    assert lateness(motion(t - 0.01), t) == pytest.approx(0.01, abs=1e-3)  # other tones leak into that one


def test_filters_are_those_of_the_vendors_driver_and_end_below_half_the_rate() -> None:
    assert {FILTERS[rate]: (TAPS[FILTERS[rate]], CUTOFF[FILTERS[rate]]) for rate in FILTERS} == {
        10: (512, 460),
        9: (512, 210),
        8: (512, 60),
        7: (512, 16),
        6: (512, 9),
    }
    assert all(CUTOFF[number] < rate / 2 for rate, number in FILTERS.items())
    assert group_delay(1) == 63 / 8000
    with pytest.raises(ValueError, match=r"filter: expected one of \[1, 2, .*10\], found 11"):
        group_delay(11)

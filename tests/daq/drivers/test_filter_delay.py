"""Times are those of the motion, not of the filter's output: tested with a device that filters as hardware does."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.signal import firwin

from daq import Block, DeviceIdentity, DeviceReader, Event, FloatArray, IntArray, Item, Scans
from daq.emulator import EmulatedEpson
from daq.protocol import epson
from daq.protocol.epson_filters import CUTOFF, FILTERS, TAPS, group_delay
from tests.support.daq.blocks import START, HandClock

RATE = 1000.0
TONES = (3.3, 17.1, 41.7)  # Hz


def motion(t: FloatArray) -> FloatArray:
    """Return a motion (n,) at times since START (n,) [s]."""
    return np.asarray(2e4 * sum(np.sin(2 * np.pi * f * t + f) for f in TONES))


class Sensed:
    """The motion, through a low-pass at 4000 Hz, or none."""

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


def lateness(signal: FloatArray, t: FloatArray) -> float:
    """Return how late a signal (n,) is after the motion at times (n,) [s], by the phase of its slowest tone."""
    tone = np.exp(-2j * np.pi * TONES[0] * t) * np.hanning(len(t))
    turned = np.angle(np.vdot(motion(t), tone) / np.vdot(signal, tone))
    return float(turned / (2 * np.pi * TONES[0]))


def test_measured_filter_delay_equals_stated_group_delay() -> None:
    low_pass = np.asarray(firwin(512, 460.0, window=("kaiser", 5.65), fs=4000.0))  # 60 dB
    sensed = Sensed(low_pass)
    sensed.start(START, RATE)
    signal = sensed.read(0, 1200)[:, 0].astype(float)
    # counts are whole numbers of 1/20 000 of a tone: far less than the 0.1 ms that is asked for
    assert lateness(signal, np.arange(1200) / RATE) == pytest.approx(group_delay(10), abs=1e-4)


@dataclass
class Delayed:
    """A device that sends one scan, `delay` after the motion [s]."""

    clock: HandClock
    delay: float = 0.0625
    scale: float = 1.0
    modulus: int = 1 << 16
    reader: DeviceReader | None = None

    def open(self) -> DeviceIdentity:
        return DeviceIdentity(product="P", serial="S1")

    def read(self) -> Scans:
        assert self.reader is not None
        self.reader.stop()
        return Scans(np.zeros((1, 3), np.int32), np.zeros(1, np.int32), 20.0, 0)

    def close(self) -> None:
        return


@pytest.mark.parametrize(("message", "taken"), [(None, 0.0625), (0.25, 0.25), (0.0, 0.0)])
def test_arrival_times_are_corrected_for_filter_delay(message: float | None, taken: float) -> None:
    items: list[Item] = []
    driver = Delayed(HandClock())
    reader = driver.reader = DeviceReader("d", driver, RATE, driver.clock, items.append, delay=message)
    reader.connect()
    reader.run()
    opened, block = items
    assert isinstance(opened, Event)
    assert opened.payload.get("filter_delay", 0.0) == taken
    assert isinstance(block, Block)
    assert block.arrival_time == START - round(taken * 1e9)


def test_emulated_device_delays_scans_by_its_filter_delay() -> None:
    clock = HandClock()
    device = EmulatedEpson(Sensed(np.ones(1)), clock, serial_number="E")
    for window, address, value in ((1, epson.FILTER_CTRL, 10), (0, epson.MODE_CTRL, epson.MODE_SAMPLING)):
        device.receive(epson.write_register(epson.WINDOW, window) + epson.write_register(address, value))
    sent = {}
    for ms in (0, 63, 64, 65):
        clock.time = START + ms * 1_000_000
        device.serve()
        sent[ms] = device.sent
    device.close()
    assert sent == {0: 0, 63: 0, 64: 1, 65: 2}


def test_lateness_of_signal_delayed_10_ms_is_10_ms() -> None:
    t = np.arange(1200) / RATE
    assert lateness(motion(t - 0.01), t) == pytest.approx(0.01, abs=1e-3)  # other tones leak into that one


def test_filters_match_vendor_driver_and_cut_off_below_nyquist() -> None:
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

"""The driver of lines of text: numbers of scans, refused sensors, and sensors that restart."""

import itertools
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from daq import DeviceIdentity, DeviceLost, Driver, DriverError, SystemClock, make_driver
from daq.drivers import LineFormat, TextAddress
from daq.drivers.serial.text_lines import ScanNumbers, TextLines
from daq.emulator import EmulatedTextLines
from daq.protocol.text_line import TextScans
from tests.support.daq.can_buses import pty, serving
from tests.support.daq.emulated_ports import Ramp

PLAIN = LineFormat(columns=("x",), unit="g")
CLOCKED = LineFormat(columns=("time_us", "x", "y", "z"), unit="g")
COUNTED = LineFormat(columns=("counter", "x", "y", "z"), unit="g")
SEEDS = range(4)


def numbered(
    counter: np.ndarray[tuple[int], np.dtype[np.intp]], time: np.ndarray[tuple[int], np.dtype[np.float64]]
) -> TextScans:
    """Return scans whose counts are (k, 0, 0) for the k-th."""
    n = len(counter)
    counts = np.zeros((n, 3), np.int32)
    counts[:, 0] = np.arange(n)
    return TextScans(counts, counter, time, np.full(n, np.nan), np.arange(n))


def fed(numbers: ScanNumbers, scans: TextScans, cuts: list[int]) -> tuple[list[int], list[int], int, bool]:
    """Return which scans are valid, their numbers, how many are refused, and whether a restart was found."""
    edges, which, found, refused, restarted = [0, *cuts, len(scans)], [], [], 0, False
    for a, b in itertools.pairwise(edges):
        valid, number, bad = numbers.evaluate(scans[a:b])
        which += valid.counts[:, 0].tolist()
        found += number.tolist()
        refused += bad
        restarted |= numbers.restarted
    return which, found, refused, restarted


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("bits", [8, 16, 32])
def test_false_counters_are_refused_and_wraps_continue(seed: int, bits: int) -> None:
    random, n = np.random.default_rng([seed, bits]), 1000
    k = np.setdiff1d(np.arange(n + 100), 500 + np.arange(100))  # a gap of 100 scans
    counter = (k + 2**bits - 300) % 2**bits
    false = np.sort(random.choice(np.arange(1, 160), 30, replace=False) * 3)  # none beside the gap
    far = (counter[false] + random.integers(20, 2**bits - 20, len(false))) % 2**bits
    counter[false] = far
    form = LineFormat(columns=COUNTED.columns, unit="g", counter_bits=bits)
    for n_cuts in (0, 10, 200):
        cuts = sorted(random.integers(0, n, n_cuts).tolist())
        which, found, refused, restarted = fed(ScanNumbers(form, 100.0), numbered(counter, k / 100.0), cuts)
        assert which == np.setdiff1d(np.arange(n), false).tolist()
        assert (np.array(found) - found[0]).tolist() == (k[which] - k[0]).tolist()
        assert (refused, restarted) == (len(false), False)


@pytest.mark.parametrize("form", [COUNTED, CLOCKED], ids=["counter", "time"])
def test_restart_is_found_but_not_in_a_false_or_repeated_line(form: LineFormat) -> None:
    k = np.r_[np.arange(100, 200), 150, np.arange(201, 300), 299, np.arange(300, 400)]
    harmless = numbered(k, k / 100.0)
    assert fed(ScanNumbers(form, 100.0), harmless, [50, 101, 250])[3] is False
    for first in (0, 1300):  # ahead: a clock that was set, since a sensor that is silent for 11 s is lost before
        restarted = np.r_[np.arange(100, 200), first + np.arange(3)]
        assert fed(ScanNumbers(form, 100.0), numbered(restarted, restarted / 100.0), [101, 102])[3] is True


@pytest.mark.parametrize("form", [COUNTED, CLOCKED, PLAIN], ids=["counter", "time", "line"])
def test_valid_lines_all_arrive_whatever_the_reads_are(form: LineFormat) -> None:
    k = np.arange(200)
    which, found, refused, restarted = fed(ScanNumbers(form, 100.0), numbered(k, k / 100.0), list(range(1, 200)))
    assert which == found == k.tolist()
    assert (refused, restarted) == (0, False)


@contextmanager
def plugged(form: LineFormat, rate: float, *, checksum: bool = False) -> Iterator[str]:
    device = EmulatedTextLines(Ramp(), SystemClock(), form, rate=rate, checksum=checksum)
    with serving(device.serve):
        yield device.port
    device.close()


def driver_of(port: str, form: LineFormat, rate: float = 200.0) -> Driver:
    return make_driver("serial-text", TextAddress(port=port, form=form), rate)


def read_for_a_while(driver: Driver) -> None:
    for _ in range(1000):
        driver.read()


@pytest.mark.live
def test_sensor_with_another_rate_is_refused() -> None:
    with (
        plugged(CLOCKED, 197.0) as port,
        pytest.raises(DriverError, match=rf"^{port}: no sensor .* answers: rate: expected 200 Hz, found 197 by the cl"),
    ):
        driver_of(port, CLOCKED).open()


@pytest.mark.parametrize(("rate", "wrong"), [(800.0, False), (1000.0, True)])
def test_times_in_whole_milliseconds_number_scans_up_to_800_hz(rate: float, wrong: bool) -> None:
    """With an oscillator 0.05 % fast; beyond, the rounding of a time may be half a period."""
    form = LineFormat(columns=("time_ms", "x"), unit="g")
    k, true = np.arange(20_000), rate * 1.0005
    scans = numbered(k, np.floor(1e3 * k / true + 0.37) * 1e-3)
    which, found, *_ = fed(ScanNumbers(form, true), scans, list(range(200, len(k), 200)))
    assert (which != found) is wrong
    driver = driver_of("/dev/none", form, rate)
    assert isinstance(driver, TextLines)
    if not wrong:
        assert driver._checked_rate(scans[:2000]) == pytest.approx(true, rel=1e-3)
        return
    with pytest.raises(ValueError, match="rate: expected up to 800 Hz with times in whole ms and without a counter"):
        driver._checked_rate(scans[:2000])


@pytest.mark.live
def test_lines_with_other_columns_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.serial.text_lines._WAIT_SECONDS", 0.3)
    with (
        plugged(LineFormat(columns=("x", "y"), unit="g"), 200.0) as port,
        pytest.raises(DriverError, match=r"answers: lines: expected counter x y z, found '0\.0\d+,-0\.0\d+'"),
    ):
        driver_of(port, COUNTED).open()
    with pty() as (_, port), pytest.raises(DriverError, match=r"answers: 0 lines within 0\.3 s$"):
        driver_of(port, COUNTED).open()


@pytest.mark.live
def test_restarted_sensor_is_lost_and_can_be_reopened() -> None:
    with pty() as (line, port):
        restart, number = threading.Event(), [1000]
        os.set_blocking(line, False)

        def serve() -> None:
            if restart.is_set():
                restart.clear()
                number[0] = 0
            number[0] += 1
            os.write(line, b"%d,1,2,3\n" % number[0])

        with serving(serve):
            driver = driver_of(port, COUNTED)
            identity = driver.open()
            assert identity == DeviceIdentity(product="text lines", details={"columns": "counter x y z"})
            restart.set()
            with pytest.raises(DeviceLost, match="the counter or the clock of the sensor has restarted"):
                read_for_a_while(driver)
            driver.close()
            assert driver.open() == identity
            driver.close()

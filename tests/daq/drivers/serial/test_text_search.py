"""Search for lines of text: columns, unit and rate from what a sensor at rest sends."""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from daq import SystemClock
from daq.drivers import LineFormat, PortAnswer, TextAddress
from daq.drivers.serial.text_search import _columns, search
from daq.emulator import EmulatedAdapter, EmulatedPort, EmulatedTextLines, serve_all, unplugging
from tests.support.daq.can_buses import pty, serving
from tests.support.daq.steady import AtRest

pytestmark = pytest.mark.live

G = 9_806_650  #: counts of a format with a unit
CLOCK = SystemClock()
#: columns, unit or scale of the sensor; its rate; what the search takes it for
SENSORS = [
    (LineFormat(columns=("time_ms", "x", "y", "z"), unit="g"), 100.0, None),
    (LineFormat(columns=("counter", "time_us", "x", "y", "z"), unit="mg"), 197.0, None),
    (LineFormat(columns=("x", "y", "z"), unit="m/s2"), 50.0, None),
    (LineFormat(columns=("counter", "x", "y", "z"), unit="mm/s2", decimal_comma=True), 100.0, None),
    (LineFormat(columns=("counter", "x", "y", "z"), unit="g"), 5.0, None),
    (
        LineFormat(columns=("counter", "x", "y", "z", "temperature"), scale=0.00061292),
        125.0,
        LineFormat(columns=("counter", "x", "y", "z", "-"), scale=0.0006129),
    ),
]


def test_columns_unit_and_rate_are_found() -> None:
    devices: list[EmulatedPort] = [
        EmulatedTextLines(AtRest(G if form.unit else 16_000), CLOCK, form, rate=rate, checksum=k == 1)
        for k, (form, rate, _) in enumerate(SENSORS)
    ]
    devices.append(EmulatedAdapter(EmulatedTextLines(AtRest(G), CLOCK, SENSORS[2][0], rate=50.0), "tcp"))
    with unplugging(devices), serving(lambda: serve_all(devices, 0)), ThreadPoolExecutor(len(devices)) as pool:
        answers = list(pool.map(lambda device: search(device.port, 0), devices))
    expected = [*SENSORS, SENSORS[2]]
    for device, answer, (form, rate, taken) in zip(devices, answers, expected, strict=True):
        assert isinstance(answer, PortAnswer), form
        assert len(answer.devices) == 1, answer
        (found,) = answer.devices
        assert found.place == TextAddress(port=device.port, form=taken or form)
        assert (found.driver, found.rate, found.axes) == ("serial-text", rate, (0, 1, 2))
        assert answer.who.startswith("lines of text: ")


@pytest.mark.parametrize("bits", [16, 32])
def test_clock_that_wraps_while_its_rate_is_measured_is_found(bits: int) -> None:
    time = (2**bits - 500 + 10 * np.arange(100)) % 2**bits
    values = np.column_stack([time, np.zeros(100), np.zeros(100), np.ones(100)])
    expected = LineFormat(columns=("time_ms", "x", "y", "z"), unit="g")
    assert _columns(values, 97.0) == (expected, 100.0)


def test_whole_numbers_have_a_scale_by_gravity() -> None:
    """8192 counts per g are usual, and nearer to 9807 mm/s2 than a sensor at rest may be off."""
    values = np.column_stack([np.arange(100), np.zeros(100), np.zeros(100), np.full(100, 8192)])
    expected = LineFormat(columns=("counter", "x", "y", "z"), scale=0.001197)
    assert _columns(values, 100.0) == (expected, 100.0)


def write(master: int, line: bytes) -> None:
    os.write(master, line)


def test_other_texts_are_not_taken_for_a_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.serial.text_search._FIRST_SECONDS", 0.2)
    monkeypatch.setattr("daq.drivers.serial.text_search._MEASURE_SECONDS", 0.4)
    monkeypatch.setattr("daq.drivers.serial.text_search._LISTEN_SECONDS", 0.05)
    lines = {
        b"$GPGLL,5300.97914,N,00259.98174,E,125926,A*28\r\n": None,
        b"login: \r\n": None,
        b"17,4\n": "lines of 2 numbers whose unit is not known",
    }
    for line, who in lines.items():
        with pty() as (master, port):
            os.set_blocking(master, False)
            with serving(partial(write, master, line)):
                answer = search(port, 0)
            assert (answer and answer.who) == who
            assert answer is None or answer.devices == ()


def test_ports_without_a_sensor_give_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.serial.text_search._FIRST_SECONDS", 0.2)
    with pty() as (_, port):
        assert search(port, 0) is None
    for port in ("/dev/none", "tcp://127.0.0.1:1", "http://127.0.0.1:1"):
        assert search(port, 0) is None

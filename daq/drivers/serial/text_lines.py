"""A sensor that sends lines of text, on a serial port or over a network."""

import time

import numpy as np

from daq.drivers.base import Scans, TextAddress, positive_rate
from daq.drivers.network.ports import network_address
from daq.drivers.serial.base import BytePort, SerialDriver, SerialPort
from daq.errors import DeviceLost
from daq.protocol.text_line import LineFormat, TextDecoder, TextScans, joined, no_scans
from daq.timing.resampling import StampCount
from daq.types import DeviceIdentity, FloatArray, IndexArray

_WAIT_SECONDS = 5.0  # for the first lines: an Arduino restarts when its port is opened, and takes 2 s
_CLOCK_SECONDS = 1.0  # of the device's clock over which its rate is measured
_LEAST = 5  # scans that are sufficient at the start
_RATE_TOLERANCE = 0.01  # the time between scans is that of the program of the device, not that of an oscillator
_LEAP_SECONDS = 10.0  # a device that is silent for less is lost
_TICK_SECONDS, _MAX_TICK = 1e-3, 0.8  # of the usual clock; of a period: scans are numbered by less than half of one
_NEAR = 8  # scans between neighbours that confirm each other
_CLOCK_WRAPS = {"time_ms": 2**32 * 1e-3, "time_us": 2**32 * 1e-6}  # [s]; a clock in s does not wrap
_SHOWN = 40  # characters of a line in an error


class TextLines(SerialDriver[TextDecoder, BytePort]):
    """Driver of one sensor that sends lines without being asked.

    Parameters
    ----------
    address : port and format of the lines
    rate : scans per second [Hz]; the sensor is not configured

    Raises
    ------
    ValueError
        If the rate is not positive, or the port is no port.
    """

    product = "sensor with lines of text"
    modulus = 1 << 31

    def __init__(self, address: TextAddress, rate: float) -> None:
        super().__init__(address.port)
        self._rate, self._baud, self._form = positive_rate(rate, address.port), address.baud, address.form
        self.scale = address.form.step  #: [m/s2 per count]
        self._decoder, self._numbers = TextDecoder(self._form), ScanNumbers(self._form, rate)
        self._measured: float | None = None  # rate by the device's clock [Hz]
        self._network = network_address(address.port)

    def _connect(self) -> BytePort:
        return self._network.open() if self._network else SerialPort(self._path, self._baud)

    def _start(self, port: BytePort) -> DeviceIdentity:
        """Wait for valid lines; check the rate by the device's clock, if the lines have it."""
        port.discard_input()
        self._decoder = TextDecoder(self._form)
        scans = self._first_scans(port)
        if self._form.time and self._measured is None:
            self._measured = self._checked_rate(scans)
        self._numbers = ScanNumbers(self._form, self._measured or self._rate)
        self._numbers.evaluate(scans)
        columns = " ".join(self._form.columns)
        return DeviceIdentity(product="text lines", details={"columns": columns})

    def _first_scans(self, port: BytePort) -> TextScans:
        """Return scans that are sufficient to measure the rate, if the lines have a time."""
        scans, end = no_scans(), time.monotonic() + _WAIT_SECONDS + _LEAST / self._rate
        clocked = bool(self._form.time) and self._measured is None
        while len(scans) < _LEAST or (clocked and np.ptp(scans.time) < _CLOCK_SECONDS):
            if time.monotonic() > end:
                raise ValueError(self._why(len(scans)))
            scans = joined(scans, self._decoder.feed(port.read()))
        return scans

    def _why(self, n: int) -> str:
        """Return why there are not enough valid lines."""
        found, expected = self._decoder.refused[:_SHOWN].decode("ascii", "replace"), " ".join(self._form.columns)
        if found:
            return f"lines: expected {expected}, found {found!r}"
        return f"{n} lines within {_WAIT_SECONDS:g} s"

    def _checked_rate(self, scans: TextScans) -> float:
        """Return the rate of scans by the clock of their device [Hz]; ValueError if it is another one, or too high."""
        number = scans.line
        if "counter" in self._form.columns:
            scans, number, _ = ScanNumbers(self._form, self._rate).evaluate(scans)
        elif self._rate * _TICK_SECONDS > _MAX_TICK and _is_whole(scans.time / _TICK_SECONDS):
            most = _MAX_TICK / _TICK_SECONDS
            raise ValueError(f"rate: expected up to {most:g} Hz with times in whole ms and without a counter")
        passed = float(np.ptp(scans.time)) if len(scans) else 0.0
        found = float(np.ptp(number)) / passed if passed > 0 else 0.0
        if abs(found / self._rate - 1) > _RATE_TOLERANCE:
            raise ValueError(f"rate: expected {self._rate:g} Hz, found {found:.4g} by the clock of the sensor")
        return found

    def _decode(self, data: bytes) -> Scans:
        scans, number, refused = self._numbers.evaluate(self._decoder.feed(data))
        if self._numbers.restarted:
            raise DeviceLost(self._path, "the counter or the clock of the sensor has restarted or was set")
        known = scans.temperature[~np.isnan(scans.temperature)]
        return Scans(
            counts=scans.counts,
            counter=(number % self.modulus).astype(np.int32),
            temperature=float(known.mean()) if len(known) else float("nan"),
            bad_bytes=refused * (self._decoder.length or 1),
        )


def _is_whole(values: FloatArray) -> bool:
    """Return whether values (n,) are whole numbers but for rounding."""
    return bool(np.all(np.abs(values - np.rint(values)) < 1e-3))


class ScanNumbers:
    """Numbers of scans by their counter, else by their time, else by their line; false numbers are refused.

    Without a checksum a damaged digit may be in the counter or the time. A scan is valid if its number continues that
    of the previous or the next one. The last scan of a read that does not continue the previous one is kept until the
    next read.

    Parameters
    ----------
    form : format of the lines
    rate : scans per second by the clock of the sensor [Hz]
    """

    def __init__(self, form: LineFormat, rate: float) -> None:
        self._counted = "counter" in form.columns
        self._modulus = 1 << form.counter_bits
        wrap = _CLOCK_WRAPS.get(form.time or "", float("inf"))
        self._stamps = StampCount(rate, wrap=wrap, most=_NEAR) if form.time and not self._counted else None
        self._anchor: tuple[int, int] | None = None  # number and counter of the last valid scan
        self._kept, self._kept_number = no_scans(), np.empty(0, np.intp)  # one scan at most
        self._late = max(_NEAR, round(rate))  # scans by which datagrams of a network arrive late: a second
        self._leap = max(10 * _NEAR, round(_LEAP_SECONDS * rate))  # scans that cannot be missing
        self.restarted = False  #: numbers of scans that confirm each other have gone back, or too far ahead

    def evaluate(self, scans: TextScans) -> tuple[TextScans, IndexArray, int]:
        """Return the valid scans with their numbers, and how many were refused."""
        if not len(scans):
            return scans, np.empty(0, np.intp), 0
        number = np.concatenate([self._kept_number, self._number(scans)])
        scans = joined(self._kept, scans)
        before = [] if self._anchor is None else [self._anchor[0]]
        step = np.diff(np.concatenate([np.array(before, np.intp), number]))
        follows = (step >= 1) & (step <= _NEAR)
        confirmed = follows if before else np.append(False, follows)
        good = confirmed | np.append(confirmed[1:], False)
        last = slice(len(scans) - (not good[-1]), None)
        self._kept, self._kept_number = scans[last], number[last]
        n = len(scans) - len(self._kept)
        scans, number = scans[good], number[good]
        if len(number):
            before_all = number[0] - 1 if self._anchor is None else self._anchor[0]
            latest = np.maximum.accumulate(np.append(before_all, number))
            self.restarted = bool(np.any((number < latest[:-1] - self._late) | (number > latest[:-1] + self._leap)))
            in_order = number > latest[:-1]
            scans, number = scans[in_order], number[in_order]
        if len(number):
            self._anchor = int(number[-1]), int(scans.counter[-1])
        return scans, number, n - len(number)

    def _number(self, scans: TextScans) -> IndexArray:
        """Return the numbers of scans; of those that a counter can mean the one nearest to the expected."""
        if self._stamps is not None:
            return self._stamps.numbers(scans.time)
        if not self._counted:
            return scans.line
        number, counter = self._anchor or (int(scans.counter[0]), int(scans.counter[0]))
        onward = np.arange(len(scans)) + (1 if self._anchor else 0) + len(self._kept)
        half = self._modulus // 2
        return np.asarray(number + onward + (scans.counter - counter - onward + half) % self._modulus - half, np.intp)

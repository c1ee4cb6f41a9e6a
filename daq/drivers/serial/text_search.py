"""Search for a sensor that sends lines of text: its columns, unit and rate from the numbers it sends."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from daq.drivers.base import Found, PortAnswer, TextAddress
from daq.drivers.network.ports import network_address
from daq.drivers.serial.base import PORT_ERRORS, BytePort, SerialPort
from daq.errors import DeviceLost
from daq.protocol.text_line import (
    AXES,
    DECIMAL,
    IGNORED,
    TIMES,
    UNITS,
    LineFormat,
    has_decimal_commas,
    line_pattern,
    unsealed,
    with_points,
)
from daq.types import DeviceIdentity, FloatArray

BAUDS = (115_200, 9600, 57_600, 230_400, 460_800, 921_600)
_FIRST_SECONDS = 3.5  # at the first baud rate: an Arduino restarts when its port is opened
_LISTEN_SECONDS = 0.5  # at each other one
_MEASURE_SECONDS = 1.0  # of lines that are received
_LEAST = 8  # lines
_LONGEST = 3.0  # times as long as _MEASURE_SECONDS: until so many lines have arrived from a slow sensor
_MAX_COLUMNS = 12
_GRAVITY = 9.80665
_NEAR = 0.2  # of gravity: a sensor at rest that is tilted and has an offset
_USUAL = (1, 2, 5, 10, 12.5, 20, 25, 31.25, 40, 50, 62.5, 80, 100, 119, 125, 200, 250, 400, 416, 500, 800, 833, 1000)
_SAME_RATE = 5.0  # factor between the rates by a clock and by arrival; units of time differ by 1000
_MOST, _NEARLY_ALL = 0.8, 0.95  # shares of lines
_ROUNDED = {True: 0.005, False: 0.03}  # relative difference from a usual rate, by the sensor's clock, by arrival


def search(path: str, _: int) -> PortAnswer | None:
    """Listen for lines of numbers at a port, without sending."""
    try:
        address = network_address(path)
        port = address.open() if address else SerialPort(path, BAUDS[0])
    except (*PORT_ERRORS, ValueError):
        return None
    try:
        for number, baud in enumerate(BAUDS[: 1 if address else None]):
            if number and isinstance(port, SerialPort):
                port.set_baud(baud)
            lines, rate = _listen(port, _LISTEN_SECONDS if number else _FIRST_SECONDS)
            lines, comma = _with_points(lines)
            if len(values := _same_numbers(lines)):
                return _answer(path, baud, values, rate, decimal_comma=comma)
            if not lines:
                return None  # silent at any baud rate
    except (*PORT_ERRORS, DeviceLost):
        return None
    finally:
        port.close()
    return None


def _listen(port: BytePort, longest: float) -> tuple[list[bytes], float]:
    """Return the lines that arrive within some time, and their rate [Hz]: the slope of their number in time."""
    port.discard_input()
    data, arrivals, counts = b"", list[float](), list[int]()
    end = time.monotonic() + longest
    slowest = math.inf
    while (now := time.monotonic()) < end or (len(counts) and counts[-1] <= _LEAST and now < slowest):
        if part := port.read():
            if not data:
                end, slowest = now + _MEASURE_SECONDS, now + _LONGEST * _MEASURE_SECONDS
                data = part.rpartition(b"\n")[2] or b"\n"  # the rate does not follow from lines that were waiting
            else:
                data += part
            arrivals.append(time.monotonic())
            counts.append(data.count(b"\n"))
    at, count = np.array(arrivals, np.float64), np.array(counts, np.float64)
    off = at - at.mean() if len(at) else at
    square = float(off @ off)
    return data.split(b"\n")[1:-1] if data else [], float(off @ count) / square if square > 0 else 0.0


def _with_points(lines: Sequence[bytes]) -> tuple[list[bytes], bool]:
    """Return the texts of lines without checksum and with decimal points, and whether they had decimal commas."""
    texts = [line.rstrip(b"\r") for line in lines]
    texts = [body if (body := unsealed(text)) is not None else text for text in texts]
    comma = sum(map(has_decimal_commas, texts)) > _MOST * len(texts)
    return [with_points(text) for text in texts] if comma else texts, comma


def _same_numbers(lines: Sequence[bytes]) -> FloatArray:
    """Return the numbers (n_lines, n) of lines that nearly all have the same number of them, else an empty array."""
    for n in range(1, _MAX_COLUMNS + 1):
        match = line_pattern([DECIMAL] * n).fullmatch
        rows = [[float(number) for number in found.groups()] for text in lines if (found := match(text))]
        if len(rows) >= max(_LEAST, _MOST * len(lines)):
            return np.array(rows)
    return np.empty((0, 0))


def _columns(values: FloatArray, arriving: float) -> tuple[LineFormat, float] | None:
    """Return format and rate [Hz] of numbers (n_lines, n) that arrive at about a rate [Hz]; None if it is unclear."""
    names, rest, rate, clocked = [IGNORED] * values.shape[1], [], arriving, False
    for k, column in enumerate(values.T):
        step = np.diff(column)
        if "counter" not in names and np.median(step) == 1 and np.mean(step == 1) > _MOST:
            names[k] = "counter"
        elif np.median(step) > 0 and np.mean(step > 0) > _NEARLY_ALL and (unit := _time_unit(step, arriving)):
            names[k], clocked = unit, True
            rate = 1 / (_period(step) * TIMES[unit])
        else:
            rest.append(k)
    for axis, k in zip(AXES, rest, strict=False):
        names[k] = axis
    form = _meaning(names, values[:, rest[: len(AXES)]])
    return None if form is None else (form, _usual(rate, clocked))


def _time_unit(step: FloatArray, arriving: float) -> str | None:
    """Return the column of times with these steps, at about a rate [Hz]."""
    ratio = {name: abs(math.log(_period(step) * unit * max(arriving, 1e-9))) for name, unit in TIMES.items()}
    best = min(ratio, key=lambda name: ratio[name])
    return best if ratio[best] < math.log(_SAME_RATE) else None


def _period(step: FloatArray) -> float:
    """Return the mean of steps (n,) of a clock, without those at which it wraps."""
    return float(step[step >= 0].mean())


def _meaning(names: Sequence[str], axes: FloatArray) -> LineFormat | None:
    """Return the format of axes (n_lines, n): the unit in which their mean is gravity, or a scale of whole numbers."""
    if not axes.size:
        return None
    gravity = float(np.linalg.norm(axes.mean(0)))
    whole = bool(np.all(axes == np.rint(axes)))
    for unit, factor in UNITS.items():
        if abs(gravity * factor / _GRAVITY - 1) < _NEAR and not (whole and unit == "mm/s2"):  # 8192 counts are 1 g
            return LineFormat(columns=tuple(names), unit=unit)
    if axes.shape[1] < len(AXES) or not whole or not gravity:
        return None
    return LineFormat(columns=tuple(names), scale=float(f"{_GRAVITY / gravity:.4g}"))


def _usual(rate: float, clocked: bool) -> float:
    """Return the usual rate that is nearest, or three digits [Hz]."""
    near = min(_USUAL, key=lambda usual: abs(math.log(usual / rate)))
    return float(near if abs(rate / near - 1) < _ROUNDED[clocked] else f"{rate:.4g}")


def _answer(path: str, baud: int, values: FloatArray, arriving: float, *, decimal_comma: bool) -> PortAnswer:
    """Return the sensor that sends numbers (n_lines, n) at about a rate [Hz], if columns and unit are clear."""
    if not (found := _columns(values, arriving)):
        return PortAnswer(who=f"lines of {values.shape[1]} numbers whose unit is not known", devices=())
    form, rate = replace(found[0], decimal_comma=decimal_comma), found[1]
    place = TextAddress(port=path, form=form, baud=baud)
    device = Found(
        driver="serial-text", place=place, identity=DeviceIdentity(product="text lines"), rate=rate, axes=form.axes
    )
    unit = form.unit or f"counts of {form.step:g} m/s2 by gravity"
    unit = f"{unit}, or cm/s2" if unit == "mg" else unit  # 2 % apart
    return PortAnswer(who=f"lines of text: {' '.join(form.columns)} [{unit}]", devices=(device,))

"""A sensor that a DBC file describes: the file, read by cantools, to the layout of its scans.

cantools only parses: numbers are taken out of frames by the block (`daq.protocol.can_signals`).
"""

import re
from collections.abc import Iterable
from pathlib import Path

from daq.errors import reading

import daq.protocol.can_library  # noqa: F401, isort: skip - python-can without asammdf, before cantools imports it
from cantools.database import Database, Message, Signal, load_string
from cantools.errors import Error

from daq.bounded_text import meant
from daq.drivers.base import DbcSensor
from daq.errors import DbcError
from daq.protocol.can_scan import LARGEST_COUNT, LONGEST_COUNTER, MIN_COUNT, ScanLayout, ScanMessage
from daq.protocol.can_signals import CanSignal
from daq.protocol.frames import EXTENDED

_G = 9.80665
#: unit in a DBC file, without blanks and signs of powers and products, in lower case -> m/s2
UNITS = {"m/s2": 1.0, "mm/s2": 1e-3, "g": _G, "mg": 1e-3 * _G, "ug": 1e-6 * _G}
_SPELLINGS = str.maketrans({"²": "2", "µ": "u", "μ": "u", "^": "", "*": "", " ": ""})
_FLOAT_SCALE = 1e-6  # m/s2 per count of signals without a step of their own: a tenth of a microgravity, up to 219 g
_LARGEST_MODULUS = 1 << LONGEST_COUNTER
_MESSAGE, _SIGNAL = re.compile(r"\s*BO_\s+(\d+)\s"), re.compile(r"\s*SG_\s")
_PLACE = re.compile(r"\bSG_\s[^:\n]*:\s*(-?\d+)\s*\|\s*(-?\d+)\s*@|\bBO_\s+\d+\s[^:\n]*:\s*(-?\d+)\s")
_MAX_BYTES = 1785  # largest message; J1939 sends it in several frames
_NOBODYS = 0xC0000000  # the number of a message that holds the signals of none, which cantools leaves out
_Found = tuple[Message, Signal]


def read_layout(sensor: DbcSensor) -> ScanLayout:
    """Read the layout of a sensor's scans on the bus.

    Raises
    ------
    DbcError
        Naming the file, and line, message or signal: it cannot be read, has no such signal or message, the signals have
        no unit that is known, the counter is missing or none, or a frame is none of classic CAN.
    """
    path, messages = sensor.file, _parsed(sensor.file).messages
    axes = [_signal(path, messages, name) for name in sensor.signals]
    own = {message.name for message, _ in axes}
    beside = [found for found in _named(messages, sensor.counter) if found[0].name in own]
    counters = beside or [_signal(path, messages, sensor.counter)]
    frames = _in_order(path, [message for message, _ in (*axes, *counters)], sensor.order)
    place = {message.name: number for number, message in enumerate(frames)}
    unit = sensor.scale or _common_unit(path, axes)
    signals = tuple((place[message.name], _numbers(path, message, signal)) for message, signal in axes)
    warm = _signal(path, messages, sensor.temperature) if sensor.temperature else None
    return ScanLayout(
        messages=tuple(_frame(path, message) for message in frames),
        axes=signals,
        counters=tuple((place[message.name], _numbers(path, message, signal)) for message, signal in counters),
        modulus=min(_modulus(path, *counter) for counter in counters),
        scale=_scale([signal for _, signal in signals], unit),
        unit=unit,
        temperature=(_frame(path, warm[0]), _numbers(path, *warm)) if warm else None,
    )


def _parsed(path: Path) -> Database:
    with reading(path, DbcError):
        raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", "replace")  # encoding of older programs
    _check_sizes(path, text)
    try:
        database = load_string(text, "dbc")
    except (Error, ValueError, KeyError, IndexError) as error:  # the last ones: of a file that refers to nothing
        raise DbcError(path, " ".join(str(error).removeprefix('DBC: "').removesuffix('"').split())) from error
    if not isinstance(database, Database) or not database.messages:
        raise DbcError(path, "holds no messages")
    _check_whole(path, text, database)
    return database


def _check_sizes(path: Path, text: str) -> None:
    """Refuse signals and messages longer than any: cantools takes memory for every bit before it looks at them."""
    for found in _PLACE.finditer(text):
        start, length, size = (0 if digits is None else int(digits[:9]) for digits in found.groups())
        if not (min(start, length, size) >= 0 and max(start, length) < 8 * _MAX_BYTES and size <= _MAX_BYTES):
            line = text.count("\n", 0, found.start()) + 1
            raise DbcError(path, f"line {line}: expected a message of up to {_MAX_BYTES} bytes and signals within it")


def _check_whole(path: Path, text: str, database: Database) -> None:
    """Refuse a file that was read only in part: cantools leaves out everything after a line that it cannot parse."""
    understood = {_written(message): len(message.signals) for message in database.messages}
    stated: dict[int, list[int]] = {}  # message -> its line and those of its signals
    for number, line in enumerate(text.splitlines(), 1):
        if begun := _MESSAGE.match(line):
            lines = stated.setdefault(int(begun[1]), [number])
        elif stated and _SIGNAL.match(line):
            lines.append(number)
    for written, lines in stated.items():
        n = understood.get(written, -1) + 1
        if written != _NOBODYS and n < len(lines):
            raise DbcError(path, f"cannot be understood from line {lines[n]} or the one before it on")


def _written(message: Message) -> int:
    """Return a message's number as a DBC file writes it."""
    return message.frame_id | (EXTENDED if message.is_extended_frame else 0)


def _signal(path: Path, messages: Iterable[Message], name: str) -> _Found:
    """Return the one signal that SIGNAL or MESSAGE.SIGNAL means."""
    found = _named(messages, name)
    if not found:
        names = [signal.name for message in messages for signal in message.signals]
        full = [f"{message.name}.{signal.name}" for message in messages for signal in message.signals]
        raise DbcError(path, f"has no signal {name!r}{meant(name, full if '.' in name else names)}")
    if len(found) > 1:
        several = ", ".join(f"{message.name}.{signal.name}" for message, signal in found)
        raise DbcError(path, f"signal {name!r} could be any of {several}: name the message too")
    return found[0]


def _named(messages: Iterable[Message], name: str) -> list[_Found]:
    """Return the signals that a name may mean."""
    message_name, _, signal_name = name.rpartition(".")
    return [
        (message, signal)
        for message in messages
        for signal in message.signals
        if signal.name == signal_name and message_name in ("", message.name)
    ]


def _in_order(path: Path, messages: list[Message], order: tuple[str, ...]) -> list[Message]:
    """Return a scan's messages, each once, as they are sent: who sends all at once sends the least identifier first."""
    single = {message.name: message for message in messages}
    if not order:
        return sorted(single.values(), key=_arbitration)
    if sorted(order) != sorted(single):
        raise DbcError(path, f"order: expected {', '.join(single)} in some order, found {', '.join(order)}")
    return [single[name] for name in order]


def _arbitration(message: Message) -> tuple[int, bool, int]:
    """Return the arbitration order: the first 11 bits, then short identifiers before long ones."""
    first = message.frame_id >> 18 if message.is_extended_frame else message.frame_id
    return first, message.is_extended_frame, message.frame_id


def _frame(path: Path, message: Message) -> ScanMessage:
    if message.is_fd or not 1 <= message.length <= 8:
        raise DbcError(path, f"message {message.name}: expected 1 to 8 bytes of classic CAN, found {message.length}")
    return ScanMessage(name=message.name, identifier=_written(message), size=message.length)


def _numbers(path: Path, message: Message, signal: Signal) -> CanSignal:
    """Return the positions of a signal's bits."""
    if signal.multiplexer_ids is not None:
        raise DbcError(path, f"signal {message.name}.{signal.name} is multiplexed, which is not supported")
    if not signal.scale:
        raise DbcError(path, f"signal {message.name}.{signal.name}: expected a factor, found {signal.scale}")
    try:
        return CanSignal(
            name=signal.name,
            start=signal.start,
            length=signal.length,
            big_endian=signal.byte_order == "big_endian",
            signed=signal.is_signed and not signal.is_float,
            is_float=signal.is_float,
            factor=float(signal.scale),
            offset=float(signal.offset),
        )
    except ValueError as error:
        raise DbcError(path, f"message {message.name}: {error}") from error


def _common_unit(path: Path, axes: list[_Found]) -> float:
    """Return the unit of all axes [m/s2]."""
    texts = {f"{message.name}.{signal.name}": signal.unit or "" for message, signal in axes}
    factors = {name: UNITS.get(text.translate(_SPELLINGS).lower()) for name, text in texts.items()}
    for name, factor in factors.items():
        if factor is None:
            raise DbcError(path, f"signal {name}: its unit {texts[name]!r} is none of {', '.join(UNITS)}: give `scale`")
    if len({*factors.values()}) > 1:
        found = ", ".join(f"{name} [{text}]" for name, text in texts.items())
        raise DbcError(path, f"the axes have different units: {found}")
    return next(factor for factor in factors.values() if factor is not None)


def _modulus(path: Path, message: Message, signal: Signal) -> int:
    """Return the modulus of a counter: its stated maximum plus one, or the range of its bits."""
    name = f"signal {message.name}.{signal.name}"
    if signal.is_float or signal.length < 2:
        kind = "a float" if signal.is_float else "1 bit"
        raise DbcError(path, f"{name}: expected a counter, an integer of at least 2 bits, found {kind}")
    whole = 1 << signal.length
    raw = whole - 1
    if signal.maximum is not None and not signal.is_signed:
        raw = round((float(signal.maximum) - signal.offset) / signal.scale)
    modulus = raw + 1 if 1 < raw < whole else whole  # some files state [0|1] or [0|0] for an unknown range
    if modulus > _LARGEST_MODULUS and modulus < whole:
        raise DbcError(path, f"{name}: counts to {raw}: expected at most {_LARGEST_MODULUS - 1}, or all its bits")
    return min(modulus, _LARGEST_MODULUS)


def _scale(signals: list[CanSignal], unit: float) -> float:
    """Return m/s2 per count: the finest factor if all numbers are whole multiples of it that fit, else a finer one."""
    if any(signal.is_float for signal in signals):
        return _FLOAT_SCALE
    step = min(abs(signal.factor) for signal in signals)
    numbers = [number / step for signal in signals for number in (signal.factor, signal.offset)]
    largest = max(abs(end) for signal in signals for end in signal.limits)
    even = all(abs(number - round(number)) <= 1e-9 * abs(number) for number in numbers)
    return unit * (step if even and largest / step <= -MIN_COUNT else largest / LARGEST_COUNT)

"""Lines of text with one scan each, as microcontrollers print them: both directions side by side.

    1042,10420,0.012,-0.981,0.034            counter, time [ms], x, y, z
    $1042,10420,0.012,-0.981,0.034*37        the same with the checksum of NMEA 0183
    x:0.012 y:-0.981 z:0.034                 labels as of the plotter of the Arduino IDE

A line ends with a line feed. Numbers are separated by a comma, a semicolon, blanks or tabs; if the comma is the decimal
sign, by the others. A label before a number is skipped. A line that begins with `#` is a comment. The checksum is the
exclusive or of all characters between `$` and `*`, as two hexadecimal digits. It is optional up to the first line that
has one, and then required.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from operator import xor

import numpy as np
import numpy.typing as npt

from daq.types import FloatArray, IndexArray, IntArray

AXES = ("x", "y", "z")
TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time_us": 1e-6}  #: column -> [s]
COLUMNS = ("counter", *TIMES, *AXES, "temperature")  #: names of columns
IGNORED = "-"  #: name of a column that is not used
UNITS = {"m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "cm/s2": 0.01, "mm/s2": 1e-3}  #: unit of the axes -> [m/s2]
COUNTER_BITS = (8, 16, 32)
LONGEST = 400  #: bytes of a line

_STEP = 1e-6  # m/s2 per count of numbers with a unit: a tenth of a microgravity, up to 219 g
_LARGEST = 2**31 - 1
_LABEL = rb"(?:[A-Za-z]\w{0,15}[ \t]?[:=][ \t]?)?"
_TALKER = rb"(?:[A-Za-z]\w{0,15}[ \t]?,[ \t]?)?"  # as GPGGA in NMEA 0183
_SEPARATOR = rb"(?:[ \t]*[,;][ \t]*|[ \t]+)"
DECIMAL = rb"([+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})(?:[eE][+-]?\d\d?)?)"  #: pattern of a number
_COMMA = re.compile(rb"(?<=\d),(?=\d)")
_PATTERNS = {
    "counter": rb"(\d{1,10})",
    **dict.fromkeys(TIMES, rb"(\d{1,15}(?:\.\d{0,9})?)"),
    IGNORED: rb"[^,; \t]*",
}


def line_pattern(numbers: Iterable[bytes]) -> re.Pattern[bytes]:
    """Return the pattern of a line of numbers, each with its own pattern."""
    return re.compile(rb"[ \t]*" + _TALKER + _SEPARATOR.join(_LABEL + number for number in numbers) + rb"[ \t]*")


@dataclass(frozen=True, kw_only=True)
class LineFormat:
    """Columns of a line, and the meaning of its numbers."""

    columns: tuple[str, ...]  #: of `COLUMNS` or `IGNORED`, in their order
    unit: str | None = None  #: unit of the axes, of `UNITS`, or None for whole numbers with `scale`
    scale: float | None = None  #: m/s2 per count, for axes that are whole numbers
    counter_bits: int = 32  #: bits after which the counter wraps
    decimal_comma: bool = False  #: the decimal sign is a comma

    def __post_init__(self) -> None:
        """Refuse columns without an axis, repeated ones, and numbers without one meaning."""
        for name in self.columns:
            if name not in (*COLUMNS, IGNORED):
                raise ValueError(f"columns: expected {', '.join(COLUMNS)} or {IGNORED!r}, found {name!r}")
        used = [name for name in self.columns if name != IGNORED]
        if len({*used}) < len(used) or len({*TIMES} & {*used}) > 1:
            raise ValueError("columns: expected each name once, and one time")
        if not self.axes:
            raise ValueError(f"columns: expected an axis, {', '.join(AXES)}, found none")
        if (self.unit is None) == (self.scale is None):
            raise ValueError("expected one of `unit` and `scale`")
        if self.unit is not None and self.unit not in UNITS:
            raise ValueError(f"unit: expected {', '.join(UNITS)}, found {self.unit!r}")
        if self.scale is not None and not 0 < self.scale < np.inf:
            raise ValueError(f"scale: expected a positive number of m/s2 per count, found {self.scale:g}")
        if self.counter_bits not in COUNTER_BITS:
            raise ValueError(f"counter_bits: expected {', '.join(map(str, COUNTER_BITS))}, found {self.counter_bits}")

    @property
    def axes(self) -> tuple[int, ...]:
        """Measured axes, of 0, 1, 2; the others are zero in every scan."""
        return tuple(axis for axis, name in enumerate(AXES) if name in self.columns)

    @property
    def time(self) -> str | None:
        """Name of the column of the time."""
        return next((name for name in self.columns if name in TIMES), None)

    @property
    def step(self) -> float:
        """Scale of the counts [m/s2 per count]."""
        return _STEP if self.scale is None else self.scale

    def pattern(self) -> re.Pattern[bytes]:
        """Return the pattern of a line, with a group for each column that is used."""
        axis = DECIMAL if self.scale is None else rb"([+-]?\d{1,10})"
        numbers = (_PATTERNS.get(name, axis if name in AXES else DECIMAL) for name in self.columns)
        return line_pattern(numbers)

    @property
    def numbered(self) -> bool:
        """True if missing scans are counted by the counter or the time."""
        return "counter" in self.columns or self.time is not None


@dataclass(frozen=True, eq=False)
class TextScans:
    """Scans of valid lines in the order of the line."""

    counts: IntArray  #: (n, 3) of `LineFormat.step` [-]
    counter: IndexArray  #: (n,) as printed, 0 without such a column [-]
    time: FloatArray  #: (n,) of the device's clock, 0 without such a column [s]
    temperature: FloatArray  #: (n,) [degC], NaN without such a column
    line: IndexArray  #: (n,) number of the line, damaged ones included [-]

    def __len__(self) -> int:
        return len(self.counts)

    def __getitem__(self, which: npt.NDArray[np.bool_] | slice) -> "TextScans":
        """Return some of the scans."""
        return TextScans(
            self.counts[which], self.counter[which], self.time[which], self.temperature[which], self.line[which]
        )


def joined(before: TextScans, after: TextScans) -> TextScans:
    """Return scans, one after another."""
    names = ("counts", "counter", "time", "temperature", "line")
    return TextScans(*(np.concatenate([getattr(before, name), getattr(after, name)]) for name in names))


def no_scans() -> TextScans:
    """Return no scan."""
    whole, real = np.empty(0, np.intp), np.empty(0)
    return TextScans(np.empty((0, 3), np.int32), whole, real, real, whole)


def encode_lines(scans: TextScans, form: LineFormat, *, checksum: bool = False) -> bytes:
    """Return the lines of scans; a column that is not used is 0."""
    columns = [_texts(scans, form, name) for name in form.columns]
    lines = [",".join(numbers) for numbers in zip(*columns, strict=True)]
    if form.decimal_comma:
        lines = [line.replace(",", ";").replace(".", ",") for line in lines]
    if checksum:
        lines = [f"${line}*{reduce(xor, line.encode(), 0):02X}" for line in lines]
    return "".join(f"{line}\r\n" for line in lines).encode()


def _texts(scans: TextScans, form: LineFormat, name: str) -> list[str]:
    if name in AXES:
        counts = scans.counts[:, AXES.index(name)]
        if form.unit is None:
            return [f"{count}" for count in counts.tolist()]
        unit = UNITS[form.unit]
        digits = int(np.ceil(-np.log10(_STEP / unit / 2)))  # rounded to these a number has the same count
        return [f"{value:.{digits}f}" for value in (counts * (_STEP / unit)).tolist()]
    if name in TIMES:
        digits = {"time_s": 6, "time_ms": 3, "time_us": 0}[name]
        return [f"{value:.{digits}f}" for value in (scans.time / TIMES[name]).tolist()]
    if name == "temperature":
        return [f"{value:.2f}" for value in scans.temperature.tolist()]
    return [f"{value}" for value in (scans.counter if name == "counter" else 0 * scans.counter).tolist()]


class TextDecoder:
    """Scans out of a byte stream that may begin anywhere and be damaged anywhere.

    Without a checksum a damaged digit is not noticed. A damaged line counts as the lines that fill it.

    Parameters
    ----------
    form : format of the lines
    """

    def __init__(self, form: LineFormat) -> None:
        self._form, self._match = form, form.pattern().fullmatch
        self._used = [name for name in form.columns if name != IGNORED]
        self._rest = b""
        self._sealed = False  # lines have a checksum
        self._line = 0  # number of the next one
        self.length = 0  #: bytes of the last valid line, 0 before it
        self.bad_bytes = 0  #: bytes outside valid lines, so far
        self.refused = b""  #: the last line that was not valid

    def feed(self, data: bytes) -> TextScans:
        """Take the next bytes and return the scans that are complete."""
        *lines, rest = (self._rest + data).split(b"\n")
        if len(rest) > LONGEST:
            self.bad_bytes += len(rest)
            rest = b""
        self._rest = rest
        rows, numbers, lengths = [], [], []
        for line in lines:
            if found := self._valid(line):
                rows.append([float(number) for number in found.groups()])
                numbers.append(self._line)
                lengths.append(len(line) + 1)
                self._line += 1
        if not rows:
            return no_scans()
        return self._scans(np.array(rows), np.array(numbers, np.intp), np.array(lengths))

    def _valid(self, line: bytes) -> re.Match[bytes] | None:
        """Return the numbers of a valid line; count a line that is none."""
        text = line.rstrip(b"\r")
        if not text or text.startswith(b"#"):
            return None
        found = self._numbers(text) if not self._sealed else None
        if found is None and (body := unsealed(text)) is not None:
            self._sealed = True
            found = self._numbers(body)
        if found is None:
            self.refused = text
            self.bad_bytes += len(line) + 1
            self._line += max(1, round((len(line) + 1) / self.length)) if self.length else 1
        else:
            self.length = len(line) + 1
        return found

    def _numbers(self, text: bytes) -> re.Match[bytes] | None:
        return self._match(with_points(text) if self._form.decimal_comma else text)

    def _scans(self, values: FloatArray, line: IndexArray, lengths: IndexArray) -> TextScans:
        """Return the scans of lines; a number that no count can be is refused."""
        column: Callable[[str, float], FloatArray] = lambda name, other: (  # noqa: E731
            values[:, self._used.index(name)] if name in self._used else np.full(len(values), other)
        )
        factor = 1.0 if self._form.unit is None else UNITS[self._form.unit] / _STEP
        counts = np.rint(factor * np.stack([column(axis, 0.0) for axis in AXES], axis=1))
        good = np.all(np.abs(counts) <= _LARGEST, axis=1)
        self.bad_bytes += int(lengths[~good].sum())
        time = self._form.time
        scans = TextScans(
            np.where(good[:, None], counts, 0).astype(np.int32),
            column("counter", 0.0).astype(np.intp),
            column(time, 0.0) * TIMES[time] if time else np.zeros(len(values)),
            column("temperature", np.nan),
            line,
        )
        return scans if good.all() else scans[good]


def has_decimal_commas(text: bytes) -> bool:
    """Return whether all commas of a line are decimal signs: between digits, with other separators and no point."""
    commas = text.count(b",")
    return (
        bool(commas) and b"." not in text and bool(re.search(rb"[; \t]", text)) and commas == len(_COMMA.findall(text))
    )


def with_points(text: bytes) -> bytes:
    """Return a line whose decimal sign is a comma with decimal points."""
    return text.replace(b",", b".")


def unsealed(text: bytes) -> bytes | None:
    """Return what is between `$` and `*` of a line whose checksum is right, None otherwise."""
    body, star, digits = text.rstrip().partition(b"*")
    if not (star and body.startswith(b"$") and re.fullmatch(rb"[0-9A-Fa-f]{2}", digits)):
        return None
    return body[1:] if reduce(xor, body[1:], 0) == int(digits, 16) else None

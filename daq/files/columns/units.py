"""Units of motion, of voltages, and sensitivities of sensors."""

import math
import re
from dataclasses import dataclass
from typing import Literal

Quantity = Literal["acceleration", "velocity", "displacement", "voltage", "counts"]

_G, _FOOT, _INCH = 9.80665, 0.3048, 0.0254
_LENGTHS = {
    "km": 1e3,
    "m": 1.0,
    "dm": 1e-1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "ft": _FOOT,
    "in": _INCH,
    "inch": _INCH,
    "mil": 1e-3 * _INCH,
}
ACCELERATIONS = {"m/s2": 1.0, "cm/s2": 1e-2, "mm/s2": 1e-3, "g": _G, "mg": 1e-3 * _G, "ug": 1e-6 * _G}  #: [m/s2]
_ACCELERATIONS = {
    **{f"{name}/s2": metres for name, metres in _LENGTHS.items()},
    **ACCELERATIONS,
    "mgal": 1e-5,
}
_VELOCITIES = {f"{name}/s": metres for name, metres in _LENGTHS.items()} | {"km/h": 1 / 3.6}
_VOLTAGES = {"v": 1.0, "mv": 1e-3, "uv": 1e-6}
_COUNTS = dict.fromkeys(("count", "counts", "lsb", "digit", "digits"), 1.0)
_TABLES: tuple[tuple[Quantity, dict[str, float]], ...] = (
    ("acceleration", _ACCELERATIONS),
    ("velocity", _VELOCITIES),
    ("displacement", _LENGTHS),
    ("voltage", _VOLTAGES),
    ("counts", _COUNTS),
)
DERIVATIVES = {"acceleration": 0, "velocity": 1, "displacement": 2}  #: from each quantity to acceleration
TEMPERATURES = {  #: one unit and zero [degC]
    **dict.fromkeys(("°c", "degc", "c", "℃", "celsius"), (1.0, 0.0)),
    **dict.fromkeys(("k", "kelvin"), (1.0, -273.15)),
    **dict.fromkeys(("°f", "degf", "fahrenheit"), (5 / 9, -160 / 9)),
}
_SPELT = str.maketrans({"²": "2", "^": None, "*": None, " ": None, "µ": "u", "μ": "u", "º": "°", "˚": "°", "·": None})
_OTHER = {
    **{f"{name}{tail}": f"{name}/s2" for name in _LENGTHS for tail in ("s-2", "/s/s", "/(s2)", "/ss", "/sec2")},
    **{f"{name}{tail}": f"{name}/s" for name in _LENGTHS for tail in ("s-1", "/sec")},
    "gal": "cm/s2",
    "gn": "g",
    "volt": "v",
    "volts": "v",
    "millivolts": "mv",
    "ips": "in/s",
    "kph": "km/h",
    "meter": "m",
    "metre": "m",
    "meters": "m",
    "metres": "m",
    '"': "in",
    "inches": "in",
    "micron": "um",
}
_SENSITIVITY = re.compile(
    r"\s*(?P<number>[-+]?[\d.]+(e[-+]?\d+)?)\s*(?P<output>[^\d\s/]+)\s*/\s*(?P<input>\S.*?)\s*", re.I
)


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit of a column."""

    quantity: Quantity
    factor: float  #: m/s2, m/s, m, V or counts per unit


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Output of a sensor per motion."""

    output: Unit  #: volts or counts
    motion: Unit  #: acceleration, velocity or displacement
    value: float  #: output units per motion unit

    @property
    def factor(self) -> float:
        """Motion [m/s2, m/s or m] per volt or count."""
        return self.motion.factor / (self.value * self.output.factor)


def plain(unit: str) -> str:
    """Return a unit in the spelling of these tables."""
    short = unit.casefold().translate(_SPELT)
    return _OTHER.get(short, short)


def parse_unit(text: str) -> Unit | None:
    """Return the unit of a text in any notation, None if it is none of motion, voltage or counts."""
    known = plain(text)
    return next((Unit(quantity=kind, factor=table[known]) for kind, table in _TABLES if known in table), None)


def acceleration(unit: str) -> float | None:
    """Return a unit as a factor [m/s2], in any notation; None if it is not a unit of acceleration."""
    found = parse_unit(unit)
    return found.factor if found and found.quantity == "acceleration" else None


def parse_sensitivity(text: str) -> Sensitivity:
    """Return the sensitivity of a text such as ``100 mV/g``, ``28.8 V/(m/s)`` or ``16384 counts/g``.

    Raises
    ------
    ValueError
        If it is not a sensitivity.
    """
    found = _SENSITIVITY.fullmatch(text)
    output = parse_unit(found["output"]) if found else None
    inner = found["input"] if found else ""
    motion = parse_unit(inner[1:-1] if inner.startswith("(") and inner.endswith(")") else inner)
    try:
        value = float(found["number"]) if found else 0.0
    except ValueError:
        value = 0.0
    if (
        output is None
        or motion is None
        or output.quantity not in ("voltage", "counts")
        or not 0 < abs(value) < math.inf
    ):
        raise ValueError(f"expected a sensitivity such as '100 mV/g' or '28.8 V/(m/s)', found {text!r:.60}")
    if motion.quantity not in DERIVATIVES:
        raise ValueError(f"expected a sensitivity per acceleration, velocity or displacement, found {text!r:.60}")
    return Sensitivity(output=output, motion=motion, value=value)

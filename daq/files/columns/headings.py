"""Units in column names: ``deck_z [mg]`` holds thousandths of g, and its channel is ``deck_z``."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.types import FloatArray

_G = 9.80665
ACCELERATIONS = {"m/s2": 1.0, "cm/s2": 1e-2, "mm/s2": 1e-3, "g": _G, "mg": 1e-3 * _G, "ug": 1e-6 * _G}  #: [m/s2]
_VELOCITIES = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}  # m/s
TEMPERATURES = {  #: one unit and zero [degC]
    **dict.fromkeys(("°c", "degc", "c", "℃", "celsius"), (1.0, 0.0)),
    **dict.fromkeys(("k", "kelvin"), (1.0, -273.15)),
    **dict.fromkeys(("°f", "degf", "fahrenheit"), (5 / 9, -160 / 9)),
}
_WARMTH = re.compile(r"temp|temp[_ ]?(deg)?[_ ]?c|temperature([_ ].*)?", re.IGNORECASE)  # which need no unit
_ENDED = re.compile(r".+[_ ](g|mg|ug|mms2|mm_s2)", re.IGNORECASE)  # as if it were a unit
_SPELT = str.maketrans({"²": "2", "^": None, "*": None, " ": None, "µ": "u", "μ": "u", "º": "°", "˚": "°"})
_OTHER = {"ms-2": "m/s2", "m/s/s": "m/s2", "mms-2": "mm/s2", "gal": "cm/s2", "gn": "g"}
_BRACKETED = re.compile(r"(?P<name>.*?)\s*(\[\s*(?P<square>[^\[\]]+?)\s*\]|\(\s*(?P<round>[^()]+?)\s*\))")


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A column to read."""

    column: str  #: its name in the file
    channel: str  #: name of its sensor
    unit: str  #: unit stated by the column, "" if none


def parted(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit after it in brackets; "" if there is none."""
    found = _BRACKETED.fullmatch(name.strip())
    return (found["name"], found["square"] or found["round"]) if found and found["name"] else (name, "")


def acceleration(unit: str) -> float | None:
    """Return a unit as a factor [m/s2], in any notation; None if it is not a unit of acceleration."""
    return ACCELERATIONS.get(plain(unit))


def plain(unit: str) -> str:
    """Return a unit in the spelling of these tables."""
    short = unit.casefold().translate(_SPELT)
    return _OTHER.get(short, short)


def signals_of(
    path: Path, names: Sequence[str], columns: Mapping[str, str] | None, *, united: bool = True
) -> tuple[Signal, ...]:
    """Return the requested signals in the order of the file.

    Parameters
    ----------
    path : of the file
    names : of all columns of signals
    columns : columns, with their units or without -> names of their channels. Default: all, without their units
    united : whether names state units; else text in brackets belongs to the name

    Raises
    ------
    DataError
        If a column is requested twice, with its unit and without, or two would be channels of one name.
    """
    bare = _bare(names) if united else {name: name for name in names}
    units = {name: parted(name)[1] for name in names if united}
    asked = dict(bare) if columns is None else {_column(wanted, bare): channel for wanted, channel in columns.items()}
    if columns is not None and len(asked) < len(columns):
        raise DataError(path, f"expected different columns, found {', '.join(columns)}")
    order = {name: place for place, name in enumerate(names)}
    found = tuple(
        Signal(column=name, channel=bare[name] if name == channel in bare else channel, unit=units.get(name, ""))
        for name, channel in sorted(asked.items(), key=lambda item: order.get(item[0], len(order)))
    )
    channels = [signal.channel for signal in found]
    if len(set(channels)) < len(channels):
        raise DataError(path, f"expected channels of different names, found {', '.join(channels)}")
    return found


def _bare(names: Sequence[str]) -> dict[str, str]:
    """Return the names without units where they still differ."""
    bare = {name: parted(name)[0] for name in names}
    found = list(bare.values())
    return {name: short if found.count(short) == 1 else name for name, short in bare.items()}


def _column(wanted: str, bare: Mapping[str, str]) -> str:
    """Return the matching column, or the given text if there is none."""
    return wanted if wanted in bare else next((name for name, short in bare.items() if short == wanted), wanted)


def temperatures_of(path: Path, names: Sequence[str], asked: str | None) -> tuple[str, ...]:
    """Return the columns of temperatures: by their unit, or by the names ``temperature..`` and ``temp``.

    Parameters
    ----------
    path : of the file
    names : of all columns
    asked : requested column, with its unit or without

    Raises
    ------
    DataError
        If `asked` is none of them.
    """
    if asked is None:
        return tuple(name for name in names if _is_temperature(name))
    column = _column(asked, {name: parted(name)[0] for name in names})
    if column not in names:
        raise DataError(path, f"has no column {asked!r} of temperatures, but {', '.join(names):.100}")
    return (column,)


def _is_temperature(name: str) -> bool:
    bare, unit = parted(name)
    return plain(unit) in TEMPERATURES if unit else bool(_WARMTH.fullmatch(bare))


def factors(path: Path, signals: Sequence[Signal], velocities: Collection[str]) -> FloatArray:
    """Return the unit of each column as a factor (n_columns,) [m/s2; m/s for velocities]; 1 if none is stated.

    Raises
    ------
    DataError
        Naming a column whose unit is unknown, or of another quantity.
    """
    return np.array([_factor(path, signal, signal.channel in velocities) for signal in signals])


def _factor(path: Path, signal: Signal, velocity: bool) -> float:
    unit, known = plain(signal.unit), _VELOCITIES if velocity else ACCELERATIONS
    if unit in known or not unit:
        return known.get(unit, 1.0)
    if unit in _VELOCITIES:
        raise DataError(path, f"column {signal.column!r} has velocities: give --velocity {signal.channel}")
    raise DataError(
        path,
        f"column {signal.column!r}: expected the unit {', '.join(known)}, found {signal.unit!r}: "
        "give the unit of its numbers by --unit and --scale, or the columns by --column",
    )


def unit_remark(signals: Iterable[Signal], velocities: Collection[str], by_hand: float | None) -> str:
    """Return a remark on the units of the columns; nothing if no column states one.

    Parameters
    ----------
    signals : that were read
    velocities : channels that hold velocities
    by_hand : factor of the unit given for all columns [m/s2], if any
    """
    stated: dict[str, list[str]] = {}
    for signal in signals:
        usual = "m/s" if signal.channel in velocities else "m/s2"
        stated.setdefault(signal.unit or f"{usual}, without a unit", []).append(signal.channel)
    if not any(signal.unit for signal in signals):
        doubtful = [signal.channel for signal in signals if by_hand is None and _ENDED.fullmatch(signal.channel)]
        return f"{', '.join(doubtful)} in m/s2: if a name ends in its unit give --unit" if doubtful else ""
    listed = "; ".join(f"{', '.join(channels)} in {unit}" for unit, channels in stated.items())
    if by_hand is not None:
        return f"units of the columns: {listed}; overridden by --unit and --scale, {by_hand:.6g} m/s2 a unit"
    return f"from the columns: {listed}"

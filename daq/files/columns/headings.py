"""Names of columns: ``deck_z [mg]`` holds thousandths of g, and its channel is ``deck_z``."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from daq.errors import DataError
from daq.files.columns.units import TEMPERATURES, plain

_WARMTH = re.compile(r"temp|temp[_ ]?(deg)?[_ ]?c|temperature([_ ].*)?", re.IGNORECASE)  # which need no unit
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
    """Return the columns of temperatures by their unit, or by the names ``temperature..`` and ``temp``.

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

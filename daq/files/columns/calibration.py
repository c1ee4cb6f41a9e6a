"""Calibration of channels: unit, sensitivity, scale, sign and offset, from a TOML file or for all channels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.bounded_text import parse_toml
from daq.errors import DataError
from daq.files.columns.units import Sensitivity, parse_sensitivity, parse_unit

_MAX_BYTES = 1_000_000
_KEYS = ("unit", "sensitivity", "scale", "offset")


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Calibration of one channel: (number - offset) x scale is in its unit."""

    unit: str | None = None  #: unit of the numbers. Default: that of the column
    sensitivity: Sensitivity | None = None  #: of a sensor whose numbers are volts or counts
    scale: float = 1.0  #: negative for a sensor that is mounted in the opposite direction
    offset: float = 0.0  #: number at zero motion


def read_calibration(path: Path) -> dict[str, Calibration]:
    """Read a file with one table per channel.

    ::

        [top_x]
        sensitivity = "100 mV/g"
        scale = -1.0

    Parameters
    ----------
    path : of the TOML file; keys are `unit`, `sensitivity`, `scale` and `offset`, all optional

    Returns
    -------
    dict
        Channel to calibration.

    Raises
    ------
    DataError
        Naming the file, the channel and the key.
    """
    try:
        text = path.read_bytes()[:_MAX_BYTES].decode("utf-8")
        content = parse_toml(text)
    except OSError as error:
        raise DataError(path, f"cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise DataError(path, f"is no TOML: {error}") from error
    return {channel: _calibration(path, channel, entry) for channel, entry in content.items()}


def _calibration(path: Path, channel: str, entry: object) -> Calibration:
    if not isinstance(entry, Mapping):
        raise DataError(path, f"{channel}: expected a table [{channel}] with {', '.join(_KEYS)}, found {entry!r:.40}")
    for key in entry:
        if key not in _KEYS:
            raise DataError(path, f"{channel}.{key}: expected one of {', '.join(_KEYS)}")
    unit, sensitivity = entry.get("unit"), entry.get("sensitivity")
    if unit is not None and (not isinstance(unit, str) or parse_unit(unit) is None):
        raise DataError(path, f"{channel}.unit: expected a unit as 'mg', 'mm/s', 'um' or 'mV', found {unit!r:.40}")
    try:
        found = None if sensitivity is None else parse_sensitivity(str(sensitivity))
    except ValueError as error:
        raise DataError(path, f"{channel}.sensitivity: {error}") from error
    scale, offset = _number(path, channel, "scale", entry, 1.0), _number(path, channel, "offset", entry, 0.0)
    if not scale:
        raise DataError(path, f"{channel}.scale: expected a number other than 0")
    return Calibration(unit=unit, sensitivity=found, scale=scale, offset=offset)


def _number(path: Path, channel: str, key: str, entry: Mapping[str, Any], default: float) -> float:
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise DataError(path, f"{channel}.{key}: expected a finite number, found {value!r:.40}")
    try:
        return float(value)
    except OverflowError as error:
        raise DataError(path, f"{channel}.{key}: expected a finite number") from error

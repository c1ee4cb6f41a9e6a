"""Factors, offsets and derivatives that turn the numbers of columns into accelerations."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from daq.errors import DataError
from daq.files.columns.calibration import Calibration
from daq.files.columns.headings import Signal
from daq.files.columns.units import ACCELERATIONS, DERIVATIVES, Sensitivity, Unit, parse_unit
from daq.files.options import DataOptions

_ENDED = re.compile(r".+[_ ](g|mg|ug|mms2|mm_s2)", re.IGNORECASE)  # as if it were a unit
_METRIC = {0: "m/s2", 1: "m/s", 2: "m"}
_TIMES = {1: "once", 2: "twice"}


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """Conversion of the numbers of one column: (number - offset) x factor."""

    factor: float  #: m/s2, m/s or m per number
    offset: float  #: number at zero motion
    derivatives: int  #: from the converted numbers to acceleration


def scalings(path: Path, signals: Sequence[Signal], options: DataOptions) -> tuple[Scaling, ...]:
    """Return the conversion of each column.

    The unit is that of the calibration, of the options or of the column, in this order; m/s2 without any.

    Raises
    ------
    DataError
        Naming a column whose unit is unknown or of another quantity, or whose sensitivity is missing or contradicts it.
    """
    return tuple(_scaling(path, signal, options) for signal in signals)


def foreign(signal: Signal, options: DataOptions) -> bool:
    """Return whether a column states a unit that is none of a sensor of motion, and no other unit is given for it."""
    own = options.calibration.get(signal.channel)
    given = options.factor is not None or options.unit is not None or (own is not None and own.unit is not None)
    return bool(signal.unit) and not given and parse_unit(signal.unit) is None


def _scaling(path: Path, signal: Signal, options: DataOptions) -> Scaling:
    own = options.calibration.get(signal.channel, Calibration())
    by_hand = options.unit or ("" if options.factor is not None else signal.unit)
    stated = own.unit or by_hand
    unit = _unit(path, signal, stated, velocity=signal.channel in options.velocities)
    sensitivity = own.sensitivity or (options.sensitivity if not stated or unit.quantity not in DERIVATIVES else None)
    if sensitivity is not None:
        unit = _of_sensor(path, signal, stated, unit, sensitivity)
    if unit.quantity not in DERIVATIVES:
        raise DataError(
            path,
            f"column {signal.column!r} is in {stated}: give its sensitivity, as --sensitivity '100 mV/g' or in the "
            "file of --calibration, or choose other columns by --column",
        )
    return Scaling(
        factor=unit.factor * own.scale * (1.0 if options.factor is None else options.factor),
        offset=own.offset,
        derivatives=DERIVATIVES[unit.quantity],
    )


def _unit(path: Path, signal: Signal, stated: str, *, velocity: bool) -> Unit:
    """Return the stated unit, else the metric one."""
    if not stated:
        return Unit(quantity="velocity" if velocity else "acceleration", factor=1.0)
    unit = parse_unit(stated)
    if unit is not None and not (velocity and unit.quantity != "velocity"):
        return unit
    known = ("m/s", "cm/s", "mm/s", "um/s") if velocity else ACCELERATIONS
    raise DataError(
        path,
        f"column {signal.column!r}: expected the unit {', '.join(known)}, found {stated!r}: "
        "give the unit of its numbers by --unit and --scale, or the columns by --column",
    )


def _of_sensor(path: Path, signal: Signal, stated: str, unit: Unit, sensitivity: Sensitivity) -> Unit:
    """Return the motion per number of a sensor with volts or counts."""
    output = sensitivity.output
    if not stated and output.quantity == "counts":
        unit = output
    if unit.quantity != output.quantity:
        expected = "V or mV" if output.quantity == "voltage" else "counts"
        found = f"found {stated!r}" if stated else "found none: give --unit, or `unit` in the file of --calibration"
        raise DataError(path, f"column {signal.column!r}: its sensitivity needs the unit {expected}, {found}")
    return Unit(quantity=sensitivity.motion.quantity, factor=unit.factor * sensitivity.factor)


def unit_remark(signals: Sequence[Signal], options: DataOptions, source: str) -> str:
    """Return a remark on the units of the columns, found in a source; nothing if no column has one."""
    stated: dict[str, list[str]] = {}
    for signal in signals:
        usual = "m/s" if signal.channel in options.velocities else "m/s2"
        stated.setdefault(signal.unit or f"{usual}, without a unit", []).append(signal.channel)
    by_hand = options.factor is not None or options.unit is not None
    if not any(signal.unit for signal in signals):
        doubtful = [signal.channel for signal in signals if not by_hand and _ENDED.fullmatch(signal.channel)]
        return f"{', '.join(doubtful)} in m/s2: if a name ends in its unit give --unit" if doubtful else ""
    listed = "; ".join(f"{', '.join(channels)} in {unit}" for unit, channels in stated.items())
    if by_hand:
        unit = parse_unit(options.unit or "m/s2")
        worth = (unit.factor if unit else 1.0) * (options.factor or 1.0)
        metric = _METRIC.get(DERIVATIVES.get(unit.quantity, 3) if unit else 0, "V")
        return f"units of the columns: {listed}; overridden by --unit and --scale, {worth:.6g} {metric} a unit"
    return f"from {source}: {listed}"


def calibration_remark(signals: Sequence[Signal], options: DataOptions) -> str:
    """Return a remark on the calibration: channels that have one, and entries that no column has."""
    names = [signal.channel for signal in signals]
    used = [name for name in names if name in options.calibration]
    unused = [name for name in options.calibration if name not in names]
    texts = [f"calibrated: {', '.join(used)}"] if used else []
    return "; ".join([*texts, *([f"no column for the calibration of {', '.join(unused)}"] if unused else [])])


def differentiation_remark(signals: Iterable[Signal], found: Iterable[Scaling], velocities: Iterable[str]) -> str:
    """Return a remark on columns that are differentiated by their unit, without a request."""
    asked = set(velocities)
    by_times: dict[int, list[str]] = {}
    for signal, scaling in zip(signals, found, strict=True):
        if scaling.derivatives and signal.channel not in asked:
            by_times.setdefault(scaling.derivatives, []).append(signal.channel)
    return "; ".join(f"differentiated {_TIMES[times]}: {', '.join(names)}" for times, names in by_times.items())

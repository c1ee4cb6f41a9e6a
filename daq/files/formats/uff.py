"""Time histories of universal files (UFF dataset 58), as modal test systems export and import them.

References
----------
Structural Dynamics Research Corporation: universal file format, datasets 58 (function at nodal DOF) and 164 (units),
kept by the University of Cincinnati, www.ceas3.uc.edu/sdrluff.
"""

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyuff

from daq.errors import DataError
from daq.files.columns.date_cells import DAY, MOMENT, date_order, slashed
from daq.files.columns.stated_start import StatedStart, UnclearDate
from daq.files.columns.units import parse_unit
from daq.files.formats.arrays import Arrays
from daq.files.formats.universal.datasets import SI_UNITS, Dataset, datasets, length_unit, node_name
from daq.files.formats.universal.header import header_set
from daq.files.options import DataOptions
from daq.files.origin import Origin
from daq.types import Channel, FloatArray, Recording

_TIME_RESPONSE = 1
_UNKNOWN, _GENERAL, _ACCELERATION = 0, 1, 12
_UNITS = {_UNKNOWN: "", _GENERAL: "", 8: "m", 11: "m/s", _ACCELERATION: ""}  # of data types, once in metres; "" is m/s2
_QUANTITIES = {8: "displacement", 11: "velocity", _ACCELERATION: "acceleration"}  # general data are of any quantity
_KINDS = {9: "reaction force", 13: "excitation force", 15: "pressure", 5: "temperature"}
_NO_UTF8 = "\ufffd"  # pyuff reads a ² of other encodings so
_TIME = 17  # of an abscissa [s]
_BEGUN, _PLACE = "first sample at {} ns UTC", "device {} axis {}"  # ID lines 3 and 4
_SAME = 1e-6  # relative: sampling intervals are printed with six digits


def read(path: Path, options: DataOptions) -> Arrays:
    """Read time responses as `read_universal` does."""
    return read_universal(path, options.columns, options.date_order)


def write(path: Path, recording: Recording) -> None:
    """Write time responses as `write_universal` does.

    Raises
    ------
    DataError
        If samples are missing.
    """
    if missing := np.count_nonzero(np.isnan(recording.data)):
        raise DataError(path, f"cannot hold a gap: {missing} samples are missing; .npz, .mat and .csv can")
    write_universal(path, recording)


def read_universal(path: Path, wanted: Collection[str] | None = None, order: str | None = None) -> Arrays:
    """Read the time responses of a universal file, text or binary; other functions and geometry are passed over.

    A channel is named after its node and direction, ``12_x`` or ``12_-y``, preceded by the entity if the file has one
    (``tower_12_x``); if nodes are not unique, after the first ID line. Lengths are converted to metres according to
    dataset 164, or to the label of the unit in a file without it, if it is one of the data type; other labels are in a
    remark. The start is the earliest date of ID line 3, which states when a function was made (``30-Jul-08 10:11:12``).

    Parameters
    ----------
    path : Path
    wanted : collection of str, optional
        Names of the channels to read; all unless given.
    order : str, optional
        Order of day and month in dates as 04/05/2026. Default: the only one that is possible.

    Raises
    ------
    DataError
        Naming the file and the dataset, counted from 1.
    """
    sets = datasets(path)
    length = length_unit(path, sets)
    series = [(number, s) for number, s in sets if s["type"] == 58 and s["func_type"] == _TIME_RESPONSE]
    if not series:
        held = ", ".join(sorted({str(s["type"]) for _, s in sets})) or "none"
        raise DataError(path, f"holds no time response (dataset 58, function type 1); its datasets are of type {held}")
    names = _names(path, series)
    chosen = [i for i, name in enumerate(names) if wanted is None or name in wanted]
    columns = [_column(path, *series[i], names[i]) for i in chosen]
    in_metres = any(s["type"] == SI_UNITS["type"] for _, s in sets)
    labels = ["" if in_metres else _usable_label(s) for _, s in series]
    _check_same(path, [series[i] for i in chosen])
    rate = 1 / series[chosen[0]][1]["abscissa_inc"] if chosen else None
    return Arrays(
        names=tuple(names[i] for i in chosen) if chosen else tuple(names),
        values=np.column_stack(columns) / [1.0 if labels[i] else length for i in chosen]
        if chosen
        else np.empty((0, len(names))),
        rate=rate,
        t=None,
        origin=_origin([(names[i], series[i][1]) for i in chosen]),
        stated=_stated_start([series[i] for i in chosen], order),
        units=tuple(
            labels[i] or _UNITS.get(int(series[i][1]["ordinate_spec_data_type"]), "")
            for i in chosen or range(len(names))
        ),
        remarks=_unused_labels([(names[i], series[i][1]) for i in chosen if not labels[i]], length),
    )


def write_universal(path: Path, recording: Recording) -> None:
    """Write a recording as time responses (text, twelve digits): channels' names in ID line 1, their origin in 3 and 4.

    A header (dataset 151) and the units (164) are first.

    The interval between samples is printed with six digits, as the format requires. The file must exist and be empty.

    Parameters
    ----------
    path : of the file
    recording : Recording
    """
    t = np.arange(len(recording.data)) / recording.rate
    responses = [
        pyuff.prepare_58(
            func_type=_TIME_RESPONSE,
            id1=channel.name,
            id2="acceleration [m/s2]",
            id3=_BEGUN.format(recording.start),
            id4=_PLACE.format(channel.device, channel.axis),
            rsp_ent_name="NONE",
            rsp_node=0,
            rsp_dir=0,
            ref_ent_name="NONE",
            ref_node=0,
            ref_dir=0,
            abscissa_spacing=1,
            abscissa_spec_data_type=_TIME,
            ordinate_spec_data_type=_ACCELERATION,
            orddenom_spec_data_type=_UNKNOWN,
            binary=0,
            data=column,
            x=t,
        )
        for channel, column in zip(recording.channels, recording.data.T, strict=True)
    ]
    pyuff.UFF(str(path)).write_sets([header_set("time responses"), SI_UNITS, *responses], "overwrite")


def _origin(series: Sequence[tuple[str, Dataset]]) -> Origin | None:
    """Return the origin that the ID lines of all channels state, None if any states none."""
    begun = [re.fullmatch(_BEGUN.format(r"(\d+)"), str(s["id3"]).strip()) for _, s in series]
    place = [re.fullmatch(_PLACE.format("(.+)", r"(\d+)"), str(s["id4"]).strip()) for _, s in series]
    if not series or not all(begun) or not all(place):
        return None
    channels = tuple(
        Channel(name=name, device=found[1], axis=int(found[2]))
        for (name, _), found in zip(series, place, strict=True)
        if found
    )
    return Origin(start=min(int(found[1]) for found in begun if found), channels=channels)


def _stated_start(series: Sequence[tuple[int, Dataset]], order: str | None) -> StatedStart | UnclearDate | None:
    """Return the earliest date of the ID lines 3, None if none has one."""
    texts = {number: " ".join(str(s["id3"]).split()) for number, s in series}
    known = order or date_order(texts.values())
    found: list[StatedStart] = []
    for number, text in texts.items():
        place = f"ID line 3 of dataset {number}"
        if slashed(text) and known is None:
            return UnclearDate(text=text, place=place)
        for kind in (DAY, MOMENT):
            with suppress(ValueError):
                time = round(1e6 * kind.ordered(known).read(text)) * 1000
                found.append(StatedStart(time=time, place=place, with_clock=kind is MOMENT))
                break
    return min(found, key=lambda start: start.time, default=None)


def _names(path: Path, series: Sequence[tuple[int, Dataset]]) -> list[str]:
    """Return the name of each channel, all different."""
    by_node = [node_name(s) for _, s in series]
    by_line = [line if (line := str(s["id1"]).strip()) != "NONE" else "" for _, s in series]
    numbered = by_node if all(s["rsp_node"] for _, s in series) else []  # node 0 is none
    for names in (numbered, by_line, by_node):
        if not names:
            continue
        if len(set(names)) == len(names) and all(names):
            return names
    twice = next(name for name in by_node if by_node.count(name) > 1)
    places = ", ".join(str(number) for (number, _), name in zip(series, by_node, strict=True) if name == twice)
    raise DataError(path, f"datasets {places}: expected different channels, found {twice!r} in each")


def _label(series: Dataset) -> str:
    """Return the label of the unit of the data, "" without one."""
    label = str(series["ordinate_axis_units_lab"]).strip().replace(_NO_UTF8, "²")
    return "" if label.upper() == "NONE" else label


def _usable_label(series: Dataset) -> str:
    """Return the label of the unit of the data if it is a unit of their type, else ""."""
    label, kind = _label(series), int(series["ordinate_spec_data_type"])
    unit = parse_unit(label)
    return label if unit is not None and _QUANTITIES.get(kind, unit.quantity) == unit.quantity else ""


def _unused_labels(series: Sequence[tuple[str, Dataset]], length: float) -> tuple[str, ...]:
    """Return a remark on labels that differ from the units taken, for lengths per metre; nothing without any."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, s in series:
        label, quantity = _label(s), _QUANTITIES.get(int(s["ordinate_spec_data_type"]), "acceleration")
        unit = parse_unit(label)
        same = unit is not None and unit.quantity == quantity and abs(unit.factor * length - 1) < _SAME
        if label and not same:
            found.setdefault((label, quantity), []).append(name)
    listed = "; ".join(f"{label!r} of {', '.join(names)} ({quantity})" for (label, quantity), names in found.items())
    taken = "lengths of dataset 164" if length != 1 else "metres"
    return (f"labels of units not used: {listed}, taken in {taken} and seconds",) if listed else ()


def _column(path: Path, number: int, series: Dataset, name: str) -> FloatArray:
    """Return one channel [lengths as in the file], checked."""
    kind = int(series["ordinate_spec_data_type"])
    if kind not in _UNITS:
        held = _KINDS.get(kind, f"data of type {kind}")
        raise DataError(
            path, f"dataset {number} ({name}): expected acceleration, velocity or displacement, found {held}"
        )
    if int(series["abscissa_spacing"]) != 1 or not series["abscissa_inc"] > 0:
        raise DataError(path, f"dataset {number} ({name}): expected even steps of time, found uneven ones")
    values = np.asarray(series["data"])
    if np.iscomplexobj(values) or not len(values) or np.isinf(values).any():
        raise DataError(path, f"dataset {number} ({name}): expected finite real numbers")
    return values.astype(np.float64)


def _check_same(path: Path, series: Sequence[tuple[int, Dataset]]) -> None:
    """Refuse channels that were not sampled together."""
    stated = [(number, len(s["data"]), float(s["abscissa_inc"]), float(s["abscissa_min"])) for number, s in series]
    for number, n, step, start in stated[1:]:
        first, n_first, step_first, start_first = stated[0]
        together = abs(step / step_first - 1) < _SAME and abs(start - start_first) < step_first / 2
        if n != n_first or not together:
            raise DataError(
                path,
                f"dataset {number}: expected {n_first} samples every {step_first:g} s from {start_first:g} s, as in "
                f"dataset {first}, found {n} every {step:g} s from {start:g} s",
            )

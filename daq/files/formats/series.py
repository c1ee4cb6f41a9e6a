"""Signals of one file with names, units and starts of their own, put on one time grid."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.files.archive_size import check_unpacked
from daq.files.columns.headings import parted
from daq.files.columns.time_column import times_and_start
from daq.files.columns.time_grid import TOLERANCE, UnevenError, even_grid
from daq.files.formats.arrays import Arrays
from daq.types import FloatArray, IndexArray

_SAME_RATE = 1e-6  # relative


@dataclass(frozen=True, eq=False, kw_only=True)
class Series:
    """Samples of one channel at a constant rate, without a gap."""

    name: str
    values: FloatArray  #: (n_samples,)
    rate: float | None  #: [Hz]; None if not known
    start: int | None = None  #: time of the first sample [ns UTC]; None if not known
    unit: str = ""  #: "" if not known
    remark: str = ""  #: on its times


@dataclass(frozen=True, eq=False)
class TimeAxis:
    """Even grid of the samples of channels with a common channel of times."""

    rate: float  #: [Hz]
    start: int | None  #: time of the first sample [ns UTC]; None if not known
    index: IndexArray  #: (n_samples,) places on the grid; places without a sample are gaps
    remark: str = ""  #: on its times

    def series(self, name: str, values: FloatArray, unit: str) -> Series:
        """Return samples (n_samples,) of a channel on the grid, NaN between."""
        found = np.full(int(self.index[-1]) + 1, np.nan)
        found[self.index] = values
        return Series(name=name, values=found, rate=self.rate, start=self.start, unit=unit, remark=self.remark)


def axis_of_times(path: Path, name: str, t: FloatArray, unit: str | None) -> TimeAxis:
    """Return the grid of times that are numbers; of those counted from 1970 it has the start.

    Parameters
    ----------
    path : of the file
    name : of the channel of times
    t : (n_samples,)
    unit : of `TIME_UNITS`; by default that of the name, or the one in which the times are plausible

    Raises
    ------
    DataError
        If the unit is not known, or naming the time that is not on an even grid.
    """
    seconds, start, remark = times_and_start(path, name, t, unit)
    return replace(axis_of_seconds(path, name, seconds, start), remark=remark)


def axis_of_seconds(path: Path, name: str, t: FloatArray, start: int | None) -> TimeAxis:
    """Return the grid of times [s].

    Parameters
    ----------
    path : of the file
    name : of the channel of times
    t : (n_samples,) [s]
    start : time of the first sample [ns UTC], if known

    Raises
    ------
    DataError
        Naming the time that is not on an even grid.
    """
    try:
        grid = even_grid(t)
    except UnevenError as error:
        raise DataError(path, f"{name}[{error.row}]: {error.why}") from error
    return TimeAxis(grid.rate, start, grid.index)


def together(path: Path, series: Sequence[Series], wanted: Collection[str] | None) -> Arrays:
    """Return the channels that have the same rate: those that are wanted, else as many as possible.

    Parts of one channel are joined; samples that a channel lacks are NaN.

    Parameters
    ----------
    path : of the file
    series : parts of channels, in order of time for each channel
    wanted : names of channels, with their units or without

    Raises
    ------
    DataError
        Naming a wanted channel that is missing or has another rate than the others, or one that is between the samples
        of the others.
    """
    named = [(_name(one), one) for one in series if len(one.values)]
    if wanted is not None:
        chosen = [(name, one) for name, one in named if name in wanted or one.name in wanted or _bare(name) in wanted]
        known = {text for name, one in named for text in (name, one.name, _bare(name))}
        if lacking := [name for name in wanted if name not in known]:
            raise DataError(path, f"expected a channel {lacking[0]!r}, found {_listed([name for name, _ in named])}")
        named = chosen
    if not named:
        raise DataError(path, "holds no signal")
    groups: list[list[tuple[str, Series]]] = []
    for name, one in named:
        group = next((group for group in groups if _alike(group[0][1], one)), None)
        if group is None:
            groups.append([(name, one)])
        else:
            group.append((name, one))
    most = max(groups, key=lambda group: (len({name for name, _ in group}), len(group[0][1].values)))
    others = list(dict.fromkeys(name for group in groups if group is not most for name, _ in group))
    if wanted is not None and others:
        raise DataError(path, f"channel {others[0]!r} has another rate, length or start than {most[0][0]!r}")
    return _on_one_grid(path, most, tuple(f"{name} (another rate)" for name in others))


def _name(one: Series) -> str:
    return f"{one.name} [{one.unit}]" if one.unit and not parted(one.name)[1] else one.name


def _bare(name: str) -> str:
    return parted(name)[0]


def _alike(one: Series, other: Series) -> bool:
    """Return whether two series may be on one grid."""
    if one.rate is None or other.rate is None or one.start is None or other.start is None:
        return one.rate == other.rate and one.start == other.start and len(one.values) == len(other.values)
    return abs(one.rate / other.rate - 1) < _SAME_RATE


def _on_one_grid(path: Path, named: Sequence[tuple[str, Series]], left: tuple[str, ...]) -> Arrays:
    first = named[0][1]
    names = tuple(dict.fromkeys(name for name, _ in named))
    start = min((one.start for _, one in named if one.start is not None), default=None)
    places = []
    for name, one in named:
        after = 0.0
        if start is not None and one.start is not None and first.rate is not None:
            after = (one.start - start) * 1e-9 * first.rate
        if abs(after - round(after)) > TOLERANCE:
            raise DataError(path, f"channel {name!r}: its samples are {after % 1:.2g} periods off those of the others")
        places.append(round(after))
    n = max(place + len(one.values) for place, (_, one) in zip(places, named, strict=True))
    check_unpacked(path, "samples and gaps", 8 * n * len(names))
    values = np.full((n, len(names)), np.nan)
    for place, (name, one) in zip(places, named, strict=True):
        values[place : place + len(one.values), names.index(name)] = one.values
    if np.isinf(values).any():
        raise DataError(path, "expected finite numbers, found inf")
    remarks = tuple(dict.fromkeys(one.remark for _, one in named if one.remark))
    return Arrays(names=names, values=values, rate=first.rate, t=None, began=start, left=left, remarks=remarks)


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(dict.fromkeys(names)):.200}" if names else "none"

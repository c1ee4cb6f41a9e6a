"""MiniSEED files of seismographs, versions 2 and 3, read with pymseed (libmseed)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pymseed import MS3TraceList, PymseedError, sourceid2nslc

from daq.files.archive_size import check_unpacked, damage_named
from daq.files.formats.arrays import Arrays
from daq.files.formats.series import Series, together
from daq.files.options import DataOptions

_COUNTS = "i"  # type of samples that are counts of the digitizer


def read(path: Path, options: DataOptions) -> Arrays:
    """Read all traces; pauses are gaps, and integers are counts, whose sensitivity is needed.

    A channel is named by its codes as far as these are needed, as ``HNZ`` or ``AM.R7FA5.00.ENZ``.

    Raises
    ------
    DataError
        Naming the file.
    """
    with damage_named(path, "miniSEED", PymseedError), MS3TraceList.from_file(path, unpack_data=True) as traces:
        check_unpacked(path, "samples", 8 * sum(segment.numsamples for trace in traces for segment in trace))
        series = list(_series(traces))
    return together(path, series, options.columns)


def _series(traces: MS3TraceList) -> Iterator[Series]:
    codes = {trace.sourceid: _codes(trace.sourceid) for trace in traces}
    last = [code[-1] for code in codes.values()]
    for trace in traces:
        code = codes[trace.sourceid]
        name = code[-1] if last.count(code[-1]) == 1 else ".".join(code)
        for segment in trace:
            if segment.sampletype not in ("i", "f", "d") or not segment.samprate > 0:
                continue
            yield Series(
                name=name,
                values=np.array(segment.np_datasamples, np.float64),
                rate=segment.samprate,
                start=segment.starttime,
                unit="counts" if segment.sampletype == _COUNTS else "",
            )


def _codes(source: str) -> tuple[str, ...]:
    """Return network, station, location and channel; the whole text if it is not of this form."""
    try:
        return tuple(sourceid2nslc(source))
    except (ValueError, PymseedError):
        return (source,)

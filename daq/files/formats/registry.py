"""Table of the formats: endings, module, and the package that it needs. A module is imported when a file is read."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import cast

from daq.errors import DataError, reading
from daq.files.formats.arrays import Arrays
from daq.files.options import DataOptions
from daq.types import Recording

_EXTRA = "modalwatch[formats]"


@dataclass(frozen=True, kw_only=True)
class Format:
    """A format of files of measurements.

    Its module has ``read(path, options)``, which returns `Arrays`, and ``write(path, recording)`` if `writes`.
    """

    name: str
    endings: tuple[str, ...]  #: of file names, in lower case
    module: str  #: module of this package
    package: str | None = None  #: package of the extra `formats` that it imports; None: a package that is always there
    writes: bool = False  #: whether recordings can be exported


FORMATS = (
    Format(name="numpy", endings=(".npz",), module="arrays", writes=True),
    Format(name="numpy array", endings=(".npy",), module="arrays"),
    Format(name="MATLAB", endings=(".mat",), module="arrays", writes=True),
    Format(name="universal file", endings=(".uff", ".unv"), module="uff", writes=True),
    Format(name="HDF5", endings=(".h5", ".hdf5", ".hdf"), module="hdf5", package="h5py", writes=True),
    Format(name="Parquet", endings=(".parquet", ".pq"), module="arrow", package="pyarrow", writes=True),
    Format(name="Arrow", endings=(".arrow", ".feather"), module="arrow", package="pyarrow", writes=True),
    Format(name="TDMS", endings=(".tdms",), module="tdms", package="npTDMS"),
    Format(name="MDF", endings=(".mf4", ".mdf"), module="mdf", package="asammdf"),
    Format(name="miniSEED", endings=(".mseed", ".miniseed", ".ms", ".mseed3"), module="miniseed", package="pymseed"),
    Format(name="WAV", endings=(".wav",), module="wav"),
)  #: all formats but tables of text


def format_of(path: Path) -> Format | None:
    """Return the format of a file by its ending, None for a table of text."""
    ending = path.suffix.lower()
    return next((known for known in FORMATS if ending in known.endings), None)


def read_format(known: Format, path: Path, options: DataOptions) -> Arrays:
    """Read the signals of a file.

    Raises
    ------
    DataError
        Naming the file, and the package that is not installed, or what is wrong.
    """
    with reading(path, DataError):
        path.open("rb").close()
    read = cast("Callable[[Path, DataOptions], Arrays]", _function(known, path, "read"))
    return read(path, options)


def write_format(known: Format, path: Path, recording: Recording) -> None:
    """Write a recording to a file that exists and is empty.

    Raises
    ------
    DataError
        Naming the file, and the package that is not installed, or what is wrong.
    """
    write = cast("Callable[[Path, Recording], None]", _function(known, path, "write"))
    write(path, recording)


def _function(known: Format, path: Path, name: str) -> object:
    try:
        return getattr(import_module(f"daq.files.formats.{known.module}"), name)
    except ImportError as error:
        raise DataError(
            path, f"{known.name} needs {known.package}, which is not installed: pip install '{_EXTRA}'"
        ) from error

"""MAT files. scipy.io takes 23 MB: who records for years, and never meets such a file, is spared it until then."""

from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from daq.errors import DataError

_HDF5 = 2  # major version, which scipy does not read


def read_mat(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name.

    Raises
    ------
    OSError
        If it cannot be read.
    DataError
        If it is of Matlab 7.3.
    ValueError
        If it is none, or damaged; scipy raises others too.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError, matfile_version

    try:
        if matfile_version(path)[0] == _HDF5:
            raise DataError(path, "is a Matlab 7.3 file: save it with -v7")
        return {name: array for name, array in loadmat(path).items() if not name.startswith("__")}
    except MatReadError as error:
        raise ValueError(str(error)) from error


def write_mat(file: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write arrays to an open file, compressed."""
    from scipy.io import savemat

    savemat(file, dict(arrays), do_compression=True)  # type: ignore[arg-type]  # the stubs know no open files

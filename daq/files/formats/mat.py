"""MAT files. scipy.io (23 MB) is imported only when such a file is read."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, Literal

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, inflated_size, max_unpacked

_COMPRESSED = 1  # major version with possibly compressed arrays
_DEFLATED = 15  # type of a compressed element
_HDF5 = 2  # major version, which scipy does not read


def read_mat(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name.

    Raises
    ------
    OSError
        If it cannot be read.
    DataError
        If it is of Matlab 7.3 and h5py is not installed.
    ValueError
        If it is none, or damaged; scipy raises others too.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError, matfile_version

    try:
        version = matfile_version(path)[0]
        if version == _HDF5:
            return _read_hdf5(path)
        if version == _COMPRESSED:
            _check_size(path)
        return {name: array for name, array in loadmat(path).items() if not name.startswith("__")}
    except MatReadError as error:
        raise ValueError(str(error)) from error


def _read_hdf5(path: Path) -> dict[str, Any]:
    try:
        from daq.files.formats.mat73 import read_mat73
    except ImportError as error:
        raise DataError(
            path, "is a Matlab 7.3 file, which needs h5py: save it with -v7, or pip install 'modalwatch[formats]'"
        ) from error
    return read_mat73(path)


def _check_size(path: Path) -> None:
    """Refuse compressed arrays that are far larger than the file."""
    size = 0
    with path.open("rb") as file:
        order: Literal["little", "big"] = "little" if file.read(128)[126:] == b"IM" else "big"
        while len(tag := file.read(8)) == 8:
            kind, n = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind != _DEFLATED:
                file.seek(n, os.SEEK_CUR)
                continue
            begin = file.tell()
            size += inflated_size(file, n, max_unpacked(path))
            check_unpacked(path, "arrays", size)
            file.seek(begin + n)


def write_mat(file: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write arrays to an open file, compressed."""
    from scipy.io import savemat

    savemat(file, dict(arrays), do_compression=True)  # type: ignore[arg-type]  # the stubs know no open files

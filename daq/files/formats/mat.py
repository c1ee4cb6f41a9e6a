"""MAT files; those of Matlab 7.3 are HDF5 files. scipy.io (23 MB) and h5py are imported only when one is read."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal

import numpy as np

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, inflated_size, max_unpacked

if TYPE_CHECKING:
    import h5py

_COMPRESSED = 1  # major version with possibly compressed arrays
_DEFLATED = 15  # type of a compressed element
_HDF5 = 2  # major version, which scipy does not read
_MAX_CELLS = 10_000


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
    """Return the arrays of a file of Matlab 7.3, as scipy does for older files: numbers, texts, and cells of texts.

    Raises
    ------
    OSError, ValueError
        If it is damaged; h5py raises others too.
    DataError
        If arrays are far larger than the file, or h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise DataError(
            path, "is a Matlab 7.3 file, which needs h5py: save it with -v7, or pip install 'modalwatch[formats]'"
        ) from error
    with h5py.File(path, "r") as file:
        sets = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
        check_unpacked(path, "arrays", sum(item.size * item.dtype.itemsize for item in sets.values()))
        found = {name: _content(file, item) for name, item in sets.items()}
    return {name: content for name, content in found.items() if content is not None}


def _content(file: "h5py.File", item: "h5py.Dataset") -> object:
    """Return the content of a variable, None if it is of another kind."""
    kind = item.attrs.get("MATLAB_class", b"")
    if kind == b"char":
        return np.array(_text(item))
    if kind == b"cell" and item.size <= _MAX_CELLS:
        return np.array([_text(file[reference]) for reference in item[()].ravel()], object)
    return item[()].T if item.dtype.kind in "iuf" else None


def _text(item: "h5py.Dataset") -> str:
    return "".join(chr(code) for code in np.ravel(item[()]).tolist()[:_MAX_CELLS])


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

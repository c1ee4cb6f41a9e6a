"""MAT files of Matlab 7.3, which are HDF5 files; read with h5py."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from daq.files.archive_size import check_unpacked

_MAX_CELLS = 10_000


def read_mat73(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name, as scipy does for older files: numbers, texts, and cells of texts.

    Raises
    ------
    OSError, ValueError
        If it is damaged; h5py raises others too.
    DataError
        If arrays are far larger than the file.
    """
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

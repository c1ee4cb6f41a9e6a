"""MAT files; those of Matlab 7.3 are HDF5 files. scipy.io (23 MB) and h5py are imported only when one is read."""

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal

import numpy as np

from daq.errors import DataError
from daq.files.archive_size import check_unpacked, inflated, max_unpacked

if TYPE_CHECKING:
    import h5py

_COMPRESSED = 1  # major version with possibly compressed arrays
_ARRAY, _DEFLATED = 14, 15  # kinds of elements: of an array, and one that is compressed
_KINDS = frozenset((*range(1, 8), 9, 12, 13, _ARRAY, 16, 17, 18))  # of numbers, of arrays in cells, and of texts
_MAX_DEPTH = 50  # arrays in arrays
_HDF5 = 2  # major version, which scipy does not read
_MAX_CELLS = 10_000


def read_mat(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name.

    Raises
    ------
    OSError
        If it cannot be read.
    DataError
        If it is of Matlab 7.3 and h5py is not installed, or damaged.
    ValueError
        If it is not a Matlab file, or damaged; scipy raises others too.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError, matfile_version

    try:
        version = matfile_version(path)[0]
        if version == _HDF5:
            return _read_hdf5(path)
        if version == _COMPRESSED:
            _check_elements(path)
        return _with_fields({name: array for name, array in loadmat(path).items() if not name.startswith("__")})
    except MatReadError as error:
        raise ValueError(str(error)) from error
    except UnboundLocalError as error:  # of scipy
        raise DataError(path, "is damaged: an array is of an unknown class") from error


def _with_fields(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Return arrays with the fields of structures in their place; a field that is called as another one is left out."""
    found: dict[str, Any] = {}
    for name, array in arrays.items():
        fields = getattr(getattr(array, "dtype", None), "names", None)
        if fields and array.size == 1:
            found = _with_fields({field: array[field].item() for field in fields}) | found
        else:
            found[name] = array
    return found


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
        groups = [file, *(item for name, item in file.items() if isinstance(item, h5py.Group) and name[0] != "#")]
        sets = {n: item for group in groups[::-1] for n, item in group.items() if isinstance(item, h5py.Dataset)}
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


def _check_elements(path: Path) -> None:
    """Refuse compressed arrays that are far larger than the file, and elements of unknown kind, at which scipy crashes.

    Raises
    ------
    DataError
        If there are any.
    zlib.error
        If compressed arrays are damaged.
    """
    size = 0
    with path.open("rb") as file:
        order: Literal["<", ">"] = "<" if file.read(128)[126:] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, n = struct.unpack(f"{order}II", tag)
            begin = file.tell()
            if kind == _DEFLATED:
                content = inflated(file, n, max_unpacked(path))
                size += len(content)
                check_unpacked(path, "arrays", size)
                _check_kinds(path, memoryview(content), order)
                del content
            elif kind == _ARRAY:
                _check_kinds(path, memoryview(file.read(n)), order)
            file.seek(begin + n)


def _check_kinds(path: Path, content: memoryview, order: Literal["<", ">"], depth: int = 0) -> None:
    """Refuse elements of unknown kind, also inside arrays; those of up to four bytes have their size in the tag."""
    at = 0
    while at + 8 <= len(content):
        kind, n = struct.unpack_from(f"{order}II", content, at)
        small = kind >> 16
        kind &= 0xFFFF
        if kind not in _KINDS:
            raise DataError(path, f"is damaged: an element is of the unknown kind {kind}")
        if depth > _MAX_DEPTH:
            raise DataError(path, f"is damaged: arrays are in more than {_MAX_DEPTH} others")
        if kind == _ARRAY and not small:
            _check_kinds(path, content[at + 8 : at + 8 + n], order, depth + 1)
        at += 8 if small else 8 + n + -n % 8


def write_mat(file: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write arrays to an open file, compressed."""
    from scipy.io import savemat

    savemat(file, dict(arrays), do_compression=True)  # type: ignore[arg-type]  # the stubs know no open files

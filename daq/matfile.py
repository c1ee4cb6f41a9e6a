"""MAT files. scipy.io takes 23 MB: who records for years, and never meets such a file, is spared it until then."""

from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any


def read_mat(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name.

    Raises
    ------
    OSError
        If it cannot be read.
    NotImplementedError
        If it is of Matlab 7.3.
    ValueError
        If it is none, or damaged; scipy raises others too.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        return {name: array for name, array in loadmat(path).items() if not name.startswith("__")}
    except MatReadError as error:
        raise ValueError(str(error)) from error


def write_mat(file: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write arrays to an open file, compressed."""
    from scipy.io import savemat

    savemat(file, dict(arrays), do_compression=True)  # type: ignore[arg-type]  # the stubs know no open files

"""Search for frames of fixed length in a byte stream."""

import numpy as np
import numpy.typing as npt


def without_overlap(starts: npt.NDArray[np.intp], size: int) -> npt.NDArray[np.intp]:
    """Return where frames of a size begin, ascending, of which none overlaps another: those to the left are kept."""
    if not np.any(np.diff(starts) < size):
        return starts
    kept: list[int] = []
    for start in starts.tolist():
        if not kept or start >= kept[-1] + size:
            kept.append(start)
    return np.array(kept, np.intp)

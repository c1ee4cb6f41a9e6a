"""Scans of one device held until they are used: blocks that follow each other are one run."""

from bisect import bisect_left, bisect_right

import numpy as np

from daq.types import Block, FloatArray, IndexArray, IntArray


class UnreadCountsError(LookupError):
    """A window needs counts that were not read."""


class ScanRun:
    """Blocks that follow each other without a gap, of one scale and number of axes."""

    def __init__(self, block: Block) -> None:
        self.first, self.end = block.first_index, block.first_index  #: first scan held, and the one after the last
        self._scale, self.n_axes = block.scale, block.counts.shape[1]
        self._n_marked, self._refuses = 0, False  # first blocks, and whether their counts are refused
        self._counts: list[IntArray] = []  # (n_axes, n) of each block
        self._ends: list[int] = []  # scan after each block
        self.temperatures: list[float] = []  #: temperature of each block [degC]
        self.add(block)

    def __len__(self) -> int:
        return len(self._ends)

    def is_continued_by(self, block: Block) -> bool:
        """Return whether a block belongs to the run."""
        return block.first_index == self.end and block.scale == self._scale and block.counts.shape[1] == self.n_axes

    def add(self, block: Block) -> None:
        """Take the block that follows."""
        self.end += len(block.counts)
        self._counts.append(block.counts.T)
        self._ends.append(self.end)
        self.temperatures.append(block.temperature)

    def mark(self) -> None:
        """Mark the blocks held now."""
        self._n_marked = len(self)

    def refuse_marked(self) -> None:
        """Refuse the counts of marked blocks."""
        self._refuses = True

    def n_after(self, index: float) -> int:
        """Return the number of blocks that do not end before a scan."""
        return len(self) - bisect_left(self._ends, index)

    def forget(self, index: float) -> None:
        """Drop blocks that end before a scan, but for the last one."""
        n = min(bisect_left(self._ends, index), len(self._ends) - 1)
        if n > 0:
            self.first = self._ends[n - 1]
            del self._counts[:n], self._ends[:n], self.temperatures[:n]
            self._n_marked = max(0, self._n_marked - n)

    def write(self, first: int, axes: IndexArray, out: FloatArray) -> None:
        """Write scans of some axes in m/s2 from `first` on, (n_axes, n), NaN of an axis that the blocks lack.

        Raises
        ------
        UnreadCountsError
            If their counts are refused.
        """
        last = first + out.shape[1]
        begin, end = bisect_right(self._ends, first), bisect_left(self._ends, last)
        if self._refuses and begin < self._n_marked:
            raise UnreadCountsError(f"scan {first}: its counts were not read")
        offset = first - (self._ends[begin - 1] if begin else self.first)
        counts = np.concatenate(self._counts[begin : end + 1], axis=1)[:, offset : offset + out.shape[1]]
        there = axes < self.n_axes
        if there.all():
            np.multiply(counts[axes], self._scale, out=out)
        else:
            out[there], out[~there] = counts[axes[there]] * self._scale, np.nan

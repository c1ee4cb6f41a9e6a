"""Cumulative sums of modal quantities over cells of members: a stretch is the difference of two sums."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from daq import FloatArray, IndexArray
from updater.structure import Member

_CELLS = 300  # along the longest member
_MAX_CELLS = 6000  # of all members together, as far as each has two


@dataclass(frozen=True, eq=False, kw_only=True)
class Cells:
    """Equal pieces of each member, an even number of them."""

    members: tuple[Member, ...]
    count: IndexArray  #: (n_members,) cells of each
    length: FloatArray  #: (n_members,) of a cell of each [m]

    def edge(self, member: IndexArray, number: IndexArray) -> IndexArray:
        """Return the rows of cells' edges (n,), when those of all members are in one table."""
        return np.asarray(np.concatenate([[0], np.cumsum(self.count + 1)])[member] + number)

    def between(self, table: FloatArray, member: IndexArray, number: FloatArray) -> FloatArray:
        """Return a table's values (n, ...) between the edges of cells, linearly.

        Parameters
        ----------
        table : (n_edges, ...)
        member : (n,)
        number : (n,) cells from the member's start
        """
        return weighed(table, *self.about(member, number))

    def about(self, member: IndexArray, number: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Return the two edges (n, 2) about points as rows of a table, and the share (n, 2) that each has."""
        low = np.clip(np.floor(number), 0, self.count[member] - 1).astype(np.intp)
        edge, share = self.edge(member, low), number - low
        return np.stack([edge, edge + 1], axis=1), np.stack([1 - share, share], axis=1)

    def middles(self, member: int) -> FloatArray:
        """Return the middles of a member's cells (n_cells,), as distances from its start [m]."""
        return np.asarray((np.arange(self.count[member]) + 0.5) * self.length[member])

    def edge_points(self) -> FloatArray:
        """Return the edges of all members' cells (n_edges, 3) [m]."""
        return np.concatenate(
            [
                member.point(np.linspace(0, member.length, n + 1))
                for member, n in zip(self.members, self.count, strict=True)
            ]
        )

    def summed(self, factors: list[FloatArray]) -> FloatArray:
        """Return integrals of A^T A from each member's start to each edge (n_edges, n_modes, n_modes).

        Parameters
        ----------
        factors : of each member, A (n_cells, k, n_modes) in the middles of its cells
        """
        sums = []
        for factor, length in zip(factors, self.length, strict=True):
            own = factor.transpose(0, 2, 1) @ factor * length
            sums += [np.zeros((1, *own.shape[1:])), np.cumsum(own, axis=0)]
        return np.concatenate(sums)


def cut(members: tuple[Member, ...]) -> Cells:
    """Return cells of about a 300th of the longest member."""
    length = np.array([member.length for member in members])
    cell = max(length.max() / _CELLS, length.sum() / _MAX_CELLS)
    count = np.maximum(2 * np.round(length / cell / 2).astype(np.intp), 2)
    return Cells(members=members, count=count, length=length / count)


def weighed(table: FloatArray, rows: IndexArray, share: FloatArray) -> FloatArray:
    """Return sums (n, ...) of a table's rows (n, k), each by its share (n, k)."""
    n, k = rows.shape
    summed = sparse.csr_array((share.ravel(), rows.ravel(), np.arange(0, n * k + 1, k)), shape=(n, len(table)))
    return np.asarray(summed @ table.reshape(len(table), -1)).reshape(n, *table.shape[1:])

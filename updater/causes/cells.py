"""Members cut into cells, over which what a mode does is summed: a stretch's share is the difference of two sums."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.structure import Member

_CELLS = 300  # along the longest member
_MOST_CELLS = 6000  # of all members together, as far as each has two
_FEWER = 4  # times fewer edges than values between them: then one product is quicker


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

        Where many fall between the same few edges, as what is fixed beside all places of another cause, by one product.

        Parameters
        ----------
        table : (n_edges, ...)
        member : (n,)
        number : (n,) cells from the member's start
        """
        low = np.clip(np.floor(number), 0, self.count[member] - 1).astype(np.intp)
        share = number - low
        edge = self.edge(member, low)
        edges, which = np.unique(np.stack([edge, edge + 1]), return_inverse=True)
        if _FEWER * len(edges) < len(edge):
            weight = np.zeros((len(edge), len(edges)))
            weight[np.arange(len(edge)), which.reshape(2, -1)] = 1 - share, share
            return np.asarray(np.tensordot(weight, table[edges], axes=1))
        share = share.reshape(-1, *[1] * (table.ndim - 1))
        return np.asarray((1 - share) * table[edge] + share * table[edge + 1])

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
    cell = max(length.max() / _CELLS, length.sum() / _MOST_CELLS)
    count = np.maximum(2 * np.round(length / cell / 2).astype(np.intp), 2)
    return Cells(members=members, count=count, length=length / count)

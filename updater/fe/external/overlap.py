"""Elements that two groups of external matrices have in common."""

import numpy as np
from scipy import sparse

from daq import IntArray

_WHOLE = 1e-6  # relative: error of truncated digits in a text file
_NONE = 1e-12  # of the largest stiffness


class SharedElements:
    """Pairs of nodes whose whole stiffness is in one group: if it is in a second one, an element is in both.

    The stiffness between two nodes is a sum over the elements with both nodes. Disjoint groups cannot both have the
    whole of it. Between opposite corners of a quadrilateral, and on a beam, one element has it all. Not found are
    shared elements of which each pair of nodes has further elements, and springs to the ground.
    """

    def __init__(self, stiffness: sparse.csc_array, dofs: IntArray) -> None:
        """Prepare for groups of a stiffness (n_dofs, n_dofs) with the rows of each node (n_nodes, 6)."""
        node, axis = np.nonzero(dofs >= 0)
        ones = np.ones(len(node))
        self._of_node = sparse.csr_array((ones, (dofs[node, axis], node)), shape=(stiffness.shape[0], len(dofs)))
        self._stiffness = stiffness
        self._largest = float(abs(stiffness).max())
        self._all = self._between_nodes(stiffness)
        self._groups: dict[str, sparse.csr_array] = {}

    def with_group(self, name: str, group: sparse.csc_array) -> tuple[str, tuple[int, int]] | None:
        """Add a group (n_dofs, n_dofs); return an earlier group with an element of it and two nodes, None if none."""
        margin = sparse.csr_array(_WHOLE * self._all - self._between_nodes(self._stiffness - group))
        own = sparse.csr_array(margin > 0)
        for other, pairs in self._groups.items():
            first, second = own.multiply(pairs).nonzero()
            if len(first):
                return other, (int(first[0]), int(second[0]))
        self._groups[name] = own
        return None

    def _between_nodes(self, matrix: sparse.csc_array) -> sparse.csr_array:
        """Return the sum of the sizes of entries between two different nodes, (n_nodes, n_nodes), a triangle."""
        sums = sparse.triu(sparse.csr_array(self._of_node.T @ abs(matrix) @ self._of_node), k=1, format="csr")
        sums.data[sums.data <= _NONE * self._largest] = 0.0
        return sparse.csr_array(sums)

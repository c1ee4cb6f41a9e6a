"""Search for the element on which a point lies, for many points and many elements."""

from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from daq import FloatArray, IndexArray
from updater.entry import ON_MEMBER
from updater.errors import ModelError


class SpanIndex:
    """Straight spans between nodes.

    Parameters
    ----------
    nodes : (n_nodes, 3) [m]
    first, last : (n_spans,) nodes
    """

    def __init__(self, nodes: FloatArray, first: IndexArray, last: IndexArray) -> None:
        self.first, self.last = first, last
        self._start = nodes[first]
        self._along = nodes[last] - self._start
        self._length = np.linalg.norm(self._along, axis=1)

    def locate(self, points: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Return the nearest span of each point (n, 3), and the share of its length there.

        Raises
        ------
        ModelError
            If a point lies on none.
        """
        reach = self._length.max(initial=0.0) / 2 + ON_MEMBER
        near = self._tree.query_ball_point(points, reach, return_sorted=True)
        which = np.repeat(np.arange(len(points)), [len(spans) for spans in near])
        span = np.concatenate([*near, []]).astype(np.intp)
        xi, distance = self._project(points[which], span)
        order = np.lexsort((span, distance, which))
        found, best = np.unique(which[order], return_index=True)
        best = order[best]
        lost = np.setdiff1d(np.arange(len(points)), found[distance[best] <= ON_MEMBER])
        if len(lost):
            point = points[lost[0]]
            off = self._project(point, np.arange(len(self._length)))[1].min()
            raise ModelError(f"the point {point.tolist()} lies on no member ({off:.3g} m off)")
        return span[best], xi[best]

    def _project(self, points: FloatArray, span: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Return the share along spans (n,) nearest to points (n, 3), and the distance from it [m]."""
        away = points - self._start[span]
        squared = np.maximum(self._length[span] ** 2, np.finfo(float).tiny)  # a node alone is a span of no length
        xi = np.clip(np.einsum("ij,ij->i", away, self._along[span]) / squared, 0, 1)
        return xi, np.linalg.norm(away - xi[:, None] * self._along[span], axis=1)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._start + self._along / 2)

"""Nodes of a frame and the numbers of their DOFs."""

import itertools
import math
from collections import defaultdict
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from daq import FloatArray, IndexArray, IntArray
from updater.errors import ModelError
from updater.structure import AXES, ON_MEMBER, Joint, Member, Structure

COINCIDENT = 1e-6  # m: points nearer than this are the same node
_MISS = 1e-3  # m: points nearer to a member than this were meant to be on it
_SHORT = 0.01  # of a member's length, likewise
_SLIVER = 1e-4  # of a member's length: a segment that ends nearer to a node ends there
_CELL = 4 * COINCIDENT  # of the hash: a point's neighbours lie in at most eight cells, nearly always in one

Cell = tuple[int, ...]


class _Places:
    """Points found again by place, in a time that does not grow with their number."""

    def __init__(self) -> None:
        self.points: list[FloatArray] = []
        self._cells: defaultdict[Cell, list[int]] = defaultdict(list)

    def add(self, point: FloatArray) -> int:
        self._cells[tuple(math.floor(x / _CELL) for x in point.tolist())].append(len(self.points))
        self.points.append(point)
        return len(self.points) - 1

    def near(self, point: FloatArray) -> list[int]:
        """Return the points at a place, first added first."""
        low, high = (tuple(math.floor((x + side * COINCIDENT) / _CELL) for x in point.tolist()) for side in (-1, 1))
        cells = [low] if low == high else itertools.product(*({a, b} for a, b in zip(low, high, strict=True)))
        found = sorted(i for cell in cells for i in self._cells.get(cell, ()))
        return [i for i in found if math.dist(self.points[i], point) < COINCIDENT]


class Mesh:
    """Nodes and DOF numbers while a model is being built."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.twins: list[tuple[int, int, Joint]] = []  # node, its twin on the jointed member, the springs
        self.spans: list[tuple[int, int, Member]] = []
        self._places = _Places()
        self._twin_of: dict[tuple[int, int], int] = {}  # node, joint -> twin
        self._doubles: set[int] = set()  # nodes that are twins of others
        self._marks = _marks(structure)
        self._tree = KDTree(self._marks)
        for member in structure.member:
            self._add(member)
        self.nodes = np.array(self._places.points)

    def _add(self, member: Member) -> None:
        joints = [i for i, joint in enumerate(self.structure.joint) if joint.member == member.name]
        line = [self._node(p, joints) for p in self._stations(member)]
        self.spans += [(a, b, member) for a, b in itertools.pairwise(line)]

    def _stations(self, member: Member) -> FloatArray:
        """Nodes of one member, including ends of other members, joints, supports and ends of segments."""
        even = np.linspace(0, member.length, member.elements + 1)
        axis = np.subtract(member.end, member.start) / member.length
        near = self._tree.query_ball_point(member.point(member.length / 2), member.length / 2 + 2 * _MISS)
        marks = self._marks[sorted(near)]
        along = (marks - member.start) @ axis
        off = np.linalg.norm(marks - member.point(np.clip(along, 0, member.length)), axis=1)
        _refuse_miss(member, marks, off)
        for s in along[off < COINCIDENT]:
            if np.abs(even - s).min() > COINCIDENT:
                even = np.sort(np.append(even, s))
        for s in (end for start, stop, _ in self.structure.segments_of(member) for end in (start, stop)):
            if np.abs(even - s).min() > _SLIVER * member.length:
                even = np.sort(np.append(even, s))
        return member.point(even)

    def _node(self, point: FloatArray, joints: list[int]) -> int:
        """Return the node of a member at a point, by the member's joints."""
        plain = [i for i in self._places.near(point) if i not in self._doubles]
        node = plain[0] if plain else self._places.add(point)
        joint = next((i for i in joints if math.dist(self.structure.joint[i].at, point) < COINCIDENT), None)
        if joint is None:
            return node
        if (node, joint) not in self._twin_of:
            twin = self._twin_of[node, joint] = self._places.add(point)
            self._doubles.add(twin)
            self.twins.append((node, twin, self.structure.joint[joint]))
        return self._twin_of[node, joint]

    def find(self, at: tuple[float, float, float], what: str) -> int:
        """Return the node at a point.

        Raises
        ------
        ModelError
            If there is none.
        """
        near = self._places.near(np.asarray(at))
        if not near:
            raise ModelError(f"{what} at {list(at)}: no member passes there")
        return near[0]

    def number(self) -> IntArray:
        """Return the numbers of the DOFs (n_nodes, 6): fixed ones -1, twins share the rigid axes of their joint."""
        free = np.ones((len(self.nodes), 6), bool)
        for support in self.structure.support:
            free[self.find(support.at, "support"), [AXES.index(a) for a in support.fixed]] = False
        for _, twin, joint in self.twins:
            free[twin] = [axis in joint.stiffness for axis in AXES]
        dofs = np.full(free.shape, -1, np.int32)
        dofs[free] = np.arange(free.sum())
        for node, twin, _ in self.twins:
            dofs[twin] = np.where(free[twin], dofs[twin], dofs[node])
        return dofs


def _refuse_miss(member: Member, points: FloatArray, off: FloatArray) -> None:
    """Check that points (n, 3) are on a member or clearly off it, because near misses would not be joined."""
    missed = np.flatnonzero((off >= COINCIDENT) & (off < min(_MISS, _SHORT * member.length)))
    if len(missed):
        raise ModelError(
            f"member {member.name}: an end, support or joint at {points[missed[0]].tolist()} misses it by "
            f"{1e3 * off[missed[0]]:.2g} mm"
        )


def _marks(structure: Structure) -> FloatArray:
    """Return the points (n, 3) that any member they lie on must have a node at."""
    points = [p for member in structure.member for p in (member.start, member.end)]
    points += [support.at for support in structure.support] + [joint.at for joint in structure.joint]
    return np.array(points, float)


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
        found, xi, lost = self.nearest(points)
        if len(lost):
            point = points[lost[0]]
            off = self._project(point, np.arange(len(self._length)))[1].min()
            raise ModelError(f"the point {point.tolist()} lies on no member ({off:.3g} m off)")
        return found, xi

    def nearest(self, points: FloatArray) -> tuple[IndexArray, FloatArray, IndexArray]:
        """Return the nearest span of each point (n, 3) that is on one, the share there, and the points on none."""
        reach = self._length.max(initial=0.0) / 2 + ON_MEMBER
        near = self._tree.query_ball_point(points, reach, return_sorted=True)
        which = np.repeat(np.arange(len(points)), [len(spans) for spans in near])
        span = np.concatenate([*near, []]).astype(np.intp)
        xi, distance = self._project(points[which], span)
        order = np.lexsort((span, distance, which))
        best = order[np.unique(which[order], return_index=True)[1]]
        best = best[distance[best] <= ON_MEMBER]
        return span[best], xi[best], np.setdiff1d(np.arange(len(points)), which[best])

    def _project(self, points: FloatArray, span: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Return the share along spans (n,) nearest to points (n, 3), and the distance from it [m]."""
        away = points - self._start[span]
        squared = np.maximum(self._length[span] ** 2, np.finfo(float).tiny)  # a node alone is a span of no length
        xi = np.clip(np.einsum("ij,ij->i", away, self._along[span]) / squared, 0, 1)
        return xi, np.linalg.norm(away - xi[:, None] * self._along[span], axis=1)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._start + self._along / 2)

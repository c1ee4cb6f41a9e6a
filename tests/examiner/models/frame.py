"""A space frame of bars, and its modes: it shares nothing with the code it judges."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.linalg import eigsh, spsolve

from daq import FloatArray, IndexArray
from tests.examiner.models.bar import Bar, Vector, element, shape_functions

_STIFF = 1e12  # N/m, N m/rad: of a rigid ground on a floor


@dataclass(frozen=True, kw_only=True)
class Lump:
    """A rigid body on a bar; `spring` [Hz] lets it move along `axis` only, on a spring of its own."""

    bar: str
    s: float
    mass: float
    offset: Vector = (0.0, 0.0, 0.0)
    inertia: Vector = (0.0, 0.0, 0.0)
    axis: int = 0
    spring: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Prop:
    """A spring to the ground [N/m]."""

    bar: str
    s: float
    axis: int
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class Brace:
    """A bar that carries tension and compression only, hinged to two points [N/m]."""

    ends: tuple[tuple[str, float], tuple[str, float]]  #: bar and place along it [m]
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class Ground:
    """Support of a bar; stiffness along x y z [N/m] and about them [N m/rad], infinite where it cannot move."""

    bar: str
    s: float
    along: Vector = (np.inf, np.inf, np.inf)
    about: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Floor:
    """A floor on a spring of its own, which carries grounds: it moves along x y z (0..2) or about them (3..5)."""

    grounds: tuple[int, ...]
    axis: int
    mass: float  #: [kg], or [kg m2] about the middle of its grounds
    frequency: float  #: without the frame [Hz]


@dataclass(frozen=True, kw_only=True)
class Meeting:
    """Two bars with a point in common; stiffness about x y z between them [N m/rad], infinite where they are one."""

    bar: str
    s: float
    other: str
    t: float  #: along the other [m]
    about: Vector = (np.inf, np.inf, np.inf)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Bars on supports that meet each other; they have breaks at these points."""

    bars: tuple[Bar, ...]
    grounds: tuple[Ground, ...]
    meetings: tuple[Meeting, ...] = ()
    lumps: tuple[Lump, ...] = ()
    props: tuple[Prop, ...] = ()
    braces: tuple[Brace, ...] = ()
    floors: tuple[Floor, ...] = ()

    def bar(self, name: str) -> Bar:
        """Bar of that name."""
        return next(b for b in self.bars if b.name == name)

    def with_bar(self, name: str, **changes: Any) -> "Frame":
        """Return the frame with a bar altered."""
        return replace(self, bars=tuple(replace(b, **changes) if b.name == name else b for b in self.bars))

    def held(self, bar: str) -> tuple[float, ...]:
        """Return where a bar is supported [m]."""
        return tuple(g.s for g in self.grounds if g.bar == bar)

    def stops(self, bar: str) -> tuple[float, ...]:
        """Return ends, grounds and meetings along a bar [m]."""
        met = [at for m in self.meetings for name, at in ((m.bar, m.s), (m.other, m.t)) if name == bar]
        return tuple(sorted({0.0, self.bar(bar).length, *self.held(bar), *met}))

    def solved(self, n_modes: int) -> "Solved":
        """Return its lowest modes."""
        return _Assembly(self).solved(n_modes)

    def heated(self, name: str, expansion: float) -> dict[str, float]:
        """Return the axial force of each bar [N], tension positive, when a bar expands by a share of its length."""
        return _Assembly(self).heated(self.bar(name), expansion)


@dataclass(frozen=True, eq=False)
class Solved:
    """Modes of a frame."""

    frequency: FloatArray  #: (n_modes,) [Hz]
    shape: FloatArray  #: (n_dofs, n_modes) mass-normalised
    assembly: "_Assembly"

    def motion(self, bar: str, s: float) -> FloatArray:
        """Displacement and rotation (6, n_modes) about global axes at a point of a bar."""
        return np.asarray(self.assembly.rows(bar, s) @ self.shape)


class _Assembly:
    """Matrices of a frame, and where each bar's nodes are in them."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.ends = {bar.name: bar.ends() for bar in frame.bars}
        self.dofs: dict[str, IndexArray] = {}
        count = 0
        for bar in frame.bars:
            n = 2 * len(self.ends[bar.name]) - 1
            self.dofs[bar.name] = count + np.arange(6 * n).reshape(n, 6)
            count += 6 * n
        for meeting in frame.meetings:
            self._join(meeting)
        self.n = count + sum(bool(lump.spring) for lump in frame.lumps) + len(frame.floors)
        rigid = [np.isinf((*g.along, *g.about)) & ~self._carried(i) for i, g in enumerate(frame.grounds)]
        held = [self.node(g.bar, g.s)[fixed] for g, fixed in zip(frame.grounds, rigid, strict=True)]
        used = np.unique(np.concatenate([d.ravel() for d in self.dofs.values()]))
        self.free = np.concatenate([np.setdiff1d(used, np.concatenate(held)), np.arange(count, self.n)])

    def node(self, bar: str, s: float) -> IndexArray:
        """Degrees of freedom (6,) of the node at a break."""
        return np.asarray(self.dofs[bar][2 * int(np.argmin(np.abs(self.ends[bar] - s)))])

    def _join(self, meeting: Meeting) -> None:
        """Let both bars' nodes be one in their common directions."""
        one, other = self.node(meeting.bar, meeting.s), self.node(meeting.other, meeting.t)
        shared = np.array([True, True, True, *np.isinf(meeting.about)])
        for keep, drop in zip(one[shared].tolist(), other[shared].tolist(), strict=True):
            for dofs in self.dofs.values():
                dofs[dofs == drop] = keep

    def rows(self, bar: str, s: float) -> FloatArray:
        """Rows (6, n) that read displacement and rotation at a point."""
        ends = self.ends[bar]
        e = int(np.clip(np.searchsorted(ends, s) - 1, 0, len(ends) - 2))
        weight, _ = shape_functions(2 * (s - ends[e]) / (ends[e + 1] - ends[e]) - 1)
        found = np.zeros((6, self.n))
        for node in range(3):
            found[np.arange(6), self.dofs[bar][2 * e + node]] += weight[node]
        return found

    def _stretch(self, brace: Brace) -> FloatArray:
        (one, s), (other, t) = brace.ends
        along = np.subtract(self.frame.bar(one).point(s), self.frame.bar(other).point(t))
        unit = along / np.linalg.norm(along)
        return np.asarray(unit @ (self.rows(one, s) - self.rows(other, t))[:3])

    def heated(self, bar: Bar, expansion: float) -> dict[str, float]:
        unit, load = {b.name: np.zeros(self.n) for b in self.frame.bars}, np.zeros(self.n)
        for b in self.frame.bars:
            unit[b.name][self.dofs[b.name][[0, -1], b.axis]] = -1, 1
        load += bar.modulus * bar.area * expansion * unit[bar.name]
        k, _ = self._matrices()
        moved = np.zeros(self.n)
        moved[self.free] = spsolve(k, load[self.free])
        strain = {b.name: unit[b.name] @ moved / b.length - expansion * (b is bar) for b in self.frame.bars}
        return {b.name: float(b.modulus * b.area * strain[b.name]) for b in self.frame.bars}

    def _matrices(self) -> tuple[Any, Any]:
        """Stiffness and mass of the free degrees of freedom."""
        stiffness, mass = (sparse.coo_array((v, (i, j)), (self.n, self.n)).tocsc() for v, i, j in self._beams())
        extra_stiffness, extra_mass = self._attached()
        free = np.ix_(self.free, self.free)
        return (stiffness + extra_stiffness)[free], (mass + extra_mass)[free]

    def solved(self, n_modes: int) -> Solved:
        k, m = self._matrices()
        value, vector = eigsh(k, n_modes, m, sigma=0.0, v0=np.ones(len(self.free)))
        order = np.argsort(value)
        shape = np.zeros((self.n, n_modes))
        shape[self.free] = vector[:, order]
        return Solved(np.sqrt(value[order]) / (2 * np.pi), shape, self)

    def _beams(self) -> list[tuple[FloatArray, IndexArray, IndexArray]]:
        found: list[list[Any]] = [[], []]
        rows, columns = [], []
        for bar in self.frame.bars:
            ends = self.ends[bar.name]
            for e, (a, b) in enumerate(pairwise(ends)):
                nodes = self.dofs[bar.name][2 * e : 2 * e + 3]
                axes = [*bar.order, *(3 + i for i in bar.order)]
                dofs = nodes[:, axes].ravel()
                for into, matrix in zip(found, element(bar, a, b), strict=True):
                    into.append(matrix.ravel())
                rows.append(np.repeat(dofs, 18))
                columns.append(np.tile(dofs, 18))
        i, j = np.concatenate(rows), np.concatenate(columns)
        return [(np.concatenate(v), i, j) for v in found]

    def _place(self, ground: int) -> FloatArray:
        g = self.frame.grounds[ground]
        return np.asarray(self.frame.bar(g.bar).point(g.s))

    def _riding(self, ground: int, floor: Floor) -> FloatArray:
        """Motion (6,) of a ground per motion of the floor that carries it."""
        if ground not in floor.grounds:
            return np.zeros(6)
        way = np.eye(3)[floor.axis % 3]
        if floor.axis < 3:
            return np.append(way, np.zeros(3))
        arm = self._place(ground) - np.mean([self._place(g) for g in floor.grounds], axis=0)
        return np.append(np.cross(way, arm), way)

    def _carried(self, ground: int) -> npt.NDArray[np.bool_]:
        """Directions (6,) in which a floor moves a ground."""
        ridden = [self._riding(ground, floor) != 0 for floor in self.frame.floors]
        return np.any(ridden, axis=0) if ridden else np.zeros(6, bool)

    def _grounded(self, unit: FloatArray) -> list[tuple[float, FloatArray]]:
        """Springs of the grounds and of the floors that carry them."""
        found, floors = [], unit[self.n - len(self.frame.floors) :]
        for i, g in enumerate(self.frame.grounds):
            ridden = sum(np.outer(self._riding(i, f), own) for f, own in zip(self.frame.floors, floors, strict=True))
            strain = unit[self.node(g.bar, g.s)] - ridden
            carried = self._carried(i)
            for a, k in enumerate((*g.along, *g.about)):
                if 0 < k < np.inf or carried[a]:
                    found.append((min(k, _STIFF), strain[a]))
        found += [
            (f.mass * (2 * np.pi * f.frequency) ** 2, own) for f, own in zip(self.frame.floors, floors, strict=True)
        ]
        return found

    def _attached(self) -> tuple[Any, Any]:
        """Grounds, meetings, props and lumps."""
        frame, unit = self.frame, np.eye(self.n)
        stiffness = self._grounded(unit)
        for m in frame.meetings:
            one, other = self.node(m.bar, m.s)[3:], self.node(m.other, m.t)[3:]
            stiffness += [(k, unit[a] - unit[b]) for k, a, b in zip(m.about, one, other, strict=True) if k < np.inf]
        stiffness += [(p.stiffness, self.rows(p.bar, p.s)[p.axis]) for p in frame.props]
        stiffness += [(b.stiffness, self._stretch(b)) for b in frame.braces]
        own = self.n - len(frame.floors)
        mass = [(floor.mass, row) for floor, row in zip(frame.floors, unit[own:], strict=True)]
        own -= sum(bool(lump.spring) for lump in frame.lumps)
        for lump in frame.lumps:
            rows = self.rows(lump.bar, lump.s)
            if lump.spring:
                mass.append((lump.mass, unit[own]))
                k = lump.mass * (2 * np.pi * lump.spring) ** 2
                stiffness.append((k, unit[own] - rows[lump.axis]))
                mass += [(lump.mass, rows[i]) for i in range(3) if i != lump.axis]
                own += 1
            else:
                mass += _rigid(lump, rows)
        return _outer(stiffness, self.n), _outer(mass, self.n)


def _rigid(lump: Lump, rows: FloatArray) -> list[tuple[float, FloatArray]]:
    """Return the body's centre's motion, u + theta x offset, and its turning."""
    x, y, z = lump.offset
    turn = rows[3:]
    centre = rows[:3] + np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]]) @ turn
    return [(lump.mass, r) for r in centre] + [(i, r) for i, r in zip(lump.inertia, turn, strict=True) if i]


def _outer(parts: Sequence[tuple[float, FloatArray]], n: int) -> Any:
    if not parts:
        return sparse.csc_array((n, n))
    rows = sparse.csc_array(np.array([r for _, r in parts]))
    return (rows.T @ sparse.diags_array([k for k, _ in parts]) @ rows).tocsc()

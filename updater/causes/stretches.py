"""Stretches of members as alternatives: any middle, any of several lengths; common to what is spread over one."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.cells import Cells
from updater.comparison import Comparison
from updater.posterior import credible, places
from updater.reference import Reference
from updater.verdict import Vector, Where

if TYPE_CHECKING:
    from updater.causes.base import Cause
    from updater.fit import Fit

_MOST_FINE = 240  # alternatives between those of the first grid
_NEAR = 30.0  # of log density under the best: between two of the first grid a posterior may hide
_WORTH = 6  # of the first grid's alternatives that are looked at closer
_OF_EACH = 2  # and of each length


@dataclass(frozen=True, kw_only=True)
class Kinds:
    """Kinds of stretches: lengths that act alike, or directions; as probable as they have lengths."""

    size: dict[int, int]  #: of each kind, the length that is looked at first [cells, even]
    step: dict[int, int]  #: then cells between middles
    about: dict[int, tuple[int, ...]]  #: lengths that it stands for, looked at where the first is likely

    def within(self, count: int) -> dict[int, tuple[int, ...]]:
        """Return the lengths of each kind that fit on `count` cells; all of them where none does."""
        fitting = {kind: tuple(s for s in sizes if s <= count) for kind, sizes in self.about.items()}
        found = {kind: sizes for kind, sizes in fitting.items() if sizes}
        return found or {min(self.size): (count,)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretches:
    """One change spread over a stretch; its first parameter is how strong it is."""

    reference: Reference
    comparison: Comparison
    cells: Cells
    kinds: Kinds
    member: IndexArray  #: (n,) of the structure's members
    begin: IndexArray  #: (n,) first cell
    size: IndexArray  #: (n,) cells
    kind: IndexArray  #: (n,)
    step: FloatArray  #: (n,) cells between middles
    log_prior: FloatArray  #: (n,) every metre of the structure alike
    start: FloatArray  #: (n, n_parameters) where the fit begins
    drifting: bool = True
    place_free: bool = False
    cannot_be_told_from: tuple[str, ...] = ()

    @property
    def middle(self) -> FloatArray:
        """Distance of each stretch's middle from its member's start (n,) [m]."""
        return np.asarray((self.begin + self.size / 2) * self.cells.length[self.member])

    @property
    def extent(self) -> FloatArray:
        """Length of each stretch (n,) [m]."""
        return np.asarray(self.size * self.cells.length[self.member])

    def carried(self, theta: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return parameters (n, n_parameters) that do about the same over stretches `ratio` (n,) times as long."""
        del ratio
        return theta

    def finer(self, log_density: FloatArray, theta: FloatArray) -> Self:
        """Return stretches about the likely ones: middles closer together, lengths between."""
        order = np.argsort(-log_density)
        of_each = [order[self.kind[order] == kind][:_OF_EACH] for kind in self.kinds.size]
        near = np.unique(np.concatenate([order[:_WORTH], *of_each]))
        near = near[log_density[near] > log_density.max() - _NEAR]
        for halvings in (3, 2, 1):
            found = self._about(near, halvings)
            if len(found) <= _MOST_FINE:
                break
        rows = np.array(sorted(found), float)
        source = np.array([found[key] for key in sorted(found)], np.intp)
        start = self.carried(theta[source], np.maximum(rows[:, 2], 1) / np.maximum(self.size[source], 1))
        return replace(self, **(_fields(self.cells, self.kinds, rows, first=False) | {"start": start}))

    def _about(self, near: IndexArray, halvings: int) -> dict[tuple[int, int, int, int, int], int]:
        """Return finer alternatives (member, begin, size, kind, step), and which each one came from."""
        found: dict[tuple[int, int, int, int, int], int] = {}
        for row in near.tolist():
            member, kind = int(self.member[row]), int(self.kind[row])
            reach, count = self.kinds.step[kind], int(self.cells.count[member])
            for size in self.kinds.within(count)[kind]:
                step = max(1, reach // 2**halvings, size // 16)
                middle = step * round((self.begin[row] + self.size[row] / 2) / step)
                for off in range(-step * (reach // step), reach + 1, step):
                    begin = min(max(middle + off - size // 2, 0), count - size)
                    found.setdefault((member, begin, size, kind, step), row)
        return found

    def where(self, fit: "Fit[Cause]") -> Where:
        """Return mean of the most probable place, and the region of all middles."""
        member, position, probability, _ = self._spread(fit)
        share = self.likely(fit)
        distance = float(share @ self.middle)
        width = self.step * self.cells.length[self.member]
        variance = share @ ((self.middle - distance) ** 2 + width**2 / 12)
        members = self.reference.calibration.structure.member
        found, half = int(self.member[np.argmax(share)]), self.cells.length / 2
        return Where(
            member=members[found].name,
            position=vector(members[found].point(distance)),
            position_std=float(np.sqrt(variance)),
            region=tuple(
                (vector(members[m].point(a - half[m])), vector(members[m].point(b + half[m])))
                for m, a, b in credible(member, position, probability, probability)
            ),
        )

    def likely(self, fit: "Fit[Any]") -> FloatArray:
        """Return the probability of each alternative (n,), given that it lies in the most probable place."""
        member, position, probability, cell_of = self._spread(fit)
        place = places(member, position, probability, probability)[0]
        inside = np.where(place.share[cell_of] > 0, fit.probability, 0.0)
        return np.asarray(inside / inside.sum())

    def averaged(self, fit: "Fit[Any]", value: FloatArray, std: FloatArray) -> tuple[float, float]:
        """Return mean and standard deviation over the most probable place of what alternatives say (n,), (n,)."""
        share = self.likely(fit)
        mean = float(share @ value)
        return mean, float(np.sqrt(share @ (std**2 + (value - mean) ** 2)))

    def _spread(self, fit: "Fit[Any]") -> tuple[IndexArray, FloatArray, FloatArray, IndexArray]:
        """Return member, middle [m] and probability of every cell, and the cell of each alternative's middle.

        An alternative stands for all middles up to half way to the next.
        """
        member = np.repeat(np.arange(len(self.cells.count)), self.cells.count)
        before = np.concatenate([[0], np.cumsum(self.cells.count)])
        position = (np.arange(len(member)) - before[member] + 0.5) * self.cells.length[member]
        middle, last = self.begin + self.size / 2, self.cells.count[self.member]
        low = np.clip(np.round(middle - self.step / 2), 0, last - 1).astype(np.intp)
        high = np.clip(np.round(middle + self.step / 2), low + 1, last).astype(np.intp)
        edge = np.zeros(len(member) + 1)
        np.add.at(edge, before[self.member] + low, fit.probability / (high - low))
        np.add.at(edge, before[self.member] + high, -fit.probability / (high - low))
        probability = np.maximum(np.cumsum(edge)[:-1], 0.0)
        cell_of = before[self.member] + np.clip(middle.astype(np.intp), low, high - 1)
        return member, position, probability / probability.sum(), cell_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Spread(Stretches):
    """What is summed over a stretch."""

    summed: FloatArray  #: (n_edges, n_modes, n_modes) from each member's start

    def matrix(self, rows: IndexArray) -> FloatArray:
        """Return the modal matrices (n, n_modes, n_modes) of alternatives."""
        member, begin = self.member[rows], self.begin[rows]
        end = self.cells.edge(member, begin + self.size[rows])
        return np.asarray(self.summed[end] - self.summed[self.cells.edge(member, begin)])


def strength(comparison: Comparison, effect: FloatArray) -> FloatArray:
    """Return how strong (n,) changes of log frequencies (n, n_compared) are in the data, each by itself."""
    whitener = comparison.drifting.matrix
    white = effect @ whitener.T
    return np.asarray(white @ (whitener @ comparison.log_ratio) / np.maximum((white**2).sum(1), 1e-12))


def everywhere(cells: Cells, kinds: Kinds) -> dict[str, Any]:
    """Return the first grid's alternatives, as fields of `Stretches`."""
    rows = []
    for member, count in enumerate(cells.count.tolist()):
        for kind in kinds.within(count):
            size = min(kinds.size[kind], count)
            n = -(-(count - size) // kinds.step[kind]) + 1
            begins = np.linspace(0, count - size, n)
            rows += [(member, int(begin), size, kind, (count - size) / max(n - 1, 1)) for begin in begins]
    return _fields(cells, kinds, np.array(rows, float), first=True)


def _fields(cells: Cells, kinds: Kinds, rows: FloatArray, *, first: bool) -> dict[str, Any]:
    """Return alternatives as fields of `Stretches`.

    Parameters
    ----------
    rows : (n, 5) member, first cell, cells, kind, cells between middles
    first : whether each stands for all lengths of its kind
    """
    member, begin, size, kind = rows[:, :4].T.astype(np.intp)
    within = [kinds.within(int(count)) for count in cells.count]
    share = np.array([len(within[m][k]) if first else 1 for m, k in zip(member, kind, strict=True)])
    share = share / np.array([sum(len(sizes) for sizes in about.values()) for about in within])[member]
    length = cells.length * cells.count
    step = np.maximum(rows[:, 4], 1.0)
    weight = length[member] / length.sum() * share * step / (cells.count[member] - size + step)
    return {
        "member": member,
        "begin": begin,
        "size": size,
        "kind": kind,
        "step": step,
        "log_prior": np.log(weight),
        "start": np.zeros((len(rows), 1)),
    }


def vector(values: FloatArray) -> Vector:
    """Return three plain numbers."""
    x, y, z = (float(v) for v in values)
    return x, y, z

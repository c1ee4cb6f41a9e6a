"""Stretches of members as alternatives: any middle, any of several lengths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.causes.member_grid import Cells, weighed
from updater.inference import Comparison, Fit, PositionPosterior
from updater.quantities import Vector, Where, vector
from updater.reference import Reference
from updater.structure import Structure

S = TypeVar("S", bound="Stretches")
_MAX_MEMBERS = 2000  # largest number of members for which stretches are considered
RATIO = 1.2  #: about, from one length to the next
WITHIN = 12**-0.5  #: standard deviation of a uniform prior over one step
_MAX = 600  # alternatives that are all fitted; of more, on a structure of many members, the most likely are
_KEPT = 240  # of those
_MAX_FINE = 240  # alternatives between those of the first grid
_NEAR = 30.0  # of log density under the best: between two of the first grid a posterior may hide
_WORTH = 6  # of the first grid's alternatives that are looked at closer
_OF_EACH = 2  # and of each length
_LENGTH = 2  # number of the parameter of a length, of causes that have one
_NEXT_LENGTHS = 2 * float(np.log(RATIO))  # of a logarithm: lengths of another kind that are looked at too
_OPEN = 10.0  # log density below the best: other possible places
_OF_ALTERNATIVES = ("member", "begin", "size", "kind", "step", "span", "log_prior", "start")
_MAX_OTHERS = 120  # of the likeliest that are looked at for that


@dataclass(frozen=True, kw_only=True)
class Kinds:
    """Kinds of stretches: lengths that act alike, or directions; as probable as they have lengths."""

    size: dict[int, int]  #: first length of each kind [cells, even]
    step: dict[int, int]  #: then cells between middles
    about: dict[int, tuple[int, ...]]  #: lengths represented by it, evaluated if the first is probable
    whole: bool = False  #: whether all of a member is a length, if it is not much longer than the longest that fits

    def span(self, kind: int) -> float:
        """Return the range of the logarithm of lengths that a kind represents."""
        sizes = self.about[kind]
        return float(np.log(RATIO * max(max(sizes), 1) / max(min(sizes), 1)))

    def within(self, count: int) -> dict[int, tuple[int, ...]]:
        """Return the lengths of each kind that fit on `count` cells; all of them where none does."""
        fitting = {kind: tuple(s for s in sizes if s <= count) for kind, sizes in self.about.items()}
        found = {kind: sizes for kind, sizes in fitting.items() if sizes}
        if not found:
            return {min(self.size): (count,)}
        kind = max(found, key=lambda k: found[k][-1])
        longest = found[kind][-1]
        near = self.whole and longest < count <= RATIO * longest
        return found | {kind: (*found[kind], count)} if near else found


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretches:
    """One change at a stretch; parameters are how strong it is, and where about the alternative's middle and length.

    The second is the middle's shift over the step between middles; the third, where lengths differ, the length's
    logarithm over the step between those: both spread as a uniform prior over one step.
    """

    reference: Reference
    comparison: Comparison
    cells: Cells
    kinds: Kinds
    member: IndexArray  #: (n,) of the structure's members
    begin: IndexArray  #: (n,) first cell
    size: IndexArray  #: (n,) cells
    kind: IndexArray  #: (n,)
    step: FloatArray  #: (n,) cells between middles
    span: FloatArray  #: (n,) between lengths, of their logarithm
    log_prior: FloatArray  #: (n,) every metre of the structure alike
    start: FloatArray  #: (n, n_parameters) where the fit begins
    drifting: bool = True
    place_free: bool = False
    cannot_be_told_from: tuple[str, ...] = ()

    @property
    def neutral_start(self) -> FloatArray:
        """Start of a fit in addition to other causes: the first grid of stretches, without effect."""
        return np.zeros(self.start.shape)

    def middles(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the middles (len(rows),) [cells] for parameters (len(rows), n_parameters)."""
        middle = self.begin[rows] + self.size[rows] / 2 + theta[:, 1] * self.step[rows]
        half = self._least(rows) / 2
        return np.clip(middle, half, self.cells.count[self.member[rows]] - half)

    def sizes(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the lengths (len(rows),) [cells]; both ends are on the member."""
        middle = self.middles(theta, rows)
        room = 2 * np.minimum(middle, self.cells.count[self.member[rows]] - middle)
        return np.clip(self.size[rows] * np.exp(theta[:, 2] * self.span[rows]), self._least(rows), room)

    def _least(self, rows: IndexArray) -> FloatArray:
        """Return the smallest lengths (len(rows),) [cells]: a shorter one is another cause."""
        return np.minimum(self.size[rows], min(min(sizes) for sizes in self.kinds.about.values())).astype(float)

    def _distances(self, fit: Fit[Any]) -> tuple[FloatArray, FloatArray]:
        """Return distance of each alternative's middle from its member's start (n,) and its deviation [m]."""
        cell = self.cells.length[self.member]
        std = np.sqrt(fit.covariance[:, 1, 1]) * self.step
        return self.middles(fit.theta, np.arange(len(cell))) * cell, std * cell

    def extents(self, fit: Fit[Any]) -> tuple[FloatArray, FloatArray]:
        """Return length of each alternative (n,) and its deviation [m]."""
        extent = self.sizes(fit.theta, np.arange(len(self.member))) * self.cells.length[self.member]
        return extent, extent * self.span * np.sqrt(fit.covariance[:, 2, 2])

    def joined(self, others: Sequence[Self]) -> Self:
        """Return the alternatives of several causes of this kind, one after the other, these left out."""
        every: dict[str, Any] = {n: np.concatenate([getattr(one, n) for one in others]) for n in _OF_ALTERNATIVES}
        return replace(self, **every)

    def along_most(self, fit: Fit[Any]) -> bool:
        """Return whether the best alternative is longer than half of its member."""
        row = np.array([fit.best])
        return bool(self.sizes(fit.theta[row], row)[0] > self.cells.count[self.member[fit.best]] / 2)

    def stretch(self, row: int, theta: FloatArray) -> tuple[str, Vector, float]:
        """Return member, middle and length [m] of an alternative with parameters (n_parameters,)."""
        this, member = np.array([row]), self.cells.members[self.member[row]]
        cell = float(self.cells.length[self.member[row]])
        middle, size = (float(of(theta[None], this)[0]) for of in (self.middles, self.sizes))
        return member.name, vector(member.point(middle * cell)), size * cell

    def over(self, row: int, theta: FloatArray, start: float, stop: float) -> Self:
        """Return one alternative from start to stop [m] of the member of alternative `row`, as strong as by theta."""
        member = int(self.member[row])
        count, length = int(self.cells.count[member]), float(self.cells.length[member])
        begin, end = max(round(start / length), 0), min(round(stop / length), count)
        kind = int(self.kind[row])
        rows = np.array([[member, begin, end - begin, kind, float(self.kinds.step[kind])]], float)
        own = theta[None].copy()
        own[0, 1:3] = 0.0
        return replace(self, **_fields(self.cells, self.kinds, rows, first=False) | {"start": own})

    def carried(self, theta: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return parameters (n, n_parameters) that do about the same over stretches `ratio` (n,) times as long."""
        del ratio
        return theta

    def refined(self, log_density: FloatArray, theta: FloatArray) -> Self:
        """Return stretches about the likely ones: middles closer together, lengths between; others may be as likely.

        If the data hardly determine a place, many remain. They are kept, because a place that is left out counts as
        excluded.
        """
        order = np.argsort(-log_density)
        of_each = [order[self.kind[order] == kind][:_OF_EACH] for kind in self.kinds.size]
        near = np.unique(np.concatenate([order[:_WORTH], *of_each]))
        near = order[np.isin(order, near) & (log_density[order] > log_density.max() - _NEAR)]
        every = np.arange(len(theta))
        middle = self.middles(theta, every)
        fitted = self.sizes(theta, every) if theta.shape[1] > _LENGTH else self.size.astype(float)
        for parts in (4, 3, 2):
            found = self._about(near, middle, fitted, parts)
            if len(found) <= _MAX_FINE:
                break
        rows = np.array(sorted(found), float)
        source = np.array([found[key] for key in sorted(found)], np.intp)
        start = self._starts(rows, theta[source], middle[source], fitted[source])
        others = np.setdiff1d(order[:_MAX_OTHERS], near)
        others = others[log_density[others] > log_density.max() - _OPEN]
        fields = _fields(self.cells, self.kinds, rows, first=False) | {"start": start}
        both: dict[str, Any] = {
            name: np.concatenate([found, getattr(self, name)[others]]) for name, found in fields.items()
        }
        return replace(self, **both | {"start": np.concatenate([start, theta[others]])})

    def _starts(self, rows: FloatArray, theta: FloatArray, middle: FloatArray, fitted: FloatArray) -> FloatArray:
        """Return where the fits of finer alternatives begin (n, n_parameters).

        Those nearest to the fitted values of the coarser ones start there, so that these are kept. All others start at
        their own lengths, with a strength of the same total effect, and farther ones at their own middles.

        Parameters
        ----------
        rows : (n, 5) of the finer alternatives, see `_about`
        theta, middle, fitted : (n, ...) parameters, fitted middle and length of the coarser ones
        """
        start = self.carried(theta, np.maximum(rows[:, 2], 1) / np.maximum(fitted, 1))
        shift = (middle - rows[:, 1] - rows[:, 2] / 2) / rows[:, 4]
        longer = np.log(np.maximum(fitted, 1) / np.maximum(rows[:, 2], 1)) / np.log(RATIO)
        near = np.abs(shift) <= 1
        there = near & (np.abs(longer) <= 1)
        start[there] = theta[there]
        start[:, 1] = np.where(near, shift, 0.0)
        if theta.shape[1] > _LENGTH:
            start[:, _LENGTH] = np.where(there, longer, 0.0)
        return start

    def _about(
        self, near: IndexArray, middle: FloatArray, fitted: FloatArray, parts: int
    ) -> dict[tuple[int, int, int, int, int], int]:
        """Return finer alternatives (member, begin, size, kind, step), and which each one came from.

        Parameters
        ----------
        near : (n_near,) alternatives
        middle, fitted : (n,) middles and lengths to which all alternatives were fitted [cells]
        parts : into which a step is divided
        """
        found: dict[tuple[int, int, int, int, int], int] = {}
        for row in near.tolist():
            member = int(self.member[row])
            count = int(self.cells.count[member])
            for size, kind in self._lengths(count, int(self.kind[row]), float(fitted[row])).items():
                step = max(2, self.kinds.step[kind] // parts)
                about = step * round(middle[row] / step)
                for off in range(-step * (parts // 2), step * (parts // 2) + 1, step):
                    begin = min(max(about + off - size // 2, 0), count - size)
                    found.setdefault((member, begin, size, kind, step), row)
        return found

    def _lengths(self, count: int, kind: int, fitted: float) -> dict[int, int]:
        """Return the lengths of a kind, and those of other kinds next to the fitted one.

        A fit may come to a length between two kinds.
        """
        within = self.kinds.within(count)
        found = dict.fromkeys(within[kind], kind)
        for other, sizes in within.items():
            for size in sizes:
                if size and abs(np.log(size / fitted)) < _NEXT_LENGTHS:
                    found.setdefault(size, other)
        return found

    def where(self, fit: Fit[Cause]) -> Where:
        """Return mean of the most probable place, and the region of all stretches."""
        share = self.likely(fit)
        distance, std = self._distances(fit)
        mean = float(share @ distance)
        members = self.cells.members
        found = int(self.member[np.argmax(share)])
        return Where(
            member=members[found].name,
            position=vector(members[found].point(mean)),
            position_std=float(np.sqrt(share @ (std**2 + (distance - mean) ** 2))),
            region=self._posterior(fit)[0].region(self.cells.length / 2),
        )

    def likely(self, fit: Fit[Any]) -> FloatArray:
        """Return the probability of each alternative (n,), given that it lies in the most probable place."""
        inside = self.by_place(fit)[0]
        return np.asarray(inside / inside.sum())

    def deviations(self, fit: Fit[Any]) -> float:
        """Return by how many standard deviations the strength of the best alternative differs from zero.

        With place and length held: a loss is known badly where its length is, for it is their product that data show,
        and both mean nothing where there is no loss.
        """
        precision = np.linalg.inv(fit.covariance[fit.best])[0, 0]
        return float(abs(fit.theta[fit.best, 0]) * np.sqrt(precision))

    def relative_std(self, fit: Fit[Any]) -> float:
        """Return the relative standard deviation of the strength of the best alternative, likewise [-]."""
        return 1 / self.deviations(fit)

    def points(self, fit: Fit[Any]) -> FloatArray:
        """Return the middle of each alternative (n, 3) [m]."""
        return self.places(fit.theta, np.arange(len(self.member)))

    def places(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the middle (len(rows), 3) [m] for parameters (len(rows), n_parameters)."""
        member = self.member[rows]
        distance = (self.middles(theta, rows) * self.cells.length[member]).tolist()
        return np.array([self.cells.members[m].point(s) for m, s in zip(member.tolist(), distance, strict=True)])

    def by_place(self, fit: Fit[Any]) -> list[FloatArray]:
        """Return the probability of each alternative (n,) at each place left open, the most probable place first."""
        posterior, cell_of = self._posterior(fit)
        every = (np.where(place.share[cell_of] > 0, fit.probability, 0.0) for place in posterior.places)
        return [inside for inside in every if inside.any()]  # a place may be the end of stretches with other middles

    def averaged(self, fit: Fit[Any], value: FloatArray, std: FloatArray) -> tuple[float, float]:
        """Return mean and standard deviation of values (n,), (n,) over the most probable place."""
        share = self.likely(fit)
        mean = float(share @ value)
        return mean, float(np.sqrt(share @ (std**2 + (value - mean) ** 2)))

    def _posterior(self, fit: Fit[Any]) -> tuple[PositionPosterior, IndexArray]:
        """Return the posterior of middles over all cells, and the cell of each alternative's middle.

        The middle of an alternative is distributed uniformly with its deviation.
        """
        member = np.repeat(np.arange(len(self.cells.count)), self.cells.count)
        before = np.concatenate([[0], np.cumsum(self.cells.count)])
        position = (np.arange(len(member)) - before[member] + 0.5) * self.cells.length[member]
        last = self.cells.count[self.member]
        middle, std = (values / self.cells.length[self.member] for values in self._distances(fit))
        low = np.clip(np.round(middle - np.sqrt(3) * std), 0, last - 1).astype(np.intp)
        high = np.clip(np.round(middle + np.sqrt(3) * std), low + 1, last).astype(np.intp)
        edge = np.zeros(len(member) + 1)
        np.add.at(edge, before[self.member] + low, fit.probability / (high - low))
        np.add.at(edge, before[self.member] + high, -fit.probability / (high - low))
        probability = np.maximum(np.cumsum(edge)[:-1], 0.0)
        cell_of = before[self.member] + np.clip(middle.astype(np.intp), low, high - 1)
        posterior = PositionPosterior(
            members=self.cells.members,
            member=member,
            position=position,
            probability=probability / probability.sum(),
            length=np.ones(len(member)),
        )
        return posterior, cell_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Spread(Stretches):
    """Effect that is summed over a stretch."""

    def matrix(self, summed: FloatArray, share: FloatArray, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the modal matrices (len(rows), n_modes, n_modes) of stretches.

        Parameters
        ----------
        summed : (n_tables, n_edges, n_modes, n_modes) along each member
        share : (len(rows), n_tables) by which tables count
        theta, rows : (len(rows), n_parameters) and (len(rows),) of the alternatives
        """
        middle, half = self.middles(theta, rows), self.sizes(theta, rows) / 2
        (end, of_end), (begin, of_begin) = (
            self.cells.about(self.member[rows], at) for at in (middle + half, middle - half)
        )
        edges, weight = np.concatenate([end, begin], axis=1), np.concatenate([of_end, -of_begin], axis=1)
        first = summed.shape[1] * np.arange(len(summed))[:, None]
        return weighed(
            summed.reshape(-1, *summed.shape[2:]),
            (first + edges[:, None]).reshape(len(rows), -1),
            (share[:, :, None] * weight[:, None]).reshape(len(rows), -1),
        )


def may_be_cut(structure: Structure) -> bool:
    """Return whether stretches of a structure are considered: not with very many members, or external matrices."""
    return structure.external is None and len(structure.member) <= _MAX_MEMBERS


def begun(cause: S, first: tuple[FloatArray, FloatArray]) -> S:
    """Return a cause that starts as strong as it is to first order; of very many alternatives the most likely.

    These are as probable as they were.

    Parameters
    ----------
    first : strength (n,), and explained part (n,); written into `cause.start`
    """
    cause.start[:, 0], explained = first
    if len(explained) <= _MAX:
        return cause
    rows = np.sort(np.argpartition(-explained, _KEPT)[:_KEPT])
    return replace(cause, **{name: getattr(cause, name)[rows] for name in _OF_ALTERNATIVES})


def everywhere(cells: Cells, kinds: Kinds, n_parameters: int) -> dict[str, Any]:
    """Return the first grid's alternatives, as fields of `Stretches`."""
    rows = []
    for member, count in enumerate(cells.count.tolist()):
        for kind in kinds.within(count):
            size = min(kinds.size[kind], count)
            n = -(-(count - size) // kinds.step[kind]) + 1
            begins = np.linspace(0, count - size, n)
            rows += [(member, int(begin), size, kind, (count - size) / max(n - 1, 1)) for begin in begins]
    found = _fields(cells, kinds, np.array(rows, float), first=True)
    return found | {"start": np.zeros((len(rows), n_parameters))}


def _fields(cells: Cells, kinds: Kinds, rows: FloatArray, *, first: bool) -> dict[str, Any]:
    """Return alternatives as fields of `Stretches`.

    Parameters
    ----------
    rows : (n, 5) member, first cell, cells, kind, cells between middles
    first : whether each represents all lengths of its kind
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
        "span": np.array([kinds.span(k) if first else np.log(RATIO) for k in kind]),
        "log_prior": np.log(weight),
    }

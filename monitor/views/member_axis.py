"""Members laid end to end on one axis, for curves along them."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from daq import FloatArray, IndexArray
from monitor.results.windows import MassAnswer, ProfilePoint, ReferenceResult
from updater.quantities import Vector

_GAP = 0.06  # of all members' length, between two members
_SMALLEST = 1e-300
_TICK_STEPS = np.array([1.0, 2.0, 2.5, 5.0, 10.0])


def has_profile(answer: MassAnswer) -> bool:
    """Return whether there is a posterior to draw: at two places of one member at least."""
    return len({(p.member, p.position) for p in answer.profile}) > len({p.member for p in answer.profile})


def places(answer: MassAnswer) -> Iterator[tuple[str, Vector]]:
    """Yield member and position of the profile's points."""
    return ((p.member, p.position) for p in answer.profile)


def axis_of(answer: MassAnswer, reference: ReferenceResult | None) -> "Unrolled":
    """Return the axis of the members of a profile, each from its start to its end where its geometry is known."""
    if reference is None or not reference.has_model:
        return Unrolled(places(answer))
    members = dict.fromkeys(p.member for p in answer.profile)
    return Unrolled((member, reference.nodes[n]) for member in members for n in reference.lines[member])


def sigmas(points: list[ProfilePoint]) -> FloatArray:
    """Return sqrt(-2 ln(density / largest)) at each point (n,): for a Gaussian posterior the distance in its sigmas.

    A density that is too small to be a number is as far away as the smallest number.
    """
    density = np.array([p.density for p in points], float)
    share = density / max(density.max(), _SMALLEST)
    return np.asarray(np.sqrt(-2 * np.log(np.maximum(share, _SMALLEST))))


class Unrolled:
    """The members laid one after another on a line.

    Parameters
    ----------
    places : member and position [m] of each point, in order along each member
    """

    def __init__(self, places: Iterable[tuple[str, Vector]]) -> None:
        self.start: dict[str, FloatArray] = {}
        self.length: dict[str, float] = {}
        for member, position in places:
            place = np.array(position)
            start = self.start.setdefault(member, place)
            self.length[member] = float(np.linalg.norm(place - start))
        gap = _GAP * sum(self.length.values())
        steps = [length + gap for length in self.length.values()]
        self.offset = dict(zip(self.length, np.concatenate([[0.0], np.cumsum(steps)[:-1]]).tolist(), strict=True))
        self.total = float(sum(steps) - gap)

    def along(self, member: str, position: FloatArray) -> FloatArray:
        """Return where positions (..., 3) on a member are on the line (...) [m]."""
        return np.asarray(self.offset[member] + np.linalg.norm(position - self.start[member], axis=-1))

    def names(self, character: float, most: int) -> list[tuple[str, float, int]]:
        """Return members, their middles on the line [m] and the rows of their names, so that names do not overlap.

        Names without room are left out.

        Parameters
        ----------
        character : width of a character on the line [m]
        most : number of rows
        """
        middle = np.array([self.offset[member] + length / 2 for member, length in self.length.items()])
        rows = label_rows(middle, list(self.length), character, most)
        named = zip(self.length, middle.tolist(), rows.tolist(), strict=True)
        return [(member, place, row) for member, place, row in named if row >= 0]

    def ticks(self) -> Iterator[tuple[float, str]]:
        """Return places on the line and the distance from the member's start there."""
        step = self.total / 10
        for member, length in self.length.items():
            for value in ticks(0.0, length, max(2, int(length / step))) if length else [0.0]:
                yield self.offset[member] + float(value), f"{value:g}"


def ticks(low: float, high: float, most: int) -> FloatArray:
    """Return round values between two limits, at most `most` of them."""
    rough = (high - low) / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * _TICK_STEPS[np.searchsorted(_TICK_STEPS, rough / power - 1e-9)]
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return np.asarray(np.arange(first, last + 1) * step + 0.0)  # no negative zero


def label_rows(middle: FloatArray, labels: Sequence[str], character: float, most: int) -> IndexArray:
    """Return the row (n,) of each label, the first with room; -1 where none has.

    Parameters
    ----------
    middle : (n,) places of the labels, ascending
    labels : (n,) texts
    character : width of a character; a label has one more than its text
    most : number of rows
    """
    half = 0.5 * character * np.array([len(label) + 1 for label in labels])
    end = np.full(most, -np.inf)
    rows = np.full(len(middle), -1)
    for i, (start, stop) in enumerate(zip(middle - half, middle + half, strict=True)):
        free = np.flatnonzero(end <= start)
        if len(free):
            rows[i] = free[0]
            end[free[0]] = stop
    return rows


def side_by_side(places: FloatArray, apart: float, end: float) -> FloatArray:
    """Return ascending places (n,) moved so that neighbours are `apart`, none over `end`.

    Parameters
    ----------
    places : ascending
    apart : least distance between neighbours
    end : of the axis; moved if there are more places than fit
    """
    moved = places.copy()
    for i in range(1, len(moved)):
        moved[i] = max(moved[i], moved[i - 1] + apart)
    if len(moved):
        moved[-1] = max(min(moved[-1], end), places[0] + apart * (len(moved) - 1))
    for i in range(len(moved) - 2, -1, -1):
        moved[i] = min(moved[i], moved[i + 1] - apart)
    return moved

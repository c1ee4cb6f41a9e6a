"""From groups of poles to modes with standard deviations, and from candidates to modes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from oma.mac import mac_matrix, normalise
from oma.preparation import BoolArray
from oma.selection.pole_uncertainty import PoleInfluence, block_std
from oma.selection.selection import BAND, MIN_MEMBERS, Selection, groups, uncertainty_law
from oma.types import ComplexArray, ModalEstimate, Stabilization

_CHANCE = 2.0  # standard deviations that may lie between two groups of one mode


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """One group of stable poles, summed up."""

    frequency: float  #: [Hz]
    frequency_std: float  #: [Hz]
    damping: float  #: [-]
    damping_std: float  #: [-]
    shape: ComplexArray  #: (n_channels,)
    shape_std: FloatArray  #: (n_channels,)
    support: float  #: [-]
    law_ratio: float  #: [-]
    frequency_moves: FloatArray  #: (n_blocks,) influence of each block of time on the frequency [Hz]


@dataclass(frozen=True, eq=False)
class _Group:
    """Group of stable poles, one per order, and their changes by each block of time."""

    members: Stabilization
    influences: list[PoleInfluence]

    def above(self, order: int) -> "_Group":
        """Return those of this order and above; all where these are too few."""
        chosen = np.flatnonzero(self.members.order >= order)
        if len(chosen) < MIN_MEMBERS or len(chosen) == len(self.members):
            return self
        return _Group(self.members[chosen], [self.influences[i] for i in chosen.tolist()])


def candidates(
    poles: Stabilization,
    n_orders: int,
    influence: Callable[[int, int], PoleInfluence],
    duration: float,
    selection: Selection,
    *,
    poles_a_mode: int = 0,
    n_beside: int = 0,
) -> list[Mode]:
    """Sum up every group of stable poles.

    All orders decide which poles are modes. Only orders with enough poles give their values: a model with fewer places
    them between modes. Of ten modes in orders 2 to 50, the highest had an error of 5 standard deviations of 300 s.

    Parameters
    ----------
    poles : Stabilization
    n_orders : int
        Model orders that were tried.
    influence : function
        Change of a pole, given by its order and column, by each block of time.
    duration : float
        Of the samples that entered [s].
    selection : Selection
    poles_a_mode : int
        Fewest poles per mode of a model whose poles are used to select modes [-].
    n_beside : int
        Modes of the models below the band, in addition to those that are sought [-].

    Returns
    -------
    list of Mode
    """
    stable = poles[poles.stable]
    found = [
        _group(stable[members], influence)
        for members in groups(stable.frequency, stable.shape, stable.order, selection.cut)
        if len(members) >= MIN_MEMBERS
    ]
    modes = [_mode(group, n_orders, duration, selection) for group in found]
    lowest = poles_a_mode * (n_beside + len(physical(modes, selection)))
    enough = [group.above(lowest) for group in found]
    return [
        of_all
        if group is some
        else replace(_mode(some, n_orders, duration, selection), support=of_all.support, law_ratio=of_all.law_ratio)
        for group, some, of_all in zip(found, enough, modes, strict=True)
    ]


def _group(members: Stabilization, influence: Callable[[int, int], PoleInfluence]) -> _Group:
    away = np.abs(members.frequency - np.median(members.frequency))
    best = {members.order[i]: i for i in np.argsort(-away, kind="stable")}
    members = members[np.array([best[o] for o in sorted(best)])]
    return _Group(members, [influence(int(o), int(c)) for o, c in zip(members.order, members.column, strict=True)])


def _mode(group: _Group, n_orders: int, duration: float, selection: Selection) -> Mode:
    """Sum up a group: mean over the orders (median of shapes), and the scatter of the blocks' influences on it.

    The scatter of few blocks is itself uncertain; no standard deviation is claimed that lies under the law's. A tone
    has no law: it counts as a resonance of the least damping that a mode may have.
    """
    members, influences = group.members, group.influences
    weight = _weights(influences)
    turned = weight * np.sign(np.real(members.shape @ members.shape[-1].conj()))
    frequency, damping = float(weight @ members.frequency), float(weight @ members.damping)
    frequency_moves = weight @ np.stack([i.frequency for i in influences])
    frequency_std = float(block_std(frequency_moves))
    damping_std = float(block_std(weight @ np.stack([i.damping for i in influences])))
    shape_move = np.tensordot(turned, np.stack([i.shape for i in influences]), axes=1)
    floor = uncertainty_law(frequency, max(damping, selection.min_damping), duration)
    return Mode(
        frequency=frequency,
        frequency_std=max(frequency_std, floor[0]),
        damping=damping,
        damping_std=max(damping_std, floor[1]),
        shape=_median_shape(members.shape, weight),
        shape_std=block_std(shape_move.real),
        support=len(members) / n_orders,
        law_ratio=frequency_std / floor[0],
        frequency_moves=frequency_moves,
    )


def _median_shape(shapes: ComplexArray, weight: FloatArray) -> ComplexArray:
    """Return the weighted median over the orders, of real and imaginary parts of each component by themselves.

    Few orders, mostly the lowest, have shapes far off: they made means err by 1.2 times the scatter of the blocks.
    """
    turned = shapes * np.sign(np.real(shapes @ shapes[-1].conj()))[:, None]
    return normalise(_weighted_median(turned.real, weight) + 1j * _weighted_median(turned.imag, weight))


def _weighted_median(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the median of each column (n_values, n_columns), linear between the middles of the values' shares."""
    rank = np.argsort(values, axis=0)
    ranked, share = np.take_along_axis(values, rank, axis=0), np.cumsum(weight[rank], axis=0) - weight[rank] / 2
    after = np.clip(np.count_nonzero(share < 0.5, axis=0), 1, len(values) - 1)[None]
    before = after - 1
    begin, end = (np.take_along_axis(share, place, axis=0) for place in (before, after))
    low, high = (np.take_along_axis(ranked, place, axis=0) for place in (before, after))
    return np.asarray((low + (high - low) * np.clip((0.5 - begin) / (end - begin), 0, 1))[0])


def _weights(influences: list[PoleInfluence]) -> FloatArray:
    """Weigh the orders by the variance of their poles."""
    variance = np.array([np.sum(i.frequency**2) for i in influences])
    result: FloatArray = 1 / variance / np.sum(1 / variance)
    return result


def physical(modes: Sequence[Mode], selection: Selection) -> list[Mode]:
    """Keep groups whose scatter is compatible with a resonance; the limit is stricter if fewer orders have them."""
    return [mode for mode in modes if mode.law_ratio < selection.max_law_ratio * mode.support]


def repeats_of_tones(estimate: ModalEstimate, tone: BoolArray, selection: Selection) -> BoolArray:
    """Return true (n_modes,) for modes that duplicate a tone: they are as sharp as the tone in their band.

    A scatter below the uncertainty law alone does not indicate a tone: modes excited by gusts and impacts scatter less
    than the law.

    Parameters
    ----------
    estimate : (n_modes,)
    tone : (n_modes,) true for the tones among them
    selection : limits
    """
    away = np.abs(estimate.frequency[:, None] - estimate.frequency[tone])
    beside = np.any(away < BAND * (estimate.damping * estimate.frequency)[:, None], axis=1)
    return np.asarray(~tone & beside & (estimate.law_ratio < selection.min_law_ratio))


def distinct(modes: Sequence[Mode], selection: Selection) -> list[Mode]:
    """Keep the more certain one of two modes that are the same; in order of frequency."""
    kept: list[Mode] = []
    for mode in sorted(modes, key=lambda m: m.frequency_std):
        if not any(_same(mode, other, selection) for other in kept):
            kept.append(mode)
    return sorted(kept, key=lambda m: m.frequency)


def _same(a: Mode, b: Mode, selection: Selection) -> bool:
    """Return whether two modes are one at two rates, or one whose shape forms two groups over the orders.

    The latter are as near as their scatter permits, roughly alike, and no order can show both.
    """
    away, agreement = abs(a.frequency - b.frequency), mac_matrix(a.shape[None], b.shape[None])[0, 0]
    if away < selection.max_shift * a.frequency and 1 - agreement < selection.max_mac_loss:
        return True
    return bool(
        away < _CHANCE * np.hypot(a.frequency_std, b.frequency_std)
        and agreement > selection.min_agreement
        and a.support + b.support <= 1
    )

"""Matching of the modes of two logs, also across a change of the structure or of a sensor."""

import itertools
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from daq import FloatArray, IndexArray
from oma import mac_matrix
from updater.modal_data.plausibility import check_unit
from updater.modal_data.tracked import ModalMean

_FARTHEST = 0.3  # of ln f
_MIN_MAC = 0.5
_SAME_MAC = 0.95  # at which a mode is the same one, however far it went ...
_FARTHEST_SAME = 0.7  # of ln f: ... up to twice or half its frequency
FREQUENCY_WEIGHT = 2.0  #: weight of |d ln f| relative to 1 - MAC
_FAULT_COST = 0.3  # that a fault of the measuring chain must save in all
_NO_PAIR = 1 - _MIN_MAC + FREQUENCY_WEIGHT * _FARTHEST  # cost of a mode without a partner: that of the worst pair


def match_modes(baseline: ModalMean, event: ModalMean) -> IndexArray:
    """Pair the modes of an event with those of a baseline, one to one.

    The sum of (1 - MAC) + 2 |d ln f| over all pairs is minimised (f: frequency). The MAC is reduced by the uncertainty
    of the event's shape, as a mean of shapes that mix two modes resembles one of them. A mode without a partner costs
    as much as the worst pair. Two modes with a MAC of at least 0.95 that are each other's best are always paired: a
    poorly identified mode cannot take the partner of a close one. Exchanged channels and a channel of the wrong sign
    reduce all MAC values: modes are also matched with each such fault undone, and the best match is used, for the
    pairing only. Pairs with a MAC below 0.5 or frequencies more than 30 % apart (100 % at a MAC of 0.95) are not
    formed.

    Parameters
    ----------
    baseline, event : (n_tracks,) and (n_modes,) at the same channels; NaN in the event for a mode that was not seen

    Returns
    -------
    (n_tracks,)
        Number of the event's mode, -1 for none.
    """
    return _best(baseline, event)[0]


def without_fault(baseline: ModalMean, event: ModalMean) -> ModalMean:
    """Return an event with the fault of the measuring chain undone, if there is one, by which its modes match best.

    Parameters
    ----------
    baseline, event : as for `match_modes`
    """
    chain = _best(baseline, event)[1]
    if chain is None:
        return event
    undone: dict[str, Any] = {name: chain(getattr(event, name)) for name in ("shape", "imaginary")}
    undone |= {name: np.abs(chain(getattr(event, name))) for name in ("shape_std", "imaginary_std")}
    return replace(event, **undone)


def may_answer(baseline: ModalMean, event: ModalMean) -> npt.NDArray[np.bool_]:
    """Return true (n_tracks, n_modes) for pairs of modes that are within the limits of `match_modes`.

    Parameters
    ----------
    baseline, event : (n_tracks,) and (n_modes,) at the same channels
    """
    distance = np.abs(event.log_frequency - baseline.log_frequency[:, None])
    return _answer(mac_matrix(baseline.shape, event.shape) - _unknown(event), distance)


def _unknown(event: ModalMean) -> FloatArray:
    """Return the share of each shape (n_modes,) that is noise."""
    return np.asarray(np.minimum((event.shape_std**2).sum(1), 1.0))


def _best(baseline: ModalMean, event: ModalMean) -> tuple[IndexArray, "_Undo | None"]:
    """Return for each mode of the baseline (n_tracks,) the event's, or -1, and the fault undone for it."""
    known = np.flatnonzero(np.isfinite(event.log_frequency) & np.isfinite(event.shape).all(1))
    event = event.only(known)
    distance = np.abs(event.log_frequency[None, :] - baseline.log_frequency[:, None])
    unknown = _unknown(event)
    least, undone, found = np.inf, None, np.full(len(baseline.log_frequency), -1, np.intp)
    for cost, chain in _chains(len(baseline.channels)):
        if cost >= least:  # the costs of pairs are zero or more
            break
        assurance = mac_matrix(baseline.shape, chain(event.shape)) - unknown
        whole = np.minimum(1 - assurance + FREQUENCY_WEIGHT * distance, _NO_PAIR)
        best = (whole == whole.min(0, initial=np.inf)) & (whole == whole.min(1, keepdims=True, initial=np.inf))
        row, column = linear_sum_assignment(whole - _NO_PAIR * (best & (assurance >= _SAME_MAC)))
        total = cost + float(whole[row, column].sum())
        if total < least:
            near = _answer(assurance[row, column], distance[row, column])
            least, undone = total, chain if cost else None
            found[:] = -1
            found[row[near]] = known[column[near]]
    return found, undone


def _answer(assurance: FloatArray, distance: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which pairs are one mode: a prop may raise a mode by half without changing its shape."""
    alike = (assurance >= _MIN_MAC) & (distance <= _FARTHEST)
    return np.asarray(alike | ((assurance >= _SAME_MAC) & (distance <= _FARTHEST_SAME)))


def _chains(n_channels: int) -> Iterator[tuple[float, "_Undo"]]:
    yield 0.0, _Undo(np.arange(n_channels), np.ones(n_channels))
    for channel in range(n_channels):
        sign = np.ones(n_channels)
        sign[channel] = -1.0
        yield _FAULT_COST, _Undo(np.arange(n_channels), sign)
    for first, second in itertools.combinations(range(n_channels), 2):
        order = np.arange(n_channels)
        order[[first, second]] = second, first
        yield _FAULT_COST, _Undo(order, np.ones(n_channels))


class _Undo:
    """A fault undone."""

    def __init__(self, order: IndexArray, sign: FloatArray) -> None:
        self._order, self._sign = order, sign

    def __call__(self, shape: FloatArray) -> FloatArray:
        return shape[:, self._order] * self._sign


def matched(baseline: ModalMean, event: ModalMean, original: ModalMean | None = None) -> ModalMean:
    """Return the event's modes in the order of the baseline's tracks, NaN where there is none.

    Channels that the baseline has come first, in its order; the event's other channels follow.

    Parameters
    ----------
    baseline, event : (n_tracks,) and (n_modes,)
    original : (n_modes,) the same event with everything removed for matching; returned in its place

    Raises
    ------
    ModalDataError
        If clearly more of the event's modes have a partner where its frequencies are taken to be in another unit.
    """
    channels = tuple(c for c in baseline.channels if c in event.channels)
    baseline, event, whole = baseline.at(channels), event.at(channels), event
    check_unit(np.exp(event.log_frequency), event.shape, np.exp(baseline.log_frequency), baseline.shape)
    found = match_modes(baseline, event)
    whole = original or whole
    event = whole.at((*channels, *(c for c in whole.channels if c not in channels)))
    values = {}
    for field in fields(event):
        if field.name != "channels":
            old = getattr(event, field.name)
            picked = old[np.maximum(found, 0)]
            missing = 0 if field.name == "n" else np.nan
            values[field.name] = np.where((found >= 0).reshape(-1, *[1] * (old.ndim - 1)), picked, missing)
    return ModalMean(channels=event.channels, **values)

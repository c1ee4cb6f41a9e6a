"""Increments of the one-step update, of mass or of flexibility: how they scatter while nothing changes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.errors import ModalDataError, PairingError
from updater.modal_data import ModalMean, check_event
from updater.one_step.significance import moderated_variance, z_limit
from updater.reference import (
    LARGEST_CLUSTER,
    ExpandedChange,
    Reference,
    expand_change,
    expand_shape,
    well_posed_cluster,
)

_WORST_CONDITION = 30.0  # of [A B2]: beyond it noise decides, and smaller clusters are taken
_NEGLIGIBLE = 1e-9  # relative to the largest: a deviation, or a singular value of input errors, that is rounding
_MIN_WINDOWS = 3  # of the baseline with all modes of the event, to learn a deviation from


@dataclass(frozen=True, eq=False)
class Increments:
    """Increments at n places and the effect of the inputs on them."""

    value: FloatArray  #: (n,)
    noise: FloatArray  #: (n, n_inputs) effect of one standard deviation of each input
    common: FloatArray  #: (n,) the same of a common change of all frequencies

    def deviations(self, variance: FloatArray) -> FloatArray:
        """Return the effect of each input (n, n_inputs + 1), noise scaled to a variance (n,) or () of z."""
        return np.column_stack([np.sqrt(variance)[..., None] * self.noise, self.common])


#: increments of an event relative to a baseline, for some tracks
Method = Callable[[ModalMean, ModalMean, IndexArray], Increments]


class NullDistribution:
    """Distribution of increments without a change, learned from the baseline.

    Parameters
    ----------
    reference : with the baseline and its windows
    method : the increments of an event
    """

    def __init__(self, reference: Reference, method: Method) -> None:
        self._reference, self._method = reference, method
        self._learnt = lru_cache(self._learn)

    def variance(self, tracks: IndexArray) -> FloatArray:
        """Return the variance of z (n,) that the baseline's windows show for some tracks; 1 if they are too few."""
        return self._learnt(tuple(tracks.tolist()))[0]

    def limit(self, event: ModalMean, tracks: IndexArray, indices: IndexArray) -> float:
        """Return the |z| of the places `indices` that one event in 100 as sure as this one passes anywhere."""
        base = self._reference.baseline
        nothing = self._method(replace(event, log_frequency=base.log_frequency, shape=base.shape), base, tracks)
        n_windows = self._learnt(tuple(tracks.tolist()))[1]
        return z_limit(nothing.noise[indices], nothing.common[indices], max(n_windows - 1, 0))

    def _learn(self, tracks: tuple[int, ...]) -> tuple[FloatArray, int]:
        """Return the variance of z (n,) and the number of windows; each is judged against the mean of the others."""
        chosen = np.array(tracks, np.intp)
        windows = self._reference.windows
        whole = np.isfinite(windows.log_frequency[:, chosen]) & np.isfinite(windows.shape[:, chosen, 0])
        usable = np.flatnonzero(whole.all(1))
        if len(usable) < _MIN_WINDOWS:
            return np.array(1.0), 0
        z = np.array([self._window_z(int(w), usable, chosen) for w in usable])
        moving = z.any(0)  # elsewhere no mode reaches: nothing scatters there
        variance = np.ones(z.shape[1])
        variance[moving] = moderated_variance(z[:, moving])
        return variance, len(usable)

    def _window_z(self, window: int, usable: IndexArray, tracks: IndexArray) -> FloatArray:
        windows, mean_of = self._reference.windows, self._reference.mean_of
        others = mean_of(windows.windows(usable[usable != window]))
        found = self._method(mean_of(windows.windows(np.array([window]))), others, tracks)
        std = np.linalg.norm(found.noise, axis=1)
        return np.asarray(np.divide(found.value, std, out=np.zeros_like(std), where=std > _NEGLIGIBLE * std.max()))


#: expansion of the shapes of an event's tracks in modes (at channels, omega), paired with some of them
Expansion = Callable[
    [ModalMean, ModalMean, IndexArray, tuple[FloatArray, FloatArray], IndexArray], list[ExpandedChange]
]


def expand_shapes(
    event: ModalMean, base: ModalMean, tracks: IndexArray, modes: tuple[FloatArray, FloatArray], paired: IndexArray
) -> list[ExpandedChange]:
    """Expand the shapes themselves, as the paper does (eqs 9 to 12), in place of their changes.

    Parameters, results and errors are those of `expand_changes`.

    The part of the undisturbed structure's shape outside the clusters becomes an increment, also without a change.
    """
    del base
    at_channels, omega = modes
    return [
        expand_shape(event.shape[track], at_channels, omega, int(mode), largest=LARGEST_CLUSTER)
        for track, mode in zip(tracks, paired, strict=True)
    ]


def expand_changes(
    event: ModalMean, base: ModalMean, tracks: IndexArray, modes: tuple[FloatArray, FloatArray], paired: IndexArray
) -> list[ExpandedChange]:
    """Expand the changes of shape, in smaller clusters where [A B2] would be nearly singular.

    Parameters
    ----------
    event, base : (n_tracks,) means
    tracks : (m,) those that are expanded
    modes : (n_modes, n_channels) at the channels and (n_modes,) angular frequencies of the modes to expand in
    paired : (m,) mode that is paired with each track
    """
    at_channels, omega = modes
    for largest in range(LARGEST_CLUSTER, 0, -1):
        clusters = [well_posed_cluster(at_channels, omega, mode, largest=largest) for mode in paired]
        changes = [
            expand_change(event.shape[track], base.shape[track], at_channels, cluster, mode)
            for track, mode, cluster in zip(tracks, paired, clusters, strict=True)
        ]
        if np.linalg.cond(np.array([c.t[paired] for c in changes])) < _WORST_CONDITION:
            break
    return changes


def covariance_root(spread: FloatArray) -> FloatArray:
    """Return (n, rank) with the covariance of (n, n_inputs): few modes contain the errors of many channels."""
    left, value, _ = np.linalg.svd(spread, full_matrices=False)
    kept = value > _NEGLIGIBLE * value[0]
    return np.asarray(left[:, kept] * value[kept])


def seen_tracks(reference: Reference, paired: IndexArray, event: ModalMean) -> tuple[ModalMean, IndexArray]:
    """Return an event at the baseline's channels, and its tracks that have a shape and a mode of the reference.

    Raises
    ------
    ModalDataError
        If its modes cannot be right.
    PairingError
        If no mode can be compared.
    ValueError
        If a channel of the baseline is missing.
    """
    expected = reference.baseline.channels
    if not set(expected) <= set(event.channels):
        raise ModalDataError(
            f"channels: expected the baseline's {', '.join(expected)}, found {', '.join(event.channels)}"
        )
    event = event.at(expected)
    shaped = np.isfinite(event.log_frequency) & np.isfinite(event.shape).all(1) & event.shape.any(1)
    tracks = np.flatnonzero(shaped & (paired >= 0))
    if not len(tracks):
        raise PairingError("no measured mode is paired with one of the reference")
    check_event(reference.baseline.only(tracks), event.only(tracks))
    return event, tracks

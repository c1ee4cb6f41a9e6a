"""The one-step update's second stage: nodal mass increments, how sure they are, and which are no chance.

What is expanded is the change of each shape since the baseline, in a cluster of modes that the model alone decides:
what the clusters cannot hold of the baseline's own shapes cancels, and unchanged data give no increment at all.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.errors import PairingError
from updater.expansion import LARGEST_CLUSTER, ExpandedChange, expand_change
from updater.flags import moderated_variance, z_limit
from updater.one_step import mass_slope, normalised_increments, scale_by_stiffness, update_mass
from updater.particles import lump
from updater.reference import Reference
from updater.statistics import COMMON_STD, ModalMean

_WORST_CONDITION = 30.0  # of [A B2]: beyond it noise decides, and smaller clusters are taken
_LEAST_WINDOWS = 3  # of the baseline with all modes of the event, to learn a deviation from


@dataclass(frozen=True, kw_only=True)
class Flag:
    """A node and direction whose increment is no chance."""

    node: int
    direction: int  #: 0, 1, 2 for x, y, z
    z: float  #: increment over its standard deviation [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class MassUpdate:
    """Nodal mass increments of the one-step update; nodes are those of the reference's model."""

    increment: FloatArray  #: (n_nodes, 3) by direction, diag(M_u) - diag(M) [kg]; 0 where a node is held
    increment_std: FloatArray  #: (n_nodes, 3) of noise and of a common change of all frequencies [kg]
    normalised: FloatArray  #: (n_nodes, 3) over the updated modes' share, eq. 14 [kg]; NaN where that is under 1e-3
    normalised_std: FloatArray  #: (n_nodes, 3) [kg]
    totals: FloatArray  #: (3,) sums of the normalised increments: of the order of the mass, not an estimate of it [kg]
    totals_std: FloatArray  #: (3,) [kg]
    z_limit: float  #: |z| that one undisturbed event in 100 passes anywhere [-]
    flagged: tuple[Flag, ...]  #: beyond it; first the one with the largest normalised increment over its node's mass


@dataclass(frozen=True, eq=False)
class _Increments:
    value: FloatArray  #: (n,) of each translation [kg]
    noise: FloatArray  #: (n, n_inputs) what one standard deviation of each input moves it by [kg]
    common: FloatArray  #: (n,) the same of a common change of all frequencies [kg]


class MassUpdater:
    """The second stage for one reference; what it needs of the model is made once.

    Parameters
    ----------
    reference : learnt before the change
    """

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self._at = lump(reference)
        self._learnt = lru_cache(self._learn)

    def update(self, event: ModalMean) -> MassUpdate:
        """Put the modes of an event in the place of the reference's.

        Parameters
        ----------
        event : (n_tracks,) mean of windows, channels as in the baseline

        Raises
        ------
        PairingError
            If no mode can be compared, or two are the same in the model's modes.
        ValueError
            If the channels are not the baseline's.
        """
        tracks = self._seen(event)
        found = self._increments(event, self._reference.baseline, tracks)
        share = self._at.share(self._at.paired[tracks])
        normalised = normalised_increments(found.value, 1 / self._at.mass, share / self._at.mass)
        # a direction that the updated modes hardly move says nothing: its share is endless, its increment none
        share = np.where(np.isfinite(normalised), share, np.inf)
        variance, n_windows = self._learnt(tuple(tracks.tolist()))
        limit = self._limit(event, tracks, np.flatnonzero(np.isfinite(normalised)), n_windows)
        return self._as_nodes(found, normalised, share, variance, limit)

    def _limit(self, event: ModalMean, tracks: IndexArray, told: IndexArray, n_windows: int) -> float:
        """Return the limit for an event as sure as this one in which nothing has changed."""
        base = self._reference.baseline
        nothing = self._increments(replace(event, log_frequency=base.log_frequency, shape=base.shape), base, tracks)
        return z_limit(nothing.noise[told], nothing.common[told], max(n_windows - 1, 0))

    def _as_nodes(
        self, found: _Increments, normalised: FloatArray, share: FloatArray, variance: FloatArray, limit: float
    ) -> MassUpdate:
        at, told = self._at, np.isfinite(normalised)
        scale = np.sqrt(variance)
        root = np.column_stack([scale[:, None] * found.noise, found.common])
        std = np.linalg.norm(root, axis=1)
        by_input = [(root / share[:, None])[at.direction == axis].sum(0) for axis in range(3)]
        z = np.where(told, found.value / std, 0.0)
        order = np.argsort(-self._strength(np.where(told, normalised, 0.0)), kind="stable")
        return MassUpdate(
            increment=at.by_node(found.value, 0.0),
            increment_std=at.by_node(std, 0.0),
            normalised=at.by_node(normalised, np.nan),
            normalised_std=at.by_node(np.where(told, std / share, np.nan), np.nan),
            totals=at.totals(normalised),
            totals_std=np.linalg.norm(by_input, axis=1),
            z_limit=limit,
            flagged=tuple(
                Flag(node=int(at.node[j]), direction=int(at.direction[j]), z=float(z[j]))
                for j in order
                if abs(z[j]) > limit
            ),
        )

    def _strength(self, normalised: FloatArray) -> FloatArray:
        """Return the increments (n,) over their nodes' own masses, summed over the directions of each node."""
        at = self._at
        by_node = np.bincount(at.node, normalised / at.mass, minlength=len(at.model.nodes))
        return np.abs(by_node)[at.node]

    def _seen(self, event: ModalMean) -> IndexArray:
        expected = self._reference.baseline.channels
        if event.channels != expected:
            raise ValueError(
                f"channels: expected the baseline's {', '.join(expected)}, found {', '.join(event.channels)}"
            )
        finite = np.isfinite(event.log_frequency) & np.isfinite(event.shape[:, 0])
        tracks = np.flatnonzero(finite & (self._at.paired >= 0))
        if not len(tracks):
            raise PairingError("no measured mode answers to one of the reference's")
        return tracks

    def _increments(self, event: ModalMean, base: ModalMean, tracks: IndexArray) -> _Increments:
        """Return the increments by eqs 7, 12 and 13 and their slopes: eq. 13 takes the ratio to the baseline."""
        at, paired = self._at, self._at.paired[tracks]
        replaced = np.eye(at.translation.shape[1])[:, paired]
        changes = self._changes(event, base, tracks, replaced)
        ratio = np.exp((event.log_frequency - base.log_frequency)[tracks])
        omega = at.modes.omega[paired]
        t = scale_by_stiffness(np.column_stack([c.t for c in changes]), omega, omega * ratio)
        weighed = at.mass[:, None] * at.translation
        value = update_mass(weighed, t, replaced).diagonal()
        slope = mass_slope(weighed, t, replaced)
        by_frequency = np.einsum("ijk,ki->ji", slope, t)
        stated = np.hypot(event.log_frequency_std, base.log_frequency_std)[tracks]
        columns = [by_frequency * stated]
        for i, (track, change) in enumerate(zip(tracks, changes, strict=True)):
            columns.append(slope[i] @ (ratio[i] * change.by_event * event.shape_std[track]))
            columns.append(slope[i] @ (ratio[i] * change.by_base * base.shape_std[track]))
        return _Increments(value, np.column_stack(columns), COMMON_STD * by_frequency.sum(1))

    def _changes(
        self, event: ModalMean, base: ModalMean, tracks: IndexArray, replaced: FloatArray
    ) -> list[ExpandedChange]:
        """Expand the changes of shape, in smaller clusters where [A B2] would be nearly singular."""
        at, paired = self._at, self._at.paired[tracks]
        for largest in range(LARGEST_CLUSTER, 0, -1):
            changes = [
                expand_change(event.shape[track], base.shape[track], at.at_channels, cluster, mode)
                for track, mode, cluster in zip(tracks, paired, at.clusters(paired, largest), strict=True)
            ]
            t = np.column_stack([c.t for c in changes])
            if np.linalg.cond(replaced.T @ t) < _WORST_CONDITION:
                break
        return changes

    def _learn(self, tracks: tuple[int, ...]) -> tuple[FloatArray, int]:
        """Return the variance of z (n,) that the baseline's windows show for some tracks, and their number.

        Each window is judged as an event against the mean of the others.
        """
        chosen = np.array(tracks, np.intp)
        windows = self._reference.windows
        whole = np.isfinite(windows.log_frequency[:, chosen]) & np.isfinite(windows.shape[:, chosen, 0])
        usable = np.flatnonzero(whole.all(1))
        if len(usable) < _LEAST_WINDOWS:
            return np.ones(len(self._at.mass)), 0
        z = np.array([self._window_z(int(w), usable, chosen) for w in usable])
        return moderated_variance(z), len(usable)

    def _window_z(self, window: int, usable: IndexArray, tracks: IndexArray) -> FloatArray:
        windows, mean_of = self._reference.windows, self._reference.mean_of
        others = mean_of(windows.windows(usable[usable != window]))
        found = self._increments(mean_of(windows.windows(np.array([window]))), others, tracks)
        return np.asarray(found.value / np.linalg.norm(found.noise, axis=1))

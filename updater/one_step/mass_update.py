"""The one-step update's second stage: nodal mass increments, their deviations, flags, and the place of one mass.

The change of each shape since the baseline is expanded, in a cluster of modes that depends on the model alone: the part
of the baseline's own shapes outside the clusters cancels, and unchanged data give no increment.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.modal_data import COMMON_STD, ModalMean
from updater.one_step.increments import (
    Expansion,
    Increments,
    NullDistribution,
    covariance_root,
    expand_changes,
    seen_tracks,
)
from updater.one_step.location import IncrementLocation, IncrementLocator
from updater.one_step.lumped_mass import lump
from updater.one_step.update import mass_slope, normalised_increments, scale_by_stiffness, update_mass
from updater.reference import ExpandedChange, Reference


@dataclass(frozen=True, kw_only=True)
class Flag:
    """Node and direction with a significant increment."""

    node: int
    direction: int  #: 0, 1, 2 for x, y, z
    z: float  #: increment over its standard deviation [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class MassUpdate:
    """Nodal mass increments of the one-step update; nodes are those of the reference's model."""

    increment: FloatArray  #: (n_nodes, 3) by direction, diag(M_u) - diag(M) [kg]; 0 where a node is held
    increment_std: FloatArray  #: (n_nodes, 3) of noise and of a common change of all frequencies [kg]
    normalised: FloatArray  #: (n_nodes, 3) over the updated modes' share, eq. 14 [kg]; NaN where that is too small
    normalised_std: FloatArray  #: (n_nodes, 3) [kg]
    totals: FloatArray  #: (3,) sums of the normalised increments: of the order of the mass, not an estimate of it [kg]
    totals_std: FloatArray  #: (3,) [kg]
    z_limit: float  #: |z| that one undisturbed event in 100 passes anywhere [-]
    flagged: tuple[Flag, ...]  #: significant increments, by distance from the location
    #: location of one mass that explains all increments best; None if nothing is flagged
    location: IncrementLocation | None


class MassUpdater:
    """The second stage for one reference; quantities of the model are computed once.

    Parameters
    ----------
    reference : learned before the change
    expansion : `expand_changes`, or `expand_shapes` to follow the paper to the letter
    """

    def __init__(self, reference: Reference, expansion: Expansion = expand_changes) -> None:
        self._reference, self._expand = reference, expansion
        self._at = lump(reference)
        self._nothing = NullDistribution(reference, self._increments)
        self._locator = cache(lambda: IncrementLocator(reference, self._at))

    def update(self, event: ModalMean) -> MassUpdate:
        """Put the modes of an event in the place of the reference's.

        Parameters
        ----------
        event : (n_tracks,) mean of windows, at the baseline's channels at least

        Raises
        ------
        ModalDataError
            If the modes cannot be right: a wrong unit, doubled.
        PairingError
            If no mode can be compared, or two are the same in the model's modes.
        ValueError
            If a channel of the baseline is missing.
        """
        at = self._at
        event, tracks = seen_tracks(self._reference, at.paired, event)
        found = self._increments(event, self._reference.baseline, tracks)
        share = at.share(at.paired[tracks])
        normalised = normalised_increments(found.value, 1 / at.mass, share / at.mass)
        # a direction in which the updated modes hardly move has no information: its share is infinite, its increment
        # none
        share = np.where(np.isfinite(normalised), share, np.inf)
        limit = self._nothing.limit(event, tracks, np.flatnonzero(np.isfinite(normalised)))
        variance = self._nothing.variance(tracks)
        update = self._as_nodes(found, normalised, share, variance, limit)
        if not update.flagged:
            return update
        changes = self._expanded(event, self._reference.baseline, tracks)
        location = self._locator().locate(event, tracks, found, changes, max(1.0, float(variance.mean())))
        away = np.linalg.norm(at.model.nodes - location.position, axis=1).round(9)  # equal ones stay equal
        flagged = sorted(update.flagged, key=lambda flag: (away[flag.node], -abs(flag.z)))
        return replace(update, flagged=tuple(flagged), location=location)

    def _as_nodes(
        self, found: Increments, normalised: FloatArray, share: FloatArray, variance: FloatArray, limit: float
    ) -> MassUpdate:
        at, known = self._at, np.isfinite(normalised)
        root = found.deviations(variance)
        std = np.linalg.norm(root, axis=1)
        by_input = [(root / share[:, None])[at.direction == axis].sum(0) for axis in range(3)]
        z = np.where(known, found.value / std, 0.0)
        return MassUpdate(
            increment=at.by_node(found.value, 0.0),
            increment_std=at.by_node(std, 0.0),
            normalised=at.by_node(normalised, np.nan),
            normalised_std=at.by_node(np.where(known, std / share, np.nan), np.nan),
            totals=at.totals(normalised),
            totals_std=np.linalg.norm(by_input, axis=1),
            z_limit=limit,
            flagged=tuple(
                Flag(node=int(at.node[j]), direction=int(at.direction[j]), z=float(z[j]))
                for j in np.flatnonzero(np.abs(z) > limit)
            ),
            location=None,
        )

    def _expanded(self, event: ModalMean, base: ModalMean, tracks: IndexArray) -> list[ExpandedChange]:
        at = self._at
        return self._expand(event, base, tracks, (at.at_channels, at.modes.omega), at.paired[tracks])

    def _increments(self, event: ModalMean, base: ModalMean, tracks: IndexArray) -> Increments:
        """Return the increments by eqs 7, 12 and 13 and their slopes: eq. 13 takes the ratio to the baseline."""
        at, paired = self._at, self._at.paired[tracks]
        replaced = np.eye(at.translation.shape[1])[:, paired]
        changes = self._expanded(event, base, tracks)
        ratio = np.exp((event.log_frequency - base.log_frequency)[tracks])
        omega = at.modes.omega[paired]
        t = scale_by_stiffness(np.column_stack([c.t for c in changes]), omega, omega * ratio)
        value = update_mass(at.weighed, t, replaced).diagonal()
        slope = mass_slope(at.weighed, t, replaced)
        by_frequency = np.einsum("ijk,ki->ji", slope, t)
        stated = np.hypot(event.log_frequency_std, base.log_frequency_std)[tracks]
        columns = [by_frequency * stated]
        for i, (track, change) in enumerate(zip(tracks, changes, strict=True)):
            by_shape = [ratio[i] * change.by_event * event.shape_std[track], change.by_base * base.shape_std[track]]
            columns.append(slope[i] @ covariance_root(np.concatenate(by_shape, axis=1)))
        return Increments(value, np.column_stack(columns), COMMON_STD * by_frequency.sum(1))

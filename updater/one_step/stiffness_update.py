"""One-step update of the stiffness with known mass (eq. 8): flexibility increments.

Each equation has its counterpart. The measured modes are scaled by the mass that is known (eq. 12) instead of eq. 13,
expanded in the modes they replace and orthonormalised, so that M_u = M exactly. Eq. 8 then adds to the flexibility
sum a a^T / omega_a^2 - b b^T / omega_b^2: nothing is inverted. It is read where it is local, at hinges, as mass is at
particles; and as eq. 14 divides by the updated modes' share of M^-1, so is here by their share of K^-1.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from daq import FloatArray, IndexArray
from updater.fe import Hinges, flexibility, hinges_of
from updater.modal_data import COMMON_STD, ModalMean
from updater.one_step.increments import Increments, NullDistribution, expand_changes, seen_tracks
from updater.one_step.lumped_mass import Particles, lump
from updater.one_step.update import normalised_increments
from updater.reference import Reference, orthonormal, orthonormal_slope


@dataclass(frozen=True, eq=False, kw_only=True)
class StiffnessUpdate:
    """Flexibility increments of hinges; positive where stiffness was lost."""

    hinges: Hinges
    flexibility: FloatArray  #: (n,) of the reference [rad/(N m)]
    share: FloatArray  #: (n,) of the updated modes in it [-]
    increment: FloatArray  #: (n,) [rad/(N m)]
    increment_std: FloatArray  #: (n,) of noise and of a common change of all frequencies [rad/(N m)]
    normalised: FloatArray  #: (n,) over the share, as in eq. 14 [rad/(N m)]; NaN where that is too small
    normalised_std: FloatArray  #: (n,) [rad/(N m)]
    z_limit: float  #: |z| that one undisturbed event in 100 passes anywhere [-]
    flagged: IndexArray  #: (n_flagged,) hinges beyond it; first the largest normalised increment over its flexibility

    @property
    def relative(self) -> FloatArray:
        """Normalised increments over the hinges' own flexibility (n,): to first order largest where the loss is."""
        return self.normalised / self.flexibility


class StiffnessUpdater:
    """The second stage for one reference, of stiffness; quantities of the model are computed once.

    Parameters
    ----------
    reference : learned before the change
    """

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self._at = lump(reference)
        self._hinges = hinges_of(self._at.model)
        self._flexibility = _of_reference(self._at, self._hinges.rows)
        self._nothing = NullDistribution(reference, self._increments)

    def update(self, event: ModalMean) -> StiffnessUpdate:
        """Put the modes of an event in the place of the reference's.

        Parameters
        ----------
        event : (n_tracks,) mean of windows, at the baseline's channels at least

        Raises
        ------
        ModalDataError
            If the modes cannot be right: a wrong unit, doubled.
        PairingError
            If no mode can be compared.
        ValueError
            If a channel of the baseline is missing.
        """
        event, tracks = seen_tracks(self._reference, self._at.paired, event)
        found = self._increments(event, self._reference.baseline, tracks)
        updated = _by_mode(self._at, self._hinges.rows, self._at.paired[tracks])
        share = (updated**2).sum(1) / self._flexibility
        normalised = normalised_increments(found.value, self._flexibility, share * self._flexibility)
        known = np.isfinite(normalised)
        limit = self._nothing.limit(event, tracks, np.flatnonzero(known))
        std = np.linalg.norm(found.deviations(self._nothing.variance(tracks)), axis=1)
        beyond = known & (np.abs(found.value) > limit * std)
        order = np.argsort(-np.abs(np.where(beyond, normalised / self._flexibility, 0.0)), kind="stable")
        return StiffnessUpdate(
            hinges=self._hinges,
            flexibility=self._flexibility,
            share=share,
            increment=found.value,
            increment_std=std,
            normalised=normalised,
            normalised_std=np.where(known, std / np.where(known, share, 1.0), np.nan),
            z_limit=limit,
            flagged=order[: int(beyond.sum())],
        )

    def _increments(self, event: ModalMean, base: ModalMean, tracks: IndexArray) -> Increments:
        at, paired = self._at, self._at.paired[tracks]
        own, omega = np.arange(len(paired)), at.modes.omega[paired]
        changes = expand_changes(event, base, tracks, (at.at_channels[paired], omega), own)
        measured = np.column_stack([c.t for c in changes])
        ratio = np.exp((event.log_frequency - base.log_frequency)[tracks])
        before = _by_mode(at, self._hinges.rows, paired)
        left = before * omega  # R b
        after = left @ orthonormal(measured) / (omega * ratio)
        by_frequency = -2 * after**2
        by_turn = 2 * left[:, :, None] * (after / (omega * ratio))[:, None, :]  # derivative by the orthonormalised
        stated = np.hypot(event.log_frequency_std, base.log_frequency_std)[tracks]
        columns = [by_frequency * stated]
        for i, (track, change) in enumerate(zip(tracks, changes, strict=True)):
            for slope in (change.by_event * event.shape_std[track], change.by_base * base.shape_std[track]):
                columns.append(by_turn.reshape(len(left), -1) @ orthonormal_slope(measured, i, slope))
        value = (after**2 - before**2).sum(1)
        return Increments(value, np.column_stack(columns), COMMON_STD * by_frequency.sum(1))


def _by_mode(at: Particles, rows: sparse.csr_array, chosen: IndexArray) -> FloatArray:
    """Return R b / omega (n, m) of some modes: their squares are their parts of the flexibility."""
    return np.asarray(rows @ at.modes.shape[:, chosen] / at.modes.omega[chosen])


def _of_reference(at: Particles, rows: sparse.csr_array) -> FloatArray:
    """Return the flexibility (n,) after the first stage (eq. 8): measured modes in the place of the model's."""
    paired = at.paired[at.paired >= 0]
    replaced = rows @ at.before.shape[:, paired] / at.before.omega[paired]
    return np.asarray(flexibility(at.model, rows) + (_by_mode(at, rows, paired) ** 2 - replaced**2).sum(1))

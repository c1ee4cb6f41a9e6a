"""The reference: a calibrated model, one-step updated to the baseline's modes, and the baseline's own statistics."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray, IntArray
from oma import ModalEstimate
from updater.calibration import Calibration, calibrate, channel_rows
from updater.expansion import LARGEST_CLUSTER, expand, orthonormal, pair_modes
from updater.fe.model import Model, Modes, build_model
from updater.one_step import normalised_increments, scale_by_stiffness, update_mass
from updater.statistics import ModalMean, Scatter, TrackedModes, learn_scatter, mean_modes, stack_tracks
from updater.structure import Structure


@dataclass(frozen=True, eq=False, kw_only=True)
class Reference:
    """What the structure was when nothing had changed."""

    calibration: Calibration
    baseline: ModalMean
    scatter: Scatter
    frequency: FloatArray  #: (n_modes,) measured where a track answers, the model's elsewhere [Hz]
    shape: FloatArray  #: (n_dofs, n_modes) mass-normalised [A B2], in the order of the model's modes

    @property
    def paired(self) -> IndexArray:
        """Model mode of each track (n_tracks,)."""
        return self.calibration.paired

    def at_channels(self, channels: tuple[str, ...]) -> FloatArray:
        """Return the modes at sensors (n_channels, n_modes)."""
        return channel_rows(self.calibration.model, channels) @ self.shape

    def mean_of(self, modes: TrackedModes) -> ModalMean:
        """Average windows with the standard deviations that the baseline's scatter has shown to be real."""
        return mean_modes(modes, frequency_factor=self.scatter.frequency_factor, shape_factor=self.scatter.shape_factor)


def learn_reference(
    structure: Structure, estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray]
) -> Reference:
    """Learn from baseline windows: average, calibrate, then the one-step update's first stage.

    The measured modes are expanded in clusters of the paired modes only and orthonormalised, so that the mass is not
    altered (eqs 7, 9 to 12) and the change is one of stiffness (eq. 8).

    Measured modes without a partner in the model are left out; `calibration.tracks` says which stayed.

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ValueError
        With fewer than three windows.
    """
    tracked = stack_tracks(estimates, tracks)
    calibration = calibrate(structure, mean_modes(tracked))
    kept = stack_tracks(estimates, [track[calibration.tracks] for track in tracks])
    scatter = learn_scatter(kept)
    baseline = mean_modes(kept, frequency_factor=scatter.frequency_factor, shape_factor=scatter.shape_factor)
    updated = _first_stage(calibration.model, calibration.modes, calibration.paired, baseline)
    return Reference(
        calibration=calibration, baseline=baseline, scatter=scatter, frequency=updated.frequency, shape=updated.shape
    )


def _first_stage(model: Model, modes: Modes, paired: IndexArray, baseline: ModalMean) -> Modes:
    """Return the modes with the measured ones (n_tracks,) in the place of the paired, which alters no mass."""
    frequency, shape = modes.frequency.copy(), modes.shape.copy()
    frequency[paired] = np.exp(baseline.log_frequency)
    seen = (channel_rows(model, baseline.channels) @ shape[:, paired]).T
    t = [expand(s, seen, modes.omega[paired], i, largest=LARGEST_CLUSTER) for i, s in enumerate(baseline.shape)]
    shape[:, paired] = shape[:, paired] @ orthonormal(np.array([x / np.linalg.norm(x) for x in t]).T)
    return Modes(frequency=frequency, shape=shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class MassUpdate:
    """Nodal mass increments of the one-step update."""

    increment: FloatArray  #: (n_nodes, 3) by direction, diag(M_u) - diag(M) [kg]; 0 where a node is held
    normalised: FloatArray  #: (n_nodes, 3) over the updated modes' share, eq. 14 [kg]; NaN where that is under 1e-3

    @property
    def totals(self) -> FloatArray:
        """Sums of the normalised increments a direction (3,) [kg]: of the order of the mass, not an estimate of it."""
        return np.asarray(np.nansum(self.normalised, axis=0))


def mass_update(reference: Reference, event: ModalMean) -> MassUpdate:
    """Return the one-step update's second stage: eq. 7 with modes scaled by eq. 13, read as nodal increments.

    The mass is lumped in particles, as in the paper, so that a diagonal entry is a node's mass.
    """
    model, modes, paired = _particle_reference(reference)
    seen = np.flatnonzero(np.isfinite(event.log_frequency) & np.isfinite(event.shape[:, 0]) & (paired >= 0))
    paired = paired[seen]
    at_channels = (channel_rows(model, event.channels) @ modes.shape).T
    t = np.column_stack(
        [
            expand(event.shape[i], at_channels, modes.omega, k, largest=LARGEST_CLUSTER)
            for i, k in zip(seen, paired, strict=True)
        ]
    )
    # eq. 13 asks for the change of frequency alone: the ratio to the baseline, not to the model
    ratio = np.exp(event.log_frequency - reference.baseline.log_frequency)[seen]
    t = scale_by_stiffness(t, modes.omega[paired], modes.omega[paired] * ratio)
    mass = model.mass.diagonal()
    change = update_mass(mass[:, None] * modes.shape, t, np.eye(len(modes.omega))[:, paired]).diagonal()
    share = (modes.shape[:, paired] ** 2).sum(1)
    weighed = mass > 0
    normalised = np.full(len(mass), np.nan)
    normalised[weighed] = normalised_increments(change[weighed], 1 / mass[weighed], share[weighed])
    return MassUpdate(increment=_by_node(model.dofs, change, 0.0), normalised=_by_node(model.dofs, normalised, np.nan))


def _particle_reference(reference: Reference) -> tuple[Model, Modes, IndexArray]:
    """Return the calibrated structure with particle-lumped mass, one-step updated, and the mode of each track or -1."""
    baseline = reference.baseline
    model = build_model(reference.calibration.structure, shear_flexible=True)
    modes = model.modes(len(reference.frequency))
    seen = (channel_rows(model, baseline.channels) @ modes.shape).T
    paired = pair_modes(np.exp(baseline.log_frequency), baseline.shape, modes.frequency, seen)
    partnered = np.flatnonzero(paired >= 0)
    return model, _first_stage(model, modes, paired[partnered], baseline.only(partnered)), paired


def _by_node(dofs: IntArray, values: FloatArray, held: float) -> FloatArray:
    return np.append(values, held)[dofs[:, :3]]

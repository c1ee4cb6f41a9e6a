"""Measured mode shapes at all nodes of a structure's model."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma import ComplexArray, ModalEstimate, comac, mac_matrix, pair_modes
from updater.fe import Model, Modes, build_model
from updater.modal_data import real_shape
from updater.reference import LARGEST_CLUSTER, channel_rows, expand_shape
from updater.structure import Structure

_BEYOND = 1.2
_SPARE = 10  # modes of the model beyond as many as are measured
_MAX_MODES = 320  # modes of the model, however many there are below the highest measured frequency


@dataclass(frozen=True, eq=False)
class ModelPartner:
    """The model's mode paired with a measured one."""

    frequency: float  #: [Hz]
    mac: float  #: [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelModes:
    """A model's modes at the channels, compared with measured ones."""

    structure: Structure
    model: Model
    frequency: FloatArray  #: (n,) of those that the channels see [Hz]
    shape: FloatArray  #: (n, n_channels)
    dof_shape: FloatArray  #: (n_dofs, n) shapes at the degrees of freedom [1/sqrt(kg)]
    measured: FloatArray  #: (n_modes,) frequencies of the measured modes [Hz]
    pairs: IndexArray  #: (n_modes,) partner of each measured one, or -1
    mac: FloatArray  #: (n_modes, n) of measured ones with the model's
    comac: FloatArray  #: (n_channels,) over the pairs; NaN where there are none

    def near(self, frequency: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return frequencies and shapes of the model's modes up to somewhat beyond some frequencies [Hz]."""
        wanted = self.frequency <= _BEYOND * frequency.max()
        wanted[: int(self.pairs.max()) + 1] = True
        return self.frequency[wanted], self.shape[wanted]

    def partner(self, mode: int) -> ModelPartner | None:
        """Return the partner of a measured mode."""
        k = int(self.pairs[mode])
        return None if k < 0 else ModelPartner(float(self.frequency[k]), float(self.mac[mode, k]))

    def nearest(self, mode: int) -> ModelPartner:
        """Return the model's mode that is most like a measured one, which need not be paired with it."""
        k = int(np.argmin(1 - self.mac[mode] + np.abs(np.log(self.measured[mode] / self.frequency))))
        return ModelPartner(float(self.frequency[k]), float(self.mac[mode, k]))


def model_modes(estimate: ModalEstimate, structure: Structure) -> ModelModes:
    """Compare a structure's model with measured modes.

    Raises
    ------
    UpdaterError
        If the structure cannot be computed or lacks a sensor.
    """
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = _modes_up_to(model, estimate)
    shapes: FloatArray = (channel_rows(model, estimate.channels) @ modes.shape).T
    seen = np.flatnonzero(np.linalg.norm(shapes, axis=1) > 0)
    frequency, shape = modes.frequency[seen], shapes[seen]
    pairs = pair_modes(estimate.frequency, real_shape(estimate.shape), frequency, shape)
    paired = np.flatnonzero(pairs >= 0)
    agreement = comac(estimate.shape[paired], shape[pairs[paired]]) if len(paired) else np.full(shape.shape[1], np.nan)
    return ModelModes(
        structure=structure,
        model=model,
        frequency=frequency,
        shape=shape,
        dof_shape=modes.shape[:, seen],
        measured=estimate.frequency,
        pairs=pairs,
        mac=mac_matrix(estimate.shape, shape),
        comac=agreement,
    )


def _modes_up_to(model: Model, estimate: ModalEstimate) -> Modes:
    """Return the model's modes up to somewhat beyond the measured ones: slender members have many below them."""
    n = estimate.n_modes + _SPARE
    while True:
        modes = model.modes(min(n, model.n_dofs - 1))
        if n >= min(_MAX_MODES, model.n_dofs - 1) or modes.frequency[-1] > _BEYOND * estimate.frequency.max():
            return modes
        n = min(2 * n, _MAX_MODES)


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpandedShapes:
    """Motion of the nodes of a model in measured modes; the largest displacement of each mode is 1."""

    model: Model
    translation: ComplexArray  #: (n_modes, n_nodes, 3) [-]
    rotation: ComplexArray  #: (n_modes, n_nodes, 3) [rad per m of displacement]


def expand_measured(estimate: ModalEstimate, compared: ModelModes) -> ExpandedShapes:
    """Expand measured shapes by the local correspondence principle (eqs 9 to 11); damping and phases are kept.

    Parameters
    ----------
    estimate : measured modes
    compared : modes of the model that were compared with them; a measured mode without a partner is expanded about the
        mode with the largest MAC
    """
    model, shapes = compared.model, compared.shape
    best = np.where(compared.pairs >= 0, compared.pairs, np.argmax(compared.mac, axis=1))
    omega, real = 2 * np.pi * compared.frequency, real_shape(estimate.shape)
    expanded = [
        expand_shape(shape, shapes, omega, int(mode), largest=LARGEST_CLUSTER).inverse @ measured
        for shape, measured, mode in zip(real, estimate.shape, best, strict=True)
    ]
    padded = np.vstack([compared.dof_shape, np.zeros((1, len(shapes)))])  # row -1: a DOF that is held
    moved = np.einsum("mk,ndk->mnd", np.array(expanded), padded[model.dofs])
    moved = moved / np.linalg.norm(moved[:, :, :3], axis=2).max(1)[:, None, None]
    return ExpandedShapes(model=model, translation=moved[:, :, :3], rotation=moved[:, :, 3:])

"""Measured mode shapes at all nodes of a structure's model."""

from dataclasses import dataclass

import numpy as np

from oma import ComplexArray, ModalEstimate
from updater.fe import Model
from updater.modal_data import real_shape
from updater.reference import LARGEST_CLUSTER, expand_shape
from updater.validation.model_pairing import ModelModes


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

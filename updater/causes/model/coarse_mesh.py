"""The structure file's mesh is too coarse: the model's upper modes lie too high, the more the higher.

This cause applies to a structure file without a learned reference: measured modes of a baseline have no mesh. The same
structure with elements a quarter as long gives frequencies and shapes X in the coarse model's modes, and with them the
flexibility X Lambda'^-1 X^T. It does not apply to external matrices, whose elements are unknown. Lumped mass and
missing shear cannot occur in a file's model.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Discrete
from updater.fe import Model
from updater.inference import Comparison, Effect, in_modes, no_effect
from updater.reference import Reference, best_model
from updater.structure import Structure

_FINER = 4  # elements for one
_WORTH = 1e-4  # of ln f: less than this is a fine mesh
_MAX_DOFS = 20_000  # of the finer model: a larger one is fine, and slow


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshError(Discrete):
    """One alternative, the finer mesh; it has no parameter."""

    flexibility: FloatArray  #: (n_modes, n_modes) of the finer mesh over that of the coarse one [s2]
    name: str = "mesh_error"
    place_free: bool = True
    advice: str = "Give the members more elements and diagnose again."

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return the finer mesh's flexibility."""
        del theta
        change = np.tile(self.flexibility, (len(rows), 1, 1))
        return replace(no_effect(len(rows), self.comparison), compliance=in_modes(change, self.comparison))

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Cut every member into more elements."""
        del row, theta
        return _refined(structure)


def propose_mesh_error(reference: Reference, comparison: Comparison) -> MeshError | None:
    """Return the finer mesh; None where a baseline was measured, or the mesh is fine already."""
    calibration = reference.calibration
    model = calibration.model
    if calibration.fitted or calibration.structure.external is not None or _FINER * model.n_dofs > _MAX_DOFS:
        return None
    refined = best_model(_refined(calibration.structure))
    modes = refined.modes(len(reference.frequency))
    if np.abs(np.log(modes.frequency / reference.frequency))[: int(comparison.paired.max()) + 1].max() < _WORTH:
        return None
    shape = _at_nodes(model, refined, modes.shape)
    inside, _ = np.linalg.qr(reference.shape.T @ (model.mass @ shape))  # the low ones as they are, the high make way
    own = (2 * np.pi * reference.frequency) ** -2.0
    flexibility = (inside * (2 * np.pi * modes.frequency) ** -2.0) @ inside.T - np.diag(own)
    return MeshError(
        comparison=comparison,
        flexibility=0.5 * (flexibility + flexibility.T),
    )


def _refined(structure: Structure) -> Structure:
    members = tuple(m.model_copy(update={"elements": _FINER * m.elements}) for m in structure.member)
    return structure.model_copy(update={"member": members})


def _at_nodes(model: Model, refined: Model, shape: FloatArray) -> FloatArray:
    """Return shapes (n_dofs, n_modes) of a finer model at the DOFs of a model's nodes."""
    read = (refined.reader(model.nodes) @ shape).reshape(len(model.nodes), 6, -1)
    found = np.zeros((model.n_dofs, shape.shape[1]))
    free = model.dofs >= 0
    found[model.dofs[free]] = read[free]
    return found

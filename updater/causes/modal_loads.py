"""Section forces of members, springs and groups: in each mode under its inertia load, and in each self-stress."""

from collections.abc import Mapping

import numpy as np

from daq import FloatArray
from updater.fe import group_strains, self_stress, weighted_actions
from updater.reference import Reference
from updater.structure import Axis, Joint, Support


def modal_section_forces(reference: Reference, stations: Mapping[int, FloatArray]) -> dict[int, FloatArray]:
    """Return the actions at stations along members, each over the root of the stiffness that bears it.

    Products of these, summed along a stretch, are the compliance that it has; those of modes are the calibrated
    model's, turned to the updated ones, over omega^2.

    Parameters
    ----------
    reference : with a model of beam elements
    stations : number of a member -> distances from its start (n,) [m]

    Returns
    -------
    dict
        Number of the member -> (n, 6, n_modes + n_stress).
    """
    model, modes = reference.model, reference.calibration.modes
    turned = modes.shape.T @ (model.mass @ reference.shape) / (2 * np.pi * reference.frequency) ** 2
    stress, members = self_stress(model), model.structure.member
    return {
        m: np.concatenate([of_modes @ turned, stress.actions(members[m], stations[m])], axis=2)
        for m, of_modes in weighted_actions(model, modes, dict(stations)).items()
    }


def modal_spring_force(reference: Reference, connection: Support | Joint, axis: Axis, row: FloatArray) -> FloatArray:
    """Return the force or moment (n_modes + n_stress,) in a connection's spring, of modes over omega^2.

    Parameters
    ----------
    row : (n_dofs,) that reads how far the spring is strained [m] or [rad]
    """
    stiffness: dict[Axis, float] = dict(connection.stiffness.items())
    of_modes = stiffness[axis] * (row @ reference.shape) / (2 * np.pi * reference.frequency) ** 2
    return np.append(of_modes, self_stress(reference.model).in_spring(connection, axis))


def group_compliance(reference: Reference) -> dict[str, FloatArray]:
    """Return the compliance (n_modes + n_stress, same) of each group of external matrices.

    A mode's elastic energy b^T K b is omega^2. A coarse mesh, or a mass that the model lacks, makes that of the model
    another one than the measured mode has: strains are scaled to the latter.
    """
    model, shape = reference.model, reference.shape
    strains, omega = group_strains(model), 2 * np.pi * reference.frequency
    scale = omega * np.sqrt((shape * (model.stiffness @ shape)).sum(0))
    couple = {g: np.hstack([rows @ shape / scale, strains.stress[g]]) for g, rows in strains.rows.items()}
    return {name: own.T @ own for name, own in couple.items()}

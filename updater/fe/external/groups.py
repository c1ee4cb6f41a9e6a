"""Strains of groups of external matrices: what of each mode's elastic energy is in a group, and how it is shifted.

With K = G^T G the strain of a group is a part of G u. Its modal strains span a few directions, w_k = (E^T G)_k, E
orthonormal: E from the eigenvectors of Lambda^-1/2 B^T K_i B Lambda^-1/2, so that G itself is not needed. A group
with a factor f on its stiffness adds the compliance (1 / f - 1) sum_k mu_k mu_k^T, mu_k = w_k b_r / omega_r^2 in
modes. Strains that no displacement causes are self-stress: S = w K^-1 w^T, I - S = Z Z^T, rows of Z the share of each
direction in states of self-stress (see `updater.fe.redundants`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from daq import FloatArray
from updater.fe.factorization import factorise
from updater.fe.model import Model, Spring

_MODES = 30  # of the model, whose strains the directions span
_MIN_ENERGY = 1e-3  # of the largest modal share of a group: a direction with less strain is left out
_MAX_OF_GROUP = 16  # directions of a group: a panel that loses 30 % is right to 1e-5 of frequency
_MAX_STATES = 40  # of self-stress, those of the largest share
_MIN_STATE = 1e-6  # share of self-stress in a direction that is zero but for rounding


@dataclass(frozen=True, eq=False)
class GroupStrains:
    """Directions of strain of the groups of a model; a spring of the structure file is one."""

    rows: Mapping[str, FloatArray]  #: group -> (n, n_dofs) that read its strains, in roots of energy [sqrt(2 J) / m]
    stress: Mapping[str, FloatArray]  #: group -> (n, n_states) share of each direction in the states of self-stress
    springs: Mapping[Spring, FloatArray]  #: share (n_states,) of each spring in them
    n_states: int


@lru_cache(maxsize=8)
def group_strains(model: Model) -> GroupStrains:
    """Return the directions of strain of a model's groups that modes excite, and of its springs."""
    springs = model.spring_rows()
    if not model.groups and not springs:
        return GroupStrains({}, {}, {}, 0)
    rows = _strain_rows(model)
    own = [np.sqrt(stiffness) * row[None] for row, stiffness in springs.values()]
    every = np.concatenate([*rows.values(), *own])
    needed = every @ factorise(model.stiffness)(np.ascontiguousarray(every.T))
    share, vector = np.linalg.eigh(np.eye(len(every)) - (needed + needed.T) / 2)
    kept = np.flatnonzero(share > _MIN_STATE)[-_MAX_STATES:]
    states = vector[:, kept] * np.sqrt(share[kept])
    end = np.cumsum([len(part) for part in (*rows.values(), *own)])
    parts = np.split(states, end[:-1])
    return GroupStrains(
        rows=rows,
        stress=dict(zip(rows, parts, strict=False)),
        springs={key: part[0] for key, part in zip(springs, parts[len(rows) :], strict=True)},
        n_states=states.shape[1],
    )


def _strain_rows(model: Model) -> dict[str, FloatArray]:
    """Return the rows (n, n_dofs) that read the strains of each group."""
    if not model.groups:
        return {}
    modes = model.modes(min(_MODES, int((model.mass.diagonal() > 0).sum())))
    per_energy = modes.shape / modes.omega
    rows = {}
    for name, stiffness in model.groups.items():
        load = stiffness @ per_energy
        energy, vector = np.linalg.eigh(per_energy.T @ load)
        kept = np.flatnonzero(energy > _MIN_ENERGY * energy[-1])[-_MAX_OF_GROUP:]
        rows[name] = np.asarray((load @ vector[:, kept] / np.sqrt(energy[kept])).T)
    return rows

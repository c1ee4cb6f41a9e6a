"""Reference with lumped masses for the one-step update: a diagonal entry is the mass of a node.

The particle-lumped mass has no rotary inertia, so M is singular. The modes of (M, K) with inertia are those of the
statically condensed structure, exactly, with the rotations recovered: over all of them M^-1 = sum b b^T (eq. 3) at
the translations.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe import Model, Modes, build_model
from updater.reference import Reference, first_stage, pair_baseline


@dataclass(frozen=True, eq=False, kw_only=True)
class Particles:
    """The calibrated structure with particle masses, one-step updated to the baseline (the first stage)."""

    model: Model
    before: Modes  #: modes of the model itself
    modes: Modes  #: [A B2] of the first stage
    paired: IndexArray  #: (n_tracks,) mode paired with each track, -1 if none
    at_channels: FloatArray  #: (n_modes, n_channels) of the baseline's channels
    node: IndexArray  #: (n,) node of each free translation, every one once
    direction: IndexArray  #: (n,) its direction, 0..2
    translation: FloatArray  #: (n, n_modes) of the modes [1/sqrt(kg)]
    weighed: FloatArray  #: (n, n_modes) M times the modes [sqrt(kg)]; mass couples nodes where a body lies between
    mass: FloatArray  #: (n,) diagonal of M [kg]

    def share(self, paired: IndexArray) -> FloatArray:
        """Return the share (n,) of some modes in each entry of M^-1, eq. 14 [-]."""
        return np.asarray(self.mass * (self.translation[:, paired] ** 2).sum(1))

    def by_node(self, values: FloatArray, held: float) -> FloatArray:
        """Return values (n,) of translations as (n_nodes, 3); twins at a joint share theirs."""
        rows = np.full(self.model.n_dofs + 1, held)
        rows[self.model.dofs[self.node, self.direction]] = values
        return np.asarray(rows[self.model.dofs[:, :3]])

    def totals(self, values: FloatArray) -> FloatArray:
        """Return sums (3,) a direction of values (n,), NaN left out."""
        return np.array([np.nansum(values[self.direction == axis]) for axis in range(3)])


def lump(reference: Reference) -> Particles:
    """Lump a reference's mass in particles and repeat the first stage of the one-step update."""
    baseline = reference.baseline
    model = build_model(reference.structure, shear_flexible=True)
    before = model.modes(len(reference.frequency))
    paired = pair_baseline(model, before, baseline)
    partnered = np.flatnonzero(paired >= 0)
    modes = first_stage(model, before, paired[partnered], baseline.only(partnered))
    node, direction = _translations(model)
    rows = model.dofs[node, direction]
    return Particles(
        model=model,
        before=before,
        modes=modes,
        paired=paired,
        at_channels=(reference.rows(model) @ modes.shape).T,
        node=node,
        direction=direction,
        translation=modes.shape[rows],
        weighed=(model.mass @ modes.shape)[rows],
        mass=model.mass.diagonal()[rows],
    )


def _translations(model: Model) -> tuple[IndexArray, IndexArray]:
    """Return node and direction of each free translation with mass; one at a joint belongs to its first node."""
    dof = model.dofs[:, :3].ravel()
    found, first = np.unique(dof, return_index=True)
    heavy = np.append(model.mass.diagonal(), 0.0)[found] > 0
    return first[heavy] // 3, first[heavy] % 3

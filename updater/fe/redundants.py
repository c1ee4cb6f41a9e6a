"""States of self-stress of a structure without load: the redundants of the force method.

If a member or a spring becomes softer, a statically determinate structure keeps its internal forces. Any other
redistributes them to stiffer parts. With orthogonal states z of unit elastic energy, in addition to the modes' actions,
and the added compliance C, in modes (m) and states (s), the modal flexibility increases by C_mm - C_ms (I + C_ss)^-1
C_sm.

References
----------
Przemieniecki, J. S. (1968). Theory of Matrix Structural Analysis, ch. 8 (matrix force method).
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from daq import FloatArray
from updater.fe.assembly import build_model
from updater.fe.element import Element
from updater.fe.external.groups import group_strains
from updater.fe.model import Model, Spring
from updater.fe.section_forces import N_ACTIONS
from updater.structure import Axis, Joint, Member, Support

_MAX = 90  # states, as of fifteen loops: with more none are used, and internal forces are assumed to be unchanged
_MIN = 1e-10  # relative to the largest singular value: less is zero
_AT_ONCE = 1e9  # m: one element between two joints carries any state exactly


@dataclass(frozen=True, eq=False)
class SelfStress:
    """States of self-stress, orthogonal in energy and of unit energy [sqrt(2 J)]."""

    n: int  #: states
    ends: dict[
        str, list[tuple[float, Element, FloatArray]]
    ]  #: member -> start [m], element, forces (12, n) at its ends
    springs: dict[Spring, FloatArray]  #: forces or moments (n,) in springs

    def actions(self, member: Member, at: FloatArray) -> FloatArray:
        """Return (len(at), 6, n) at distances from a member's start [m], each divided by the root of the stiffness."""
        found = np.zeros((len(at), N_ACTIONS, self.n))
        for start, element, force in self.ends.get(member.name, ()):
            xi = (at - start) / element.length
            here = (xi >= 0) & (xi <= 1)
            x = xi[here, None, None]
            found[here] = (-force[:6] * (1 - x) + force[6:] * x) / np.sqrt(element.rigidity)[:, None]
        return found

    def in_spring(self, connection: Support | Joint, axis: Axis) -> FloatArray:
        """Return the force or moment (n,) in a connection's spring."""
        return self.springs.get((getattr(connection, "member", ""), connection.at, axis), np.zeros(self.n))


@lru_cache(maxsize=8)
def self_stress(model: Model) -> SelfStress:
    """Return a model's states of self-stress; of matrices from elsewhere, those of their groups and springs.

    They are those strains of elements and springs, each divided by the root of its compliance, that no displacement
    causes: the part of all strains outside the range of the strain-displacement matrix.
    """
    if model.structure.external is not None:
        strains, stiffness_of = group_strains(model), {key: k for key, (_, k) in model.spring_rows().items()}
        in_springs = {key: np.sqrt(stiffness_of[key]) * share for key, share in strains.springs.items()}
        return SelfStress(strains.n_states, {}, in_springs)
    coarse = build_model(model.structure.with_mesh(_AT_ONCE), shear_flexible=True, mass="consistent")
    rows, forces = [], []
    for first, last, element in coarse.elements:
        assert isinstance(element, Element)
        turn = element.rotation(coarse.nodes[last] - coarse.nodes[first])
        stiffness = element.elastic_stiffness
        strain = np.linalg.solve(np.linalg.cholesky(stiffness[6:, 6:]), stiffness[6:])  # K = strain^T strain
        dofs = np.concatenate([coarse.dofs[first], coarse.dofs[last]])
        of_element = np.zeros((6, coarse.n_dofs))
        np.add.at(of_element.T, dofs[dofs >= 0], (strain @ turn).T[dofs >= 0])
        rows.append(of_element)
        forces.append(strain.T)
    springs = coarse.spring_rows()
    rows += [np.sqrt(stiffness) * row[None] for row, stiffness in springs.values()]
    states = _beside_range(np.concatenate(rows))
    ends: defaultdict[str, list[tuple[float, Element, FloatArray]]] = defaultdict(list)
    for k, (force, (first, _, element)) in enumerate(zip(forces, coarse.elements, strict=True)):
        assert isinstance(element, Element)
        member = next(m for m in model.structure.member if m.name == coarse.member_names[k])
        start = float(np.linalg.norm(coarse.nodes[first] - member.start))
        ends[member.name].append((start, element, force @ states[6 * k : 6 * k + 6]))
    first_spring = 6 * len(forces)
    return SelfStress(
        n=states.shape[1],
        ends=dict(ends),
        springs={
            key: np.sqrt(stiffness) * states[first_spring + k]
            for k, (key, (_, stiffness)) in enumerate(springs.items())
        },
    )


def _beside_range(strain: FloatArray) -> FloatArray:
    """Return orthonormal columns (n_strains, n) that are no strain of any displacement; none of very many."""
    left, value, _ = np.linalg.svd(strain, full_matrices=True)
    rank = int((value > _MIN * value.max(initial=0.0)).sum())
    states = left[:, rank:]
    return states if states.shape[1] <= _MAX else states[:, :0]

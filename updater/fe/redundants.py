"""States of self-stress of a structure without load: the redundants of the force method.

If a member or a spring becomes softer, a statically determinate structure keeps its internal forces. Any other
redistributes them to stiffer parts. With orthogonal states z of unit elastic energy, in addition to the modes' actions,
and the added compliance C, in modes (m) and states (s), the modal flexibility increases by C_mm - C_ms (I + C_ss)^-1
C_sm.

By the identity S (I + S^T C S)^-1 S^T = (I + S S^T C)^-1 S S^T, only products S S^T of the strains S in all states
enter. The states of a frame with many loops are therefore combined to fewer ones with the same products.

References
----------
Przemieniecki, J. S. (1968). Theory of Matrix Structural Analysis, ch. 8 (matrix force method).
Johnson, W. B., Lindenstrauss, J. (1984). Extensions of Lipschitz mappings into a Hilbert space. Contemp. Math. 26.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe.assembly import build_model
from updater.fe.element import Element
from updater.fe.external.groups import group_strains
from updater.fe.model import Model, Spring
from updater.fe.section_forces import N_ACTIONS
from updater.structure import Axis, Joint, Member, Support

_MAX = 90  # states: more are combined
_MAX_OF_PART = 60  # strains whose products are kept by the combinations
_MIN = 1e-10  # relative to the largest singular value, or eigenvalue: less is zero
_AT_ONCE = 1e9  # m: one element between two joints carries any state exactly


@dataclass(frozen=True, eq=False)
class SelfStress:
    """States of self-stress, orthogonal in energy and of unit energy [sqrt(2 J)], or combinations of very many."""

    n: int  #: states, or combinations
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
def self_stress(model: Model, *, every: bool = False) -> SelfStress:
    """Return a model's states of self-stress; of matrices from elsewhere, those of their groups and springs.

    They are those strains of elements and springs, each divided by the root of its compliance, that no displacement
    causes: the part of all strains outside the range of the strain-displacement matrix. Very many are combined: the
    products of strains are exact within a member of at most ten elements between joints and among springs of at most
    ten connections, the supports first. Between such parts they have an error.

    Parameters
    ----------
    every : whether all states are returned, however many: for products of strains between any members
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
    if not every and states.shape[1] > _MAX:
        states = _combined(states, [*_by_member(coarse.member_names), *_by_connection(list(springs), 6 * len(forces))])
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
    """Return orthonormal columns (n_strains, n) that are no strain of any displacement."""
    left, value, _ = np.linalg.svd(strain, full_matrices=True)
    rank = int((value > _MIN * value.max(initial=0.0)).sum())
    return np.asarray(left[:, rank:])


def _by_member(names: Sequence[str]) -> list[IndexArray]:
    """Return the strains of the elements of each member, of at most `_MAX_OF_PART` together.

    Parameters
    ----------
    names : member of each element
    """
    of_member = [[k for k, name in enumerate(names) if name == one] for one in dict.fromkeys(names)]
    parts = [part for elements in of_member for part in _divided([[k] for k in elements], _MAX_OF_PART // 6)]
    return [np.add.outer(6 * np.array(part), np.arange(6)).ravel() for part in parts]


def _by_connection(springs: Sequence[Spring], first: int) -> list[IndexArray]:
    """Return the strains of the springs of connections, of at most `_MAX_OF_PART` together.

    Parameters
    ----------
    first : number of the strain of the first spring
    """
    rows: defaultdict[tuple[str, tuple[float, float, float]], list[int]] = defaultdict(list)
    for row, (member, at, _) in enumerate(springs, first):
        rows[member, at].append(row)
    return [np.array(part) for part in _divided(list(rows.values()), _MAX_OF_PART)]


def _divided(groups: Sequence[list[int]], most: int) -> list[list[int]]:
    """Return groups of numbers joined to parts of at most so many, in their order."""
    parts: list[list[int]] = []
    for group in groups:
        if parts and len(parts[-1]) + len(group) <= most:
            parts[-1].extend(group)
        else:
            parts.append(list(group))
    return parts


def _combined(states: FloatArray, parts: Sequence[IndexArray]) -> FloatArray:
    """Return the strains (n_strains, `_MAX`) in random combinations of states.

    The strains of each part are multiplied by the symmetric matrix that makes their own products exact.

    Parameters
    ----------
    states : (n_strains, n_states) strains in each state
    parts : strains of which the products are kept; all strains are in one
    """
    random = np.random.default_rng(0).standard_normal((len(states), _MAX))
    combined = states @ np.linalg.qr(states.T @ random)[0]  # the same for any basis of the states
    for rows in parts:
        exact, _ = _roots(states[rows])
        _, inverse = _roots(combined[rows])
        combined[rows] = exact @ inverse @ combined[rows]
    return np.asarray(combined)


def _roots(strains: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the symmetric root of the products of strains (k, n), and its pseudoinverse (k, k)."""
    value, vector = np.linalg.eigh(strains @ strains.T)
    there = value > _MIN * value[-1]
    root = np.sqrt(np.where(there, value, 1.0))
    return vector * np.where(there, root, 0.0) @ vector.T, vector * np.where(there, 1 / root, 0.0) @ vector.T

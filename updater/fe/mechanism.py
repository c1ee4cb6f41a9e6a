"""Mechanisms of a structure: the whole, or a member that a support or a joint fails to hold.

Used only after a stiffness was found to be singular, to give the reason.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from daq import FloatArray, IntArray
from updater.fe.factorization import factorise

_WAYS = ("along x", "along y", "along z", "about x", "about y", "about z")
_NO_STRAIN = 1e-14  # relative to all DOFs moving alone: rounding
_NO_FORCE = 1e-12  # likewise of the forces; a frame on soft springs has 1e-9
_SHIFT = 1e-9  # shift that keeps a large singular matrix solvable
_DENSE = 1000  # DOFs up to which all of a matrix is solved for at once
_ALIKE = 1e-6  # relative: rounding
_MAX = 7  # motions looked for: the rigid ones and one more


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeMotion:
    """Motion without strain."""

    whole: tuple[str, ...]  #: ways in which all of it moves together, such as `along x`
    node: int | None  #: node with the largest motion if parts move independently, None if none does
    turns_only: bool  #: whether nodes turn without moving then

    def texts(self, at: Callable[[int], str]) -> list[str]:
        """Return sentences; `at` names a node."""
        texts = [f"all of it is free {', '.join(self.whole)}"] if self.whole else []
        if len(self.whole) == len(_WAYS):
            texts.append("a freely suspended structure needs its soft springs as the stiffness of a support")
        if self.node is not None:
            texts.append(f"free to {'turn' if self.turns_only else 'move'} by itself: {at(self.node)}")
        return texts


def free_motion(nodes: FloatArray, dofs: IntArray, stiffness: sparse.csc_array) -> FreeMotion:
    """Return the parts that can move without deformation.

    Parameters
    ----------
    nodes : (n_nodes, 3) [m]
    dofs : (n_nodes, 6) rows, -1 where something is held
    stiffness : (n_dofs, n_dofs), singular
    """
    diagonal = stiffness.diagonal()
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit = sparse.csc_array(sparse.diags_array(scale) @ stiffness @ sparse.diags_array(scale))
    size = float(np.ptp(nodes, axis=0).max())
    held, field = _rigid(nodes, dofs, size, len(diagonal))
    still = np.vstack([held, unit @ (field / scale[:, None]) / np.abs(field / scale[:, None]).max()])
    _, resists, ways = np.linalg.svd(np.linalg.qr(still, mode="r"))  # of six columns, however many rows
    free = ways[resists < _NO_FORCE].T
    ways = np.where(np.abs(free) < _ALIKE, 0.0, free)
    moved = _without(_null(unit), field @ ways / scale[:, None]) * scale[:, None]
    return _told(_names(ways), moved, dofs, size)


def _told(whole: tuple[str, ...], moved: FloatArray, dofs: IntArray, size: float) -> FreeMotion:
    """Describe the moving parts, `moved` (n_dofs, k)."""
    # the last entry is that of fixed DOFs
    length = np.append(np.sqrt((moved**2).sum(1)), 0.0)[dofs] * ([1.0] * 3 + [size] * 3)
    shift, turn = length[:, :3].max(1), length[:, 3:].max(1)
    amplitude = shift if shift.max() > _ALIKE * turn.max() else turn
    return FreeMotion(
        whole=whole,
        node=int(np.argmax(amplitude)) if amplitude.max() > 0 else None,
        turns_only=amplitude is turn,
    )


def _rigid(nodes: FloatArray, dofs: IntArray, size: float, n_dofs: int) -> tuple[FloatArray, FloatArray]:
    """Return the six rigid motions at fixed DOFs (n, 6) and at the others (n_dofs, 6), rotations per size."""
    full = np.zeros((*dofs.shape, 6))
    full[:, :3, :3] = np.eye(3)
    for axis in range(3):
        full[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], (nodes - nodes.mean(0)) / size)
        full[:, 3 + axis, 3 + axis] = 1 / size
    field = np.zeros((n_dofs, 6))
    field[dofs[dofs >= 0]] = full[dofs >= 0]
    absent = dofs < 0
    absent[:, 3:] &= (dofs[:, 3:] >= 0).any()  # matrices of nodes that only move hold no turn
    # a part may be held against turning only: weighted as if turned by one size
    return full[absent] * np.tile([1.0] * 3 + [size] * 3, (len(dofs), 1))[absent][:, None], field


def _null(unit: sparse.csc_array) -> FloatArray:
    """Return unit vectors (n_dofs, k) that the scaled stiffness takes to nought, at most a few."""
    n = unit.shape[0]
    if n <= _DENSE:
        value, vector = scipy.linalg.eigh(unit.toarray())
    else:
        lifted = factorise(sparse.csc_array(unit + _SHIFT * sparse.eye_array(n)))
        inverse, start = LinearOperator(unit.shape, matvec=lifted, dtype=float), np.random.default_rng(0)
        value, vector = eigsh(unit, _MAX, sigma=-_SHIFT, OPinv=inverse, v0=start.standard_normal(n))
    return np.asarray(vector[:, value < _NO_STRAIN])


def _without(vectors: FloatArray, others: FloatArray) -> FloatArray:
    """Return the part of orthonormal vectors (n, k) outside the span of others (n, r)."""
    if not others.shape[1]:
        return vectors
    basis = np.linalg.qr(others)[0]
    left = vectors - basis @ (basis.T @ vectors)
    u, size, _ = np.linalg.svd(left, full_matrices=False)
    return np.asarray(u[:, size > 0.5])


def _names(ways: FloatArray) -> tuple[str, ...]:
    """Return the axes along and about which a span (6, r) of rigid motions moves."""
    if not ways.shape[1]:
        return ()
    found = []
    for axis, name in enumerate(_WAYS):
        seen = slice(0, 6) if axis < 3 else slice(3, 6)  # a turn may be about any point
        target = np.eye(6)[axis][seen]
        part = ways[seen] @ np.linalg.lstsq(ways[seen], target, rcond=_ALIKE)[0]
        if np.linalg.norm(part - target) < 1e3 * _ALIKE:
            found.append(name)
    return tuple(found) or ("about an axis askew",)

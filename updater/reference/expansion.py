"""Expansion of measured modes by the local correspondence principle."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray

LARGEST_CLUSTER = 4
_WORST_CONDITION = 10.0  # condition of a cluster at the sensors above which they cannot separate its modes


def expand(shape: FloatArray, model_shape: FloatArray, omega: FloatArray, paired: int, *, largest: int) -> FloatArray:
    """Return t (n_modes,) so that the measured shape is `model_shape.T @ t`, eqs 9 to 11.

    The cluster grows from the paired mode outwards by |omega_k^2 - omega_i^2|; its size is the one with the least
    leave-one-sensor-out error (Brincker et al., MSSP 45 (2014) 91-104), among those whose modes the sensors can
    separate.

    Parameters
    ----------
    shape : (n_channels,) measured, real
    model_shape : (n_modes, n_channels) of the model at the channels
    omega : (n_modes,) [rad/s]
    paired : the model mode that is paired with the measured one
    largest : most modes in a cluster
    """
    near = _outwards(omega, paired)[: min(largest, len(shape) - 1)]
    best = min(_told_apart(model_shape, near), key=lambda n: _left_out_error(shape, model_shape[near[:n]].T))
    t = np.zeros(len(omega))
    t[near[:best]] = np.linalg.lstsq(model_shape[near[:best]].T, shape, rcond=None)[0]
    return t


def _outwards(omega: FloatArray, paired: int) -> IndexArray:
    return np.argsort(np.abs(omega**2 - omega[paired] ** 2), kind="stable")


def well_posed_cluster(model_shape: FloatArray, omega: FloatArray, paired: int, *, largest: int) -> IndexArray:
    """Return the largest cluster of modes about the paired one that the sensors can separate.

    It depends on the model alone, so that the expansion is a smooth function of the data: a cluster selected anew by
    the leave-one-out error of noisy shapes jumps in size, and the increments with it (345 to 505 g).

    Parameters
    ----------
    model_shape : (n_modes, n_channels) of the model at the channels
    omega : (n_modes,) [rad/s]
    paired : the model mode that is paired with the measured one
    largest : most modes in a cluster
    """
    near = _outwards(omega, paired)[: min(largest, model_shape.shape[1] - 1)]
    return near[: _told_apart(model_shape, near)[-1]]


def _told_apart(model_shape: FloatArray, near: IndexArray) -> list[int]:
    """Return how many of the modes near one, counted outwards, the sensors separate; one alone always."""
    sizes = range(2, len(near) + 1)
    return [1, *(n for n in sizes if np.linalg.cond(model_shape[near[:n]]) < _WORST_CONDITION)]


def _left_out_error(shape: FloatArray, cluster: FloatArray) -> float:
    """Sum of squares of each sensor relative to the prediction of the others, by the least modes where it is open.

    Not from the hat matrix: for a mode that only one sensor measures it is zero over zero.
    """
    every = np.arange(len(shape))
    others = np.array([np.delete(every, i) for i in every])
    t = np.linalg.pinv(cluster[others]) @ shape[others][:, :, None]
    return float(((shape - np.einsum("ik,ik->i", cluster, t[:, :, 0])) ** 2).sum())


def orthonormal(t: FloatArray) -> FloatArray:
    """Return the nearest matrix (m, m) with orthonormal columns to t (m, m): its polar factor (Loewdin 1950)."""
    u, _, vh = np.linalg.svd(t, full_matrices=False)
    return np.asarray(u @ vh)


def orthonormal_slope(t: FloatArray, column: int, slope: FloatArray) -> FloatArray:
    """Return the derivative (m * m, k) of `orthonormal`, flattened by rows, with respect to one column of t (m, m).

    With t = U P, W = U^T dt - dt^T U and dU = U Z: Z P + P Z = W, which the axes of P solve entry by entry.

    Parameters
    ----------
    t : (m, m) coordinates of modes in a cluster [-]
    column : number of the column that depends on the inputs
    slope : (m, k) its derivatives with respect to k inputs [1/unit of the input]
    """
    u, p, vh = np.linalg.svd(t)
    moved = np.zeros((slope.shape[1], *t.shape))
    moved[:, :, column] = slope.T
    along = u.T @ moved @ vh.T
    turn = (along - along.transpose(0, 2, 1)) / (p[:, None] + p)
    return np.asarray((u @ turn @ vh).reshape(len(moved), -1).T)


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpandedChange:
    """A measured mode as the reference's plus its change since the baseline, at unit norm (eq. 12)."""

    t: FloatArray  #: (n_modes,)
    by_event: FloatArray  #: (n_modes, n_channels) derivative by the event's shape
    by_base: FloatArray  #: (n_modes, n_channels) derivative by the baseline's
    inverse: FloatArray  #: (n_modes, n_channels) least squares in the cluster
    toward: FloatArray  #: (n_modes,) mode that fixes the sign
    constant: FloatArray  #: (n_modes,) added to the expanded unit shape

    def expand(self, shape: FloatArray) -> FloatArray:
        """Return t (..., n_modes) of other shapes (..., n_channels) in the same cluster."""
        after = shape @ self.inverse.T
        after = after / np.linalg.norm(after, axis=-1, keepdims=True)
        after = np.where((after @ self.toward)[..., None] < 0, -after, after) + self.constant
        return np.asarray(after / np.linalg.norm(after, axis=-1, keepdims=True))


def expand_change(
    shape: FloatArray, base: FloatArray, model_shape: FloatArray, cluster: IndexArray, paired: int
) -> ExpandedChange:
    """Expand the change of a shape since the baseline in a cluster of modes.

    Each of the two is expanded by eqs 9 to 12 of the paper; their difference is added to the paired mode. The part of
    the undisturbed shape outside the cluster cancels, and an unchanged shape is the paired mode itself.

    Parameters
    ----------
    shape, base : (n_channels,) since the change, and before it [-]
    model_shape : (n_modes, n_channels) of the model at the channels
    cluster : (m,) modes of the model to expand in
    paired : the one that is paired with the measured mode
    """
    inverse = np.zeros((len(model_shape), len(shape)))
    inverse[cluster] = np.linalg.pinv(model_shape[cluster].T)
    before, by_base = _unit(inverse @ base, inverse)
    after, by_event = _unit(inverse @ shape, inverse)
    if before[paired] < 0:
        before, by_base = -before, -by_base
    if after @ before < 0:
        after, by_event = -after, -by_event
    constant = -before
    constant[paired] += 1
    t, turn = _unit(after + constant, np.eye(len(before)))
    return ExpandedChange(
        t=t, by_event=turn @ by_event, by_base=-turn @ by_base, inverse=inverse, toward=before, constant=constant
    )


def expand_shape(
    shape: FloatArray, model_shape: FloatArray, omega: FloatArray, paired: int, *, largest: int
) -> ExpandedChange:
    """Expand a shape (n_channels,) itself, as the paper does (eqs 9 to 12); parameters as for `expand`.

    The derivative holds within the chosen cluster. Noise can make it another one; t is discontinuous there.
    """
    cluster = np.flatnonzero(expand(shape, model_shape, omega, paired, largest=largest))
    inverse = np.zeros((len(model_shape), len(shape)))
    inverse[cluster] = np.linalg.pinv(model_shape[cluster].T)
    t, by_event = _unit(inverse @ shape, inverse)
    sign, toward = (-1.0 if t[paired] < 0 else 1.0), np.eye(len(t))[paired]
    none = np.zeros_like(by_event)
    return ExpandedChange(
        t=sign * t, by_event=sign * by_event, by_base=none, inverse=inverse, toward=toward, constant=np.zeros(len(t))
    )


def _unit(vector: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a vector (n,) at unit norm, and its slope (n, k) from the vector's own."""
    length = float(np.linalg.norm(vector))
    unit = vector / length
    return unit, (slope - np.outer(unit, unit @ slope)) / length

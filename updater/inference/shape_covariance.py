"""Covariance of mode shape errors: shares of other modes that a change, or a wrong model, brings in."""

from collections.abc import Sequence

import numpy as np

from daq import FloatArray, IndexArray
from updater.modal_data import Mixing, ModalMean
from updater.reference import Reference

SHAPE_BIAS = 6e-4  #: relative to a unit shape: error of identification beyond its noise, different after a change
_MAX_TURNED = 0.5  # rad: largest rotation of close modes into each other by such an error
_MIXED = 0.05  # rad: from about where on noise turns modes into each other most of all
_MIN_GAP = 1e-6  # of squared frequencies, and of shapes
_MAX_IMAGINARY = 0.98  # of the real part's square: beyond it a phase is not known
#: between errors of two modes by a mesh, as a root mean square; measured on four plates
#: (docs/validation/model/mesh_error.md)
_COHERENCE = 1 / 3
_UNSEEN = 1e-100  # [1/sqrt(kg)] a mode without motion at the channels
_USUAL_DAMPING = 5e-3  # [-] where it is not known: how complex modes that come closer may become


def foreign_modes(
    reference: Reference,
    tracks: IndexArray,
    ratio: FloatArray,
    at_channels: FloatArray,
    error: FloatArray,
    typical_shift: float = 0.0,
) -> FloatArray:
    """Return how far a wrong displacement where something has changed brings other modes into compared shapes.

    A mass m at a point where mode i moves by u_i lowers it by d_i = m u_i^2 / 2, couples it with mode k by m u_i u_k,
    and turns it towards k by that times omega_i^2 / (omega_k^2 - omega_i^2); a spring does the same. If u_i is wrong by
    e_i times its typical size, d_i is wrong by 2 e_i (d_i d)^1/2 and the coupling by 2 (d (e_i^2 d_k + e_k^2 d_i))^1/2,
    d the mean of all: most where modes are close, and not nothing where a mode has its node. At a place where all modes
    move less than they typically do, d is the shift that the same change would cause at a typical place. Where mode k
    moves more, u_i is wrong by e_i times that, as modes of a model are turned into each other: d_k is used for d.

    Parameters
    ----------
    ratio : (n_modes,) of log frequencies to those before, NaN where it is not known
    error : (n_modes,) of the displacements of the reference's modes, relative to their typical size

    Returns
    -------
    (n, n_modes, n_channels)
        Standard deviation of each mode's share in unit shapes, times the mode.
    """
    paired = reference.paired[tracks]
    shift = _every_shift(ratio, paired)
    own = shift[paired, None]
    least = max(float(own.mean()), typical_shift)
    wrong = error[paired, None] ** 2 * shift * np.maximum(shift, least) + error**2 * own * np.maximum(own, least)
    coupling = 2 * np.sqrt(wrong)
    closeness = np.maximum(*_closeness(reference.frequency, paired, ratio))
    return _towards(np.minimum(coupling * closeness, _MAX_TURNED), paired, at_channels)


def shape_error_of_mesh(frequency: FloatArray, mesh_error: FloatArray) -> FloatArray:
    """Return the standard deviation (n_modes,) of shapes by the error of a mesh, relative to typical displacements.

    A mesh adds a positive semidefinite error D to the stiffness, of which phi_i^T D phi_i = 2 e_i omega_i^2 is known
    from the error e_i of the frequency. By the inequality of Cauchy and Schwarz, |phi_i^T D phi_k| is at most
    2 (e_i e_k)^1/2 omega_i omega_k. To first order, a shape has that over omega_k^2 - omega_i^2 of mode k, times the
    coherence of the two errors.

    Parameters
    ----------
    frequency : (n_modes,) of the reference [Hz]
    mesh_error : (n_modes,) relative error of its frequencies by the mesh
    """
    amplitude = np.sqrt(2 * mesh_error) * frequency
    apart = np.abs(frequency[:, None] ** 2 - frequency**2)
    bound = np.outer(amplitude, amplitude) / np.maximum(apart, _MIN_GAP * frequency**2)
    np.fill_diagonal(bound, 0.0)
    return _COHERENCE * np.asarray(np.linalg.norm(np.minimum(bound, _MAX_TURNED), axis=1))


def mixed_by_change(reference: Reference, tracks: IndexArray, ratio: FloatArray) -> FloatArray:
    """Return the share (n,) of other modes that a change of this size may have mixed into each compared one.

    To first order, a body that lowers modes i and k by d_i and d_k turns one towards the other by 2 (d_i d_k)^1/2
    omega_i^2 / (omega_k^2 - omega_i^2); a spring does the same. The share is the square of that, at most one: modes
    that are farther apart than they have moved keep their own.

    Parameters
    ----------
    ratio : (n_modes,) as of `foreign_modes`
    """
    paired = reference.paired[tracks]
    shift = _every_shift(ratio, paired)
    closeness = np.maximum(*_closeness(reference.frequency, paired, ratio))
    turned = 2 * np.sqrt(shift[paired, None] * shift) * closeness
    return np.asarray(np.minimum((turned**2).sum(1), 1.0))


def nearer_modes(
    reference: Reference, tracks: IndexArray, ratio: FloatArray, at_channels: FloatArray, damping: FloatArray
) -> FloatArray:
    """Return how complex modes may have become that came closer or parted.

    Two modes that are damped together are complex by their closeness omega_i^2 / |omega_k^2 - omega_i^2| times twice
    the damping at most; half of that is expected of a change of closeness.

    Parameters
    ----------
    ratio : (n_modes,) as of `foreign_modes`

    Returns
    -------
    (n, n_modes, n_channels)
        Standard deviation of each mode's imaginary share in unit shapes, times the mode.
    """
    paired = reference.paired[tracks]
    before, after = _closeness(reference.frequency, paired, ratio)
    share = np.where(damping > 0, damping, _USUAL_DAMPING)[:, None] * np.abs(after - before)
    return _towards(np.minimum(share, _MAX_TURNED), paired, at_channels)


def turned_by_noise(
    reference: Reference, tracks: IndexArray, ratio: FloatArray, at_channels: FloatArray, means: Sequence[ModalMean]
) -> FloatArray:
    """Return how far noise turns modes into each other, with the baseline's windows and with the event's.

    A scatter s of a mode's frequency rotates it towards another by about s over their distance, its real and its
    imaginary part alike: perturbed eigenvectors (Wilkinson, 1965, ch. 2). Between modes 0.3 % apart, as of a tower with
    nearly equal sides, that is 0.1 to 0.3 rad in a window of 50 s. It is then all of the stated deviation of the
    shape's components, more where the other mode is larger, and they are fully correlated.

    Parameters
    ----------
    ratio : (n_modes,) as of `foreign_modes`
    means : (n,) before and after

    Returns
    -------
    (n, n_modes, n_channels)
        Standard deviation of each mode's share in unit shapes, times the mode.
    """
    paired = reference.paired[tracks]
    square = np.zeros((len(paired), len(reference.frequency)))
    for mean, closeness in zip(means, _closeness(reference.frequency, paired, ratio), strict=True):
        turn = (2 * mean.log_frequency_std[:, None] * closeness) ** 2
        stated = np.nan_to_num((mean.shape_std**2).sum(1))[:, None]
        square += turn + stated * turn / (turn + _MIXED**2)
    return _towards(np.minimum(np.sqrt(square), _MAX_TURNED), paired, at_channels)


def along_changed_modes(
    share: FloatArray, paired: IndexArray, at_channels: FloatArray, base: FloatArray, shape: FloatArray
) -> FloatArray:
    """Return the additional errors along other modes whose shapes the change has altered.

    Modes that are close after the change mix along their present shapes. With errors along the baseline's shapes alone,
    a rotation of half a radian would leave the altered part of the other mode in the residual.

    Parameters
    ----------
    share : (n, n_modes) standard deviation of other modes' share in unit shapes
    paired : (n,) model mode of each compared one
    at_channels : (n_channels, n_modes)
    base, shape : (n, n_channels) of the compared modes before and now, unit norm

    Returns
    -------
    (n, n, n_channels)
        Of each compared mode along each other one as it is now, less what lies along the baseline's.
    """
    now = turned_back(beside(shape[:, None], shape), shape, base).transpose(1, 0, 2)
    before = beside(at_channels[:, paired].T, base[:, None])
    length = np.linalg.norm(before, axis=2)
    others = (length > _MIN_GAP * np.linalg.norm(at_channels[:, paired], axis=0)) & ~np.eye(len(paired), dtype=bool)
    altered = beside(now, np.where(others[:, :, None], before, 1.0))
    return np.asarray(np.where(others, share[:, paired], 0.0)[:, :, None] * altered)


def by_unmeasured(mixing: Mixing, paired: IndexArray, at_channels: FloatArray, base: FloatArray) -> FloatArray:
    """Return the errors of compared shapes by wrong frequencies of modes that were not measured.

    Parameters
    ----------
    paired : (n,) model mode of each compared one
    base : (n, n_channels) of the compared modes before, unit norm

    Returns
    -------
    (n, n_errors, n_channels)
        Standard deviation in unit shapes by each of these frequencies, orthogonal to the baseline's shape.
    """
    now = (at_channels @ mixing.shape[:, paired]).T
    length = np.linalg.norm(now, axis=1, keepdims=True)
    turned = (at_channels @ mixing.turned[:, :, paired]).transpose(0, 2, 1) / length
    error = turned_back(beside(turned, now / length), now / length, base)
    size = np.maximum(np.linalg.norm(error, axis=2, keepdims=True), _UNSEEN)
    return np.asarray(error * np.minimum(_MAX_TURNED / size, 1.0)).transpose(1, 0, 2)


def own_phases(shape: FloatArray, imaginary: FloatArray, variance: FloatArray, base: FloatArray) -> FloatArray:
    """Return how far the phases that make imaginary parts least are off: real parts take up as much of those.

    Along an imaginary part of norm q^1/2 a real part of norm one has the variance s^2 (1 + q) / (1 - q)^2, to first
    order in s: much where a mode is as imaginary as real, as with a channel that is a quarter period late.

    Parameters
    ----------
    shape, imaginary : (n, n_channels) parts of measured modes, the real one of unit norm; zeros where not known
    variance : (n, n_channels) s^2 of a component of either
    base : (n, n_channels) unit norm

    Returns
    -------
    (n, 1, n_channels)
        Standard deviation of the rotation times the imaginary part, orthogonal to the baseline's shape.
    """
    share = np.minimum((imaginary**2).sum(1), _MAX_IMAGINARY)
    turn = np.sqrt(variance.mean(1) * (3 - share)) / (1 - share)
    return np.asarray(turn[:, None] * turned_back(beside(imaginary, shape), shape, base))[:, None]


def _towards(turned: FloatArray, paired: IndexArray, at_channels: FloatArray) -> FloatArray:
    """Return rotations (n, n_modes) towards other modes as parts of unit shapes, each of norm one at most.

    A mode that hardly moves at the channels has there any shape: no error of a unit shape is larger.
    """
    length = np.maximum(np.linalg.norm(at_channels, axis=0), _UNSEEN)
    share = np.minimum(turned * (length / length[paired, None]), 1.0)
    return np.asarray(share[:, :, None] * (at_channels / length).T)


def _every_shift(ratio: FloatArray, paired: IndexArray) -> FloatArray:
    """Return the size of the shift of every mode (n_modes,): where it is not known, the mean of the compared ones."""
    return np.asarray(np.where(np.isnan(ratio), np.abs(ratio[paired]).mean(), np.abs(ratio)))


def _closeness(frequency: FloatArray, paired: IndexArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return omega_i^2 / |omega_k^2 - omega_i^2| (n, n_modes) before the change and after.

    A mode of which the shift is not known is assumed as close as twice the mean shift of the compared ones permits.
    """
    reach = 2 * np.abs(ratio[paired]).mean()
    own, now = frequency[paired, None], (frequency * np.exp(ratio))[paired, None]
    nearest = np.clip(now, frequency * np.exp(-reach), frequency * np.exp(reach))
    after = np.where(np.isnan(ratio), nearest, frequency * np.exp(ratio))
    itself = np.arange(len(frequency)) == paired[:, None]
    gaps = (np.abs((frequency / own) ** 2 - 1), np.abs((after / now) ** 2 - 1))
    was, became = (np.where(itself, 0.0, 1 / np.maximum(gap, _MIN_GAP)) for gap in gaps)
    return was, became


def shape_whiteners(variance: FloatArray, base: FloatArray, foreign: FloatArray) -> FloatArray:
    """Return inverse Cholesky factors (n, n_channels, n_channels) of `shape_covariances`."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(shape_covariances(variance, base, foreign))))


def shape_covariances(variance: FloatArray, base: FloatArray, foreign: FloatArray) -> FloatArray:
    """Return the shapes' covariances (n, n_channels, n_channels).

    Parameters
    ----------
    variance : (n, n_channels) of the measurement
    base : (n, n_channels) unit shapes
    foreign : (n, n_modes, n_channels) of other modes, by errors of the reference
    """
    error = beside(foreign, base[:, None])
    return np.asarray(variance[:, :, None] * np.eye(variance.shape[1]) + error.transpose(0, 2, 1) @ error)


def inner(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the inner products (..., 1) of shapes (..., n_channels), without an array of all products."""
    return np.asarray(np.einsum("...i,...i->...", one, other))[..., None]


def beside(shape: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the part of shapes that is orthogonal to others.

    Parameters
    ----------
    shape, direction : (..., n_channels), (..., n_channels) of unit norm [-]
    """
    return np.asarray(shape - inner(shape, direction) / inner(direction, direction) * direction)


def turned_back(rest: FloatArray, shape: FloatArray, base: FloatArray) -> FloatArray:
    """Return the part orthogonal to predicted shapes as it is to the baseline's, by the rotation between them.

    There the errors are known. A mode that has turned far towards its neighbour has as much less of itself: that is no
    error of its own.

    Parameters
    ----------
    rest : (..., n, n_channels) orthogonal to `shape`
    shape : (..., n, n_channels) predicted, of any norm and sign
    base : (n, n_channels) unit norm
    """
    along = inner(shape, base)
    length = np.maximum(np.sqrt(inner(shape, shape)), 1e-300)
    unit = shape * (np.where(along < 0, -1.0, 1.0) / length)
    share = inner(rest, base) / (1 + np.abs(along) / length)
    return np.asarray(rest - share * (unit + base))

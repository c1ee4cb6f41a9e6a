"""Expected reference of a planned rig, from the structure file alone."""

import numpy as np

from daq import FloatArray, IndexArray
from oma import mac_matrix
from updater.fe import Model, Modes
from updater.modal_data import NO_DELAYS, ModalMean, Scatter, TrackedModes
from updater.planning.record_noise import Record, shape_errors
from updater.reference import Calibration, Reference

UNSEEN = 0.05  #: share of a mode's largest motion under which sensors do not see it [-]
# relative to a typical motion, 1 / sqrt(total mass): a smaller one is only a rotation, of a bar about its axis
_STILL = 1e-6
_ALIKE = 0.9  # MAC at the sensors of two modes that are as good as one


def seen_by(model: Model, modes: Modes) -> FloatArray:
    """Return each mode's largest motion at a sensor over its largest at a node (n_modes,) [-], at most 1.

    A sensor off the axis of a member that turns may move more than any node: its mode is then also fully visible.
    """
    at_sensors = model.sensor_rows @ modes.shape
    ratio = np.abs(at_sensors).max(axis=0, initial=0.0) / largest_motion(model, modes)
    return np.asarray(np.minimum(ratio, 1.0))


def largest_motion(model: Model, modes: Modes) -> FloatArray:
    """Return each mode's largest motion of a node (n_modes,) [1/sqrt(kg)]; never nothing, of one that only turns."""
    anywhere = np.linalg.norm(motion(model, modes), axis=2).max(1)
    return np.asarray(np.maximum(anywhere, _STILL / np.sqrt(model.total_mass())))


def told_apart(model: Model, modes: Modes, record: Record) -> IndexArray:
    """Return the modes (n,) that a record of the sensors shows as modes of their own.

    A mode that has its neighbour within a resonance's width and the same shape at the sensors is one with it.
    """
    visible = np.flatnonzero((seen_by(model, modes) >= UNSEEN) & (modes.frequency <= record.highest))
    at_sensors = (model.sensor_rows @ modes.shape[:, visible]).T
    found: list[int] = []
    for k, mode in enumerate(visible):
        near = [i for i in found if np.log(modes.frequency[mode] / modes.frequency[visible[i]]) < 2 * record.damping]
        if not near or mac_matrix(at_sensors[near], at_sensors[[k]]).max() <= _ALIKE:
            found.append(k)
    return visible[found]


def motion(model: Model, modes: Modes) -> FloatArray:
    """Return the translations (n_modes, n_nodes, 3) of the nodes in modes of unit modal mass [1/sqrt(kg)]."""
    padded = np.vstack([modes.shape, np.zeros((1, modes.shape.shape[1]))])
    return np.asarray(np.moveaxis(padded[model.dofs[:, :3]], 2, 0))


def expected_reference(model: Model, modes: Modes, seen: IndexArray, record: Record) -> Reference:
    """Return a model as a reference, with the errors that one record's modes will have.

    Parameters
    ----------
    model, modes : of the structure, sensors among it
    seen : (n,) modes that will be measured
    record : how long
    """
    at, frequency = model.sensor_rows @ modes.shape, modes.frequency[seen]
    error = shape_errors(at, record.leaks(modes.frequency, seen), at[:, seen].T)
    blur = record.blur(frequency)
    log_std = record.log_frequency_std(frequency)
    baseline = ModalMean(
        channels=model.structure.channels,
        n=np.ones(len(seen), np.intp),
        log_frequency=np.log(frequency),
        log_frequency_std=log_std,
        damping=np.full(len(seen), record.damping),
        damping_std=np.full(len(seen), np.nan),
        shape=(at[:, seen] / np.linalg.norm(at[:, seen], axis=0)).T,
        shape_std=np.sqrt((error**2).sum(1) + blur[:, None] ** 2),
        imaginary=np.full((len(seen), len(at)), np.nan),
        imaginary_std=np.full((len(seen), len(at)), np.nan),
    )
    scatter = Scatter(
        frequency_factor=1.0,
        shape_factor=1.0,
        shape_overdispersion=_overdispersion(error, blur),
        phase_factor=1.0,
        phase_overdispersion=1.0,
        damping_factor=1.0,
        degrees_of_freedom=len(seen),
        window_std=log_std,
    )
    own = np.arange(len(seen))
    calibration = Calibration(
        structure=model.structure,
        nominal=model.structure,
        model=model,
        modes=modes,
        tracks=own,
        paired=seen,
        n_nominal=len(seen),
        nominal_frequency=frequency,
        nominal_mac=np.ones(len(seen)),
        parameters=(),
        reason="not_fitted",
        knobs=(),
    )
    return Reference(
        measured=False,
        calibration=calibration,
        baseline=baseline,
        scatter=scatter,
        frequency=modes.frequency,
        shape=modes.shape,
        windows=_no_windows(baseline),
        delays=NO_DELAYS,
    )


def _overdispersion(error: FloatArray, blur: FloatArray) -> float:
    """Return tr(R^2) / tr(R), pooled over modes, of the correlation R of `shape_covariance`.

    Of R = A^T A + D with a diagonal D the trace of the square is |A A^T|^2 + 2 tr(A^T A D) + tr(D^2), which takes no
    matrix of channels by channels.
    """
    variance = (error**2).sum(1) + blur[:, None] ** 2
    along, own = error / np.sqrt(variance)[:, None], blur[:, None] ** 2 / variance
    squares = ((along @ along.transpose(0, 2, 1)) ** 2).sum() + (own * (2 - own)).sum()
    return float(squares / variance.size)


def shape_covariance(error: FloatArray, blur: FloatArray) -> FloatArray:
    """Return covariances (n, n_channels, n_channels) of unit shapes.

    Parameters
    ----------
    error : (n, n_modes, n_channels) along other modes, a standard deviation each
    blur : (n,) additional deviation of each component
    """
    return np.asarray(np.einsum("ikc,ikd->icd", error, error) + blur[:, None, None] ** 2 * np.eye(error.shape[2]))


def _no_windows(baseline: ModalMean) -> TrackedModes:
    flat, shaped = np.zeros((0, len(baseline.n))), np.zeros((0, *baseline.shape.shape))
    return TrackedModes(
        channels=baseline.channels,
        log_frequency=flat,
        log_frequency_std=flat,
        damping=flat,
        damping_std=flat,
        shape=shaped,
        shape_std=shaped,
        imaginary=shaped,
    )

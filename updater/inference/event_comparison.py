"""Construction of the comparison of an event with the baseline, block by block of data."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from updater.errors import ModalDataError
from updater.fe import self_stress
from updater.inference.comparison import (
    LEAST_VARIANCE,
    Comparison,
    NominalModes,
    whiteners_of,
)
from updater.inference.known_mass import mass_tests
from updater.inference.new_shapes import new_shapes
from updater.inference.phases_and_damping import damping_changes, imaginary_parts, unsure_of
from updater.inference.sensor_errors import sensor_errors, sensor_errors_of_mixed, without_sensor_errors
from updater.inference.shape_covariance import (
    SHAPE_BIAS,
    along_changed_modes,
    beside,
    by_unmeasured,
    foreign_modes,
    mixed_by_change,
    nearer_modes,
    own_phases,
    shape_error_of_mesh,
    shape_whiteners,
    turned_by_noise,
)
from updater.modal_data import (
    NOTHING_KNOWN,
    USUAL_OVERDISPERSION,
    Circumstances,
    Mixing,
    ModalMean,
    Scatter,
    check_event,
)
from updater.reference import Reference, match_nominal_modes

MODEL_ERROR = 0.01  #: relative to a mode's typical displacement: error of the reference at any point
# times the error e of a mesh: relative error of a mode's displacement, whose square is 4 e too large. Frequencies have
# e: the part that all modes have in common is an error of the size (`Comparison.size_error`)
_MESH_ERROR_OF_DISPLACEMENT = 2.0
_BIAS_OF_BANDWIDTH = 0.1  # times the change of a mode's half bandwidth: resulting error of identification


def compare(
    reference: Reference,
    event: ModalMean,
    *,
    circumstances: Circumstances = NOTHING_KNOWN,
    model_error: float = MODEL_ERROR,
    typical_shift: float = 0.0,
) -> Comparison:
    """Compare an event with the baseline.

    Parameters
    ----------
    reference : learned before
    event : (n_tracks,) mean of the windows since; NaN where a track is not seen, or only its frequency is known
    circumstances : further knowledge of the event
    model_error : error of the reference at any point, relative to a mode's typical displacement [-]; a larger one gives
        a coarser search that misses less. The error of a mesh of faces adds to it
    typical_shift : relative shift of frequencies [-] that the change would cause at a typical place, if it is known to
        be more than the mean of those measured: the error of the model is relative to it

    Raises
    ------
    ModalDataError
        If fewer than three modes or two channels can be compared, or the event's modes cannot be right.
    """
    channels = reference.comparable(event.channels)
    if len(channels) < 2:
        raise ModalDataError(f"channels to compare: expected at least 2 in both, found {len(channels)}")
    base, event = reference.baseline_at(channels), event.at(channels)
    tracks = np.flatnonzero(np.isfinite(event.log_frequency))
    if len(tracks) < 3:
        raise ModalDataError(f"modes to compare: expected at least 3, found {len(tracks)}")
    base, event = base.only(tracks), event.only(tracks)
    check_event(base, event)
    base = without_sensor_errors(reference, tracks, base)
    of_mesh = reference.calibration.frequency_error.mesh
    mesh_error = of_mesh[reference.paired[tracks]]
    mixed = shape_error_of_mesh(reference.frequency, of_mesh)
    of_model = (model_error * reference.model_error_factor) ** 2 + mixed**2
    error = np.sqrt(of_model + of_mesh**2)[reference.paired[tracks]]
    overdispersion, scatter = reference.scatter.shape_overdispersion, _scatter_of_both(reference, base, event)
    late = unsure_of(reference, base, event, circumstances)
    ratio = event.log_frequency - base.log_frequency
    at_channels = reference.at_channels(channels)
    expected = at_channels[:, reference.paired[tracks]].T
    every = _of_every_mode(reference, tracks, ratio, circumstances)
    by_noise = turned_by_noise(reference, tracks, every, at_channels, (base, event))
    displaced = np.sqrt(of_model + (_MESH_ERROR_OF_DISPLACEMENT * of_mesh) ** 2)
    foreign = foreign_modes(reference, tracks, every, at_channels, displaced, typical_shift)
    share = np.hypot(np.linalg.norm(foreign, axis=2), np.linalg.norm(by_noise, axis=2))
    now = np.where(np.isfinite(event.shape), event.shape, base.shape)
    altered = along_changed_modes(share, reference.paired[tracks], at_channels, base.shape, now)
    foreign = np.concatenate([foreign, by_noise, altered], axis=1)
    common_deviation = reference.common_error[tracks]
    sign = np.where((event.shape * base.shape).sum(1) < 0, -1, 1)[:, None]
    common_errors = _common_to_modes(base.shape, sign * now, ratio, mesh_error)
    if circumstances.mixing is not None:
        more = errors_of_unmeasured(reference, tracks, channels, circumstances.mixing, base.shape)
        common_deviation = np.concatenate([common_deviation, more.log_frequency], axis=1)
        foreign = np.concatenate([foreign, more.shape], axis=1)
        common_errors = np.concatenate([common_errors, more.sensors], axis=2)
    nearer = nearer_modes(reference, tracks, every, at_channels, base.damping)
    nearer = np.concatenate([nearer, by_noise], axis=1)
    return Comparison(
        channels=channels,
        tracks=tracks,
        paired=reference.paired[tracks],
        mesh_error=mesh_error,
        **_frequencies_of(base, event, error, typical_shift, common_deviation),
        **_shapes_of(base, event, sign, scatter, max(reference.delays.wander, circumstances.wander), foreign),
        sensor_errors=sensor_errors(reference, tracks, channels),
        common_errors=common_errors,
        **imaginary_parts(base, event, sign, scatter, nearer, late),
        **damping_changes(base, event, mixed_by_change(reference, tracks, every)),
        mass_tests=mass_tests(reference, tracks, event, error, circumstances.known_masses),
        nominal=_nominal_modes(reference, tracks, channels, base),
        model_base=expected / np.linalg.norm(expected, axis=1, keepdims=True),
        at_channels=at_channels,
        across=reference.across_channels(channels),
        frequency=reference.frequency,
        n_stress=self_stress(reference.model).n,
        circumstances=circumstances,
        new=new_shapes(
            circumstances.extra, channels, overdispersion, at_channels, reference.frequency, float(error.max())
        ),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorsOfUnmeasured:
    """Standard deviations of compared modes by modes that were not measured, which a change mixes into them."""

    log_frequency: FloatArray  #: (n, n_errors) of ln f by their frequencies
    shape: FloatArray  #: (n, n_errors, n_channels) of unit shapes by these
    #: (n, n_channels, n_errors) of unit shapes by the sensors that read them, with one factor for all modes
    sensors: FloatArray


def errors_of_unmeasured(
    reference: Reference, tracks: IndexArray, channels: tuple[str, ...], mixing: Mixing, base: FloatArray
) -> ErrorsOfUnmeasured:
    """Return the errors of compared modes by modes that were not measured.

    Parameters
    ----------
    tracks : (n,) of the reference
    channels : compared ones
    mixing : of the reference's modes by a change
    base : (n, n_channels) of the compared modes before, unit norm
    """
    paired = reference.paired[tracks]
    return ErrorsOfUnmeasured(
        log_frequency=mixing.log_frequency[:, paired].T,
        shape=by_unmeasured(mixing, paired, reference.at_channels(channels), base),
        sensors=sensor_errors_of_mixed(reference, tracks, channels, mixing, base),
    )


def _of_every_mode(
    reference: Reference, tracks: IndexArray, ratio: FloatArray, circumstances: Circumstances
) -> FloatArray:
    """Return the log ratios (n_modes,) of frequencies: measured, else of the circumstances, or NaN."""
    mixing = circumstances.mixing
    every = np.full(len(reference.frequency), np.nan) if mixing is None else mixing.shifts.copy()
    every[reference.paired[tracks]] = ratio
    return every


def _common_to_modes(base: FloatArray, now: FloatArray, ratio: FloatArray, mesh_error: FloatArray) -> FloatArray:
    """Return the standard deviations of unit shapes (n, n_channels, n_errors) by a mesh, common to all modes.

    A mesh that is too stiff where a sensor is makes its motion there wrong by one factor in all modes: that of the
    change is an error of each channel. The modes count by the squares of their shifts.
    """
    if not mesh_error.any():
        return np.zeros((*base.shape, 0))
    size = _MESH_ERROR_OF_DISPLACEMENT * float(np.average(mesh_error, weights=ratio**2 + LEAST_VARIANCE))
    error = size * (now - base)[:, :, None] * np.eye(base.shape[1])
    return beside(error, base[:, None]).transpose(0, 2, 1)


def _scatter_of_both(reference: Reference, base: ModalMean, event: ModalMean) -> Scatter:
    """Return the scatter with the overdispersion of the difference of the event's shapes and the baseline's.

    A model in the place of a measured baseline has errors of its own at the sensors. How the noise of windows is
    correlated concerns the event alone: of a sum of independent errors with variances a and b of each component, the
    overdispersion tr(R^2) / tr(R) is (a^2 o_a + 2 a b + b^2 o_b) / (a + b)^2.

    Parameters
    ----------
    base, event : (n,) of the modes compared
    """
    scatter = reference.scatter
    if not reference.of_file or not np.isfinite(event.shape).any():
        return scatter
    noise, model = (float(np.nanmean(one.shape_std**2)) for one in (event, base))
    of_phases = float(np.nanmean(base.imaginary_std**2))
    return replace(
        scatter,
        shape_overdispersion=_of_sum(noise, scatter.shape_overdispersion, model),
        phase_overdispersion=_of_sum(noise, scatter.phase_overdispersion, of_phases),
    )


def _of_sum(noise: float, overdispersion: float, model: float) -> float:
    """Return the overdispersion of noise and of errors of a model, by their variances."""
    return (noise**2 * overdispersion + 2 * noise * model + model**2 * USUAL_OVERDISPERSION) / (noise + model) ** 2


def _nominal_modes(
    reference: Reference, tracks: IndexArray, channels: tuple[str, ...], base: ModalMean
) -> NominalModes | None:
    """Return the modes of an inconsistent structure file for the compared modes; None if it is consistent."""
    if reference.nominal is None:
        return None
    there = reference.nominal.reference
    answer = match_nominal_modes(reference, reference.nominal, channels)[reference.paired[tracks]]
    shape = there.at_channels(channels).T[answer]
    shape = shape / np.linalg.norm(shape, axis=1, keepdims=True)
    sign = np.where((shape * base.shape).sum(1) < 0, -1, 1)[:, None]
    return NominalModes(log_ratio=np.log(there.frequency[answer]) - base.log_frequency, shape=sign * shape)


def _frequencies_of(
    base: ModalMean, event: ModalMean, error: FloatArray, typical_shift: float, common: FloatArray
) -> dict[str, Any]:
    """Return the data of log frequencies.

    Parameters
    ----------
    base, event : (n,) of the modes compared
    error : (n,) of the reference at any point, relative to a mode's typical displacement
    typical_shift : of the change at a typical place, at least the mean of those measured
    common : (n, n_errors) standard deviations by errors of a model that have one factor for all modes
    """
    ratio = event.log_frequency - base.log_frequency
    shift = np.abs(ratio)
    by_model = (2 * error) ** 2 * shift * max(shift.mean(), typical_shift)
    wider = np.nan_to_num(_BIAS_OF_BANDWIDTH * (event.damping - base.damping))
    measured = np.maximum(event.log_frequency_std**2 + base.log_frequency_std**2, LEAST_VARIANCE)
    variance = measured + by_model + wider**2
    plain, drifting = whiteners_of(np.diag(variance) + common @ common.T)
    return {
        "log_ratio": ratio,
        "log_frequency_std": event.log_frequency_std,
        "plain": plain,
        "drifting": drifting,
        "model_variance": by_model,
        "common_deviation": common,
    }


def _shapes_of(
    base: ModalMean,
    event: ModalMean,
    sign: FloatArray,
    scatter: Scatter,
    wander: float,
    foreign: FloatArray,
) -> dict[str, Any]:
    """Return the data of the shapes' real parts.

    Components with correlated errors are fewer data: each has a lower weight, all together their actual information.

    Parameters
    ----------
    base, event : (n,) of the modes compared
    sign : (n, 1) that turns the event's shapes to the baseline's
    scatter : of the difference
    wander : of clocks within a window [s]
    foreign : (n, n_modes, n_channels) shares of other modes, by errors of the reference
    """
    shaped = np.asarray(np.isfinite(event.shape).all(1))
    known = shaped[:, None]
    overdispersion = scatter.shape_overdispersion
    spread = overdispersion * (np.where(known, event.shape_std, 0.0) ** 2 + base.shape_std**2)
    blurred = _blurred(event, wander)[:, None] * base.shape
    shape = np.where(known, event.shape * sign, base.shape)
    imaginary = np.where(known & np.isfinite(event.imaginary), event.imaginary, 0.0)
    turned = np.concatenate([foreign, own_phases(shape, imaginary, spread, base.shape)], axis=1)
    return {
        "shaped": shaped,
        "shape": shape,
        "base": base.shape,
        "shape_whitener": shaped[:, None, None]
        * shape_whiteners(spread + SHAPE_BIAS**2 + blurred**2, base.shape, turned),
        "overdispersion": overdispersion,
    }


def _blurred(event: ModalMean, wander: float) -> FloatArray:
    """Return the share of a shape's component (n,) that a clock's wander [s] takes, here and there: 1 - cos(omega tau).

    The uncertainty of a window's delay also exists within the window, where no constant delay corrects it.
    """
    return np.asarray(1 - np.cos(2 * np.pi * np.exp(event.log_frequency) * wander))

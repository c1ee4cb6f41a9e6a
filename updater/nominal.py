"""The structure file taken at its word, as a reference for what it gets wrong about measured modes.

Where it is far off - by more than 5 % in the median frequency - the model is moved first: its parameters are fitted to
the measured frequencies, then to shapes too, with modes paired anew, until it rests. What the file says stays what is
known beforehand.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from daq import FloatArray
from updater.calibration import Calibration, best_model, calibrate, channel_rows, enough_modes
from updater.causes.model_parameters import propose_model_parameters
from updater.comparing import MODEL_ERROR, compare
from updater.delays import DeviceDelays
from updater.errors import ModalDataError, PairingError
from updater.fit import fit
from updater.knobs import apply_knobs, as_filed, knobs_of, with_springs
from updater.matching import match_modes, matched, without_fault
from updater.modal_checks import check_unit
from updater.reference import Filed, Reference
from updater.statistics import ModalMean, Scatter, TrackedModes, learn_scatter, stated_scatter
from updater.structure import Structure

_FREQUENCY_STD = 2e-3  # of ln f: what a beam model cannot say better, whatever its parameters
_DELAY_STD = 2e-5  # s: filters and clocks of devices of one kind
_SHAPE_STD = 0.01  # of a unit shape's components: gains are known to half a per cent, places to millimetres
_TURNED = 0.02  # rad that sensors are turned by: what they see of the motion across them
_FAR = 0.05  # of ln f, in the median: a file that is more off is moved
_ROUNDS, _AT_REST = 6, 0.1  # times at most, or until no parameter moves by so much of its prior standard deviation
_ROUGHER = 2.0  # times the error of a good model


def _in_time(devices: Sequence[str]) -> DeviceDelays:
    return DeviceDelays(
        seconds=dict.fromkeys(devices, 0.0), std=dict.fromkeys(devices, _DELAY_STD), wander=0.0, noise_factor=1.0
    )


def nominal_reference(
    structure: Structure,
    windows: TrackedModes,
    devices: Sequence[str] = (),
    *,
    n_modes: int = 30,
    stated: bool = False,
) -> Reference:
    """Return a reference whose baseline is the model's own modes, at the measured ones' channels.

    Parameters
    ----------
    structure : as the file says; rigid feet and joints get springs stiff enough to change nothing. If it is far off,
        the reference is of a nearer one, and `filed` of this
    windows : (n_windows, n_tracks) modes that the model is to be compared with
    devices : that sampled the channels; the model has them in time, as well as devices are
    n_modes : of the model to keep, at least
    stated : whether the windows' standard deviations are taken at their word; else their scatter is learnt

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ValueError
        With fewer than three windows, unless `stated`.
    """
    scatter = stated_scatter(windows) if stated else learn_scatter(windows)
    there = _reference(with_springs(structure), structure, windows, scatter, devices, n_modes)
    calibration, measured = there.calibration, scatter.mean(windows)
    off = measured.log_frequency[calibration.tracks] - np.log(calibration.nominal_frequency)
    if structure.external is not None or not calibration.knobs or np.median(np.abs(off)) < _FAR:
        return there
    found = replace(there, filed=Filed(reference=there, value=as_filed(calibration.knobs)))
    measured = without_fault(there.baseline, measured)
    with suppress(PairingError, ModalDataError):  # where too little answers to a model it stays where it is
        value = _by_frequencies(structure, measured)
        for _ in range(_ROUNDS):
            moved = apply_knobs(structure, list(calibration.knobs), value)
            nearer = _reference(moved, structure, windows, scatter, devices, n_modes)
            found = replace(nearer, filed=Filed(reference=there, value=value))
            step, shares = _step(found, measured)
            if np.abs(shares).max() < _AT_REST:
                break
            value = np.minimum(value + step, [knob.upper for knob in calibration.knobs])
    return found


def _by_frequencies(structure: Structure, measured: ModalMean) -> FloatArray:
    """Return the parameters (n_knobs,) with which the model's frequencies are nearest."""
    found = calibrate(structure, measured)
    value = np.array([p.value for p in found.parameters])
    stiffness = np.array([k.kind == "stiffness" for k in found.knobs])
    return np.where(stiffness, np.log(np.where(stiffness, value, 1.0)), value)


def _step(reference: Reference, measured: ModalMean) -> tuple[FloatArray, FloatArray]:
    """Return how far a model's parameters (n_knobs,) are from where they fit best, also by their priors' deviations."""
    data = compare(reference, matched(reference.baseline, measured), model_error=_ROUGHER * MODEL_ERROR)
    cause = propose_model_parameters(reference, data)
    assert cause is not None  # nothing was calibrated
    step = fit(data, cause).theta[0] - cause.moved
    return step, step / cause.prior_std


def _reference(
    sprung: Structure,
    structure: Structure,
    windows: TrackedModes,
    scatter: Scatter,
    devices: Sequence[str],
    n_modes: int,
) -> Reference:
    """Return a reference of a structure's own modes; the file's parameters are those that may be off."""
    measured = scatter.mean(windows)
    model = best_model(sprung)
    rows, highest = channel_rows(model, measured.channels), float(np.exp(np.nanmax(measured.log_frequency)))
    modes = enough_modes(model, rows, highest, len(measured.log_frequency), n_modes=n_modes)
    at_channels = (rows @ modes.shape).T
    seen = np.flatnonzero(np.linalg.norm(at_channels, axis=1) > 1e-9)
    length = np.linalg.norm(at_channels[seen], axis=1, keepdims=True)
    shape = at_channels[seen] / length
    across = channel_rows(model, measured.channels, across=True) @ modes.shape[:, seen]
    crossing = np.linalg.norm(across.reshape(2, *shape.T.shape), axis=0).T / length
    shape_std = np.hypot(_SHAPE_STD, _TURNED * crossing)
    own = ModalMean(
        channels=measured.channels,
        n=np.ones(len(seen), np.intp),
        log_frequency=np.log(modes.frequency[seen]),
        log_frequency_std=np.full(len(seen), _FREQUENCY_STD),
        damping=np.full(len(seen), np.nan),
        damping_std=np.full(len(seen), np.nan),
        shape=shape,
        shape_std=shape_std,
        imaginary=np.zeros(shape.shape),
        imaginary_std=np.full(shape.shape, _SHAPE_STD),
    )
    check_unit(np.exp(measured.log_frequency), measured.shape, np.exp(own.log_frequency), own.shape)
    found = match_modes(own, measured)
    paired = np.flatnonzero(found >= 0)
    if len(paired) < 3:
        raise PairingError(
            f"only {len(paired)} measured modes ({np.round(np.exp(measured.log_frequency), 2).tolist()} Hz) have a "
            f"partner in the model ({np.round(modes.frequency[:12], 2).tolist()} Hz), at least 3 are needed"
        )
    return Reference(
        calibration=Calibration(
            structure=sprung,
            model=model,
            modes=modes,
            tracks=found[paired],
            paired=seen[paired],
            nominal_frequency=modes.frequency[seen[paired]],
            nominal_mac=(shape[paired] * measured.shape[found[paired]]).sum(1) ** 2,
            parameters=(),
            reason="nothing was fitted",
            knobs=tuple(knobs_of(structure)),
        ),
        baseline=own.only(paired),
        scatter=scatter,
        frequency=modes.frequency,
        shape=modes.shape,
        windows=windows,
        delays=_in_time(devices),
    )

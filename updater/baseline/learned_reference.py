"""A reference learned from baseline windows, or made from the structure file alone.

Modes of baseline windows are averaged, the model is calibrated, then one-step updated. A reference made from the file
alone is for errors of the file against measured modes. If the file is far off - by more than 5 % in the median
frequency - the model is moved first: its parameters are fitted to the measured frequencies, then to shapes too, with
modes paired again, until they no longer change. The values of the file remain the prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from daq import IndexArray
from oma import ModalEstimate, mac_matrix
from updater.baseline.recalibration import (
    Measured,
    Recalibrated,
    is_far,
    model_reference,
    recalibrated,
    std_by_file,
)
from updater.errors import ModalDataError, PairingError
from updater.modal_data import (
    NO_DELAYS,
    DeviceDelays,
    ModalMean,
    TrackedModes,
    learn_scatter,
    mean_modes,
    stack_tracks,
    stated_scatter,
)
from updater.reference import (
    NEAR,
    SAME_SHAPE,
    UNLIKE,
    Calibration,
    NominalModel,
    Parameter,
    Reference,
    best_model,
    calibrate,
    first_stage,
    match_nominal_modes,
    share_within,
)
from updater.structure import (
    Body,
    ModelParameter,
    Structure,
    Updating,
    apply_parameters,
    model_parameters_of,
    nominal_parameters,
    with_springs,
)

_MIN_P = 1e-3  # p of data and prior below which the priors of the file's parameters are widened


def learn_reference(
    structure: Structure,
    estimates: Sequence[ModalEstimate],
    tracks: Sequence[IndexArray],
    delays: DeviceDelays = NO_DELAYS,
    *,
    stated: bool = False,
    shaped: bool = True,
) -> Reference:
    """Learn from baseline windows: average, calibrate, then the one-step update's first stage.

    The model is calibrated to frequencies, then to frequencies and shapes with its modes paired again, until its
    parameters no longer change (`updater.baseline.recalibration`). The measured modes are expanded in clusters of the
    paired modes only and orthonormalised, so that the mass is not altered (eqs 7, 9 to 12) and the change is one of
    stiffness (eq. 8).

    Measured modes without a partner in the model are kept, so that no other mode is taken for them;
    `calibration.tracks` has those with a partner.

    Parameters
    ----------
    structure : as in the file
    estimates : of the windows, frequencies [Hz], shapes (n_modes, n_channels) [-]
    tracks : per window (n_tracks,) indices into its modes, -1 for a mode that was not seen
    delays : of the devices [s], which have been removed from these windows; kept for later ones
    stated : whether the standard deviations of the windows are used as stated. Default: their scatter is learned
    shaped : whether shapes were measured; if not, they only serve to pair modes

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ValueError
        With fewer than three windows, unless `stated`.
    """
    tracked = stack_tracks(estimates, tracks)
    every = mean_modes(tracked)
    calibration = calibrate(structure, every)
    if shaped and calibration.knobs and structure.external is None:
        scatter = stated_scatter(tracked) if stated else learn_scatter(tracked)
        calibration = _with_shapes(structure, calibration, Measured(windows=tracked, scatter=scatter))
    calibration = calibration.only(~_mistakable(every, calibration.tracks))
    kept = stack_tracks(estimates, [track[calibration.tracks] for track in tracks])
    scatter = stated_scatter(kept) if stated else learn_scatter(kept)
    baseline = scatter.mean(kept)
    updated = first_stage(calibration.model, calibration.modes, calibration.paired, baseline)
    others = np.setdiff1d(np.flatnonzero(np.isfinite(every.log_frequency)), calibration.tracks)
    return Reference(
        calibration=calibration,
        baseline=baseline,
        scatter=scatter,
        frequency=updated.frequency,
        shape=updated.shape,
        windows=kept,
        delays=delays,
        unpaired_modes=every.only(others) if len(others) else None,
    )


def with_bodies_on(reference: Reference, bodies: Sequence[Body], *, shaped: bool) -> Reference | None:
    """Return the reference of a structure that bore bodies, which its file lacks, while the baseline was measured.

    Its model has the bodies, and is calibrated to the baseline with them. None where other modes pair with it.

    Parameters
    ----------
    reference : learned from that baseline with a model without the bodies
    bodies : that were there
    shaped : whether shapes were measured
    """
    return _relearned(reference, reference.calibration.nominal.with_bodies(bodies), shaped=shaped)


def with_springs_at(reference: Reference, springs: Mapping[str, float], *, shaped: bool) -> Reference | None:
    """Return the reference with springs of given flexibilities, and all other parameters calibrated to the baseline.

    None where other modes pair with it.

    Parameters
    ----------
    reference : learned from that baseline
    springs : flexibility by the key of its parameter [unit of the parameter: rad/(N m), m/N]
    shaped : whether shapes were measured
    """
    calibration = reference.calibration
    knobs = [knob for knob in calibration.knobs if knob.key in springs]
    written = apply_parameters(calibration.nominal, knobs, np.array([springs[knob.key] for knob in knobs]))
    own = calibration.nominal.updating
    held = own.model_copy(update={"fixed": (*own.fixed, *springs)})
    found = _relearned(reference, written.model_copy(update={"updating": held}), shaped=shaped)
    if found is None:
        return None
    return replace(found, calibration=_with_updating(found.calibration, own))


def _with_updating(calibration: Calibration, own: Updating) -> Calibration:
    """Return the same with other choices of what may be updated."""
    structure, nominal = (
        one.model_copy(update={"updating": own}) for one in (calibration.structure, calibration.nominal)
    )
    return replace(calibration, structure=structure, nominal=nominal)


def _relearned(reference: Reference, loaded: Structure, *, shaped: bool) -> Reference | None:
    """Return the reference with another structure file, calibrated to the same baseline.

    Walls that the reference has rigid stay so.
    """
    measured = Measured(windows=reference.windows, scatter=reference.scatter)
    held = _with_rigid_walls(loaded, reference.calibration)
    try:
        found = calibrate(held, measured.mean)
    except PairingError:
        return None
    if shaped:
        found = _carried_on(held, found, measured)
    found = _with_updating(found, loaded.updating)
    if not np.array_equal(found.tracks, np.arange(len(reference.paired))):
        return None
    updated = first_stage(found.model, found.modes, found.paired, reference.baseline)
    calibration = replace(found, tracks=reference.calibration.tracks)
    return replace(reference, calibration=calibration, frequency=updated.frequency, shape=updated.shape)


def _with_shapes(structure: Structure, calibration: Calibration, measured: Measured) -> Calibration:
    """Return a calibration carried on with shapes; the same where too few modes can be paired then.

    Walls that it has rigid stay so.
    """
    found = _carried_on(_with_rigid_walls(structure, calibration), calibration, measured)
    return _with_updating(found, structure.updating)


def _with_rigid_walls(structure: Structure, calibration: Calibration) -> Structure:
    """Return a structure of which the walls that a calibration has rigid are not fitted."""
    own, fitted = structure.updating, {knob.key for knob in calibration.knobs}
    walls = (k.key for k in model_parameters_of(structure) if k.of_rigid_wall and k.key not in fitted)
    return structure.model_copy(update={"updating": own.model_copy(update={"fixed": (*own.fixed, *walls)})})


def _carried_on(structure: Structure, calibration: Calibration, measured: Measured) -> Calibration:
    """Return a calibration carried on with shapes and the structure's parameters, or the same."""
    try:
        there = model_reference(best_model(with_springs(structure)), structure, measured)
    except (PairingError, ModalDataError):
        return calibration
    far = is_far(calibration, measured.mean)
    found = recalibrated(structure, there, measured, far=far, start=calibration)
    if found is not None and not far and found.p_value < _MIN_P:
        found = recalibrated(structure, there, measured, far=True, start=calibration)
    if found is None:
        return calibration
    carried = _calibration(structure, found, there, measured.mean)
    return replace(carried, unmeasured_std=calibration.unmeasured_std)


def _calibration(structure: Structure, found: Recalibrated, there: Reference, measured: ModalMean) -> Calibration:
    """Return the calibration of a recalibrated model, its pairs as alike as those of a model that is right."""
    reference = found.reference
    own = reference.calibration
    at_channels = reference.at_channels(measured.channels).T
    answers = np.full(len(measured.n), -1, np.intp)
    answers[own.tracks] = own.paired
    share = share_within(measured, answers, reference.frequency, at_channels)
    assert reference.nominal is not None
    of_file = match_nominal_modes(reference, reference.nominal, measured.channels)[own.paired]
    likeness = mac_matrix(measured.shape[own.tracks], there.at_channels(measured.channels).T[of_file])
    fitted = zip(own.knobs, found.value, found.std, std_by_file(structure, found, measured), strict=True)
    whole = replace(
        own,
        n_nominal=there.calibration.n_nominal,
        nominal_frequency=there.frequency[of_file],
        nominal_mac=np.diagonal(likeness),
        parameters=tuple(_parameter(*one) for one in fitted),
        reason="cost_converged" if found.at_rest else "iteration_limit",
    )
    kept = np.flatnonzero(share[own.tracks] > UNLIKE)
    return whole.only(kept[np.argsort(own.tracks[kept])])


def _parameter(knob: ModelParameter, value: float, std: float, of_file_std: float) -> Parameter:
    return Parameter(
        name=knob.name,
        value=float(np.exp(value)) if knob.kind == "stiffness" else float(value),
        std=float(std),
        of_file_std=float(of_file_std),
        at_bound=bool(value <= knob.lower or value >= knob.upper),
    )


def _mistakable(measured: ModalMean, tracks: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which tracks (n_tracks,) the sensors cannot distinguish from a measured mode without partner.

    After a change either may be the other: for example a twist that the sensors measure as the adjacent bending mode,
    which it contains in part. At least three tracks are left.
    """
    others = np.setdiff1d(np.flatnonzero(np.isfinite(measured.log_frequency)), tracks)
    alike = mac_matrix(measured.shape[tracks], measured.shape[others]) > SAME_SHAPE
    near = np.abs(measured.log_frequency[tracks, None] - measured.log_frequency[others]) < NEAR
    found = np.asarray((alike & near).any(1))
    return found if (~found).sum() >= 3 else np.zeros(len(tracks), bool)


def nominal_reference(
    structure: Structure,
    windows: TrackedModes,
    devices: Sequence[str] = (),
    *,
    n_modes: int = 30,
    stated: bool = False,
) -> Reference:
    """Return a reference whose baseline is the model's own modes, at the channels of the measured ones.

    Parameters
    ----------
    structure : as in the file; rigid feet and joints get springs that are stiff enough to have no effect. If it is far
        off, the reference is of a recalibrated one, and `nominal` of this
    windows : (n_windows, n_tracks) modes that the model is to be compared with
    devices : that sampled the channels; the model has them in time, as well as devices are
    n_modes : of the model to keep, at least
    stated : whether the windows' standard deviations are taken at their word; else their scatter is learned

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    ValueError
        With fewer than three windows, unless `stated`.
    """
    scatter = stated_scatter(windows) if stated else learn_scatter(windows)
    measured = Measured(windows=windows, scatter=scatter, devices=devices, n_modes=n_modes, of_file=True)
    there = model_reference(best_model(with_springs(structure)), structure, measured)
    if not there.calibration.knobs or not is_far(there.calibration, measured.mean):
        return there
    found = recalibrated(structure, there, measured, far=True)
    if found is None:  # where too little can be paired with a model it stays where it is
        value = nominal_parameters(there.calibration.knobs)
        return replace(there, nominal=NominalModel(reference=there, value=value, far=True))
    return found.reference

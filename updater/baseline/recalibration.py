"""Fit of a model's parameters to measured frequencies and shapes, with modes paired again after every step.

Frequencies alone do not determine all parameters, such as which of two bearings of a symmetric girder is softer. A mode
that is far off in the structure file is paired once the model is close to it, and is used from then on.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace

import numpy as np

from daq import FloatArray
from updater.causes import (
    ModelParameters,
    SelectedCause,
    covariance_with_unlisted,
    propose_model_parameters,
)
from updater.errors import ModalDataError, PairingError
from updater.fe import Model
from updater.inference import MODEL_ERROR, Comparison, compare, fit
from updater.modal_data import (
    DeviceDelays,
    ModalMean,
    Scatter,
    TrackedModes,
    check_unit,
    match_modes,
    matched,
    without_fault,
)
from updater.reference import Calibration, NominalModel, Reference, best_model, calibrate, own_modes
from updater.structure import Structure, apply_parameters, model_parameters_of

FAR = 0.05  #: median of ln f: a file that is more off has wider priors
_DELAY_STD = 2e-5  # s: filters and clocks of devices of one kind
_MAX_ROUNDS, _AT_REST = 6, 0.1  # until no parameter moves by so much of the standard deviation of its estimate
_N_STARTS, _SCATTER = 40, 0.7  # of a fit, and by how much ln of flexibilities scatters among them ...
_SCATTERED_ROUNDS = 2  # ... in the first rounds
_ROUGHER = 2.0  # times the error of a good model


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """Modes that a model is compared with."""

    windows: TrackedModes  #: (n_windows, n_tracks)
    scatter: Scatter  #: scatter of the windows
    devices: Sequence[str] = ()  #: devices of the channels; in the model they are synchronous within their uncertainty
    n_modes: int = 30  #: smallest number of the model's modes
    of_file: bool = False  #: whether errors of the structure file are sought, not a change since these modes

    @property
    def mean(self) -> ModalMean:
        """Mean of the windows (n_tracks,)."""
        return self.scatter.mean(self.windows)


@dataclass(frozen=True, eq=False)
class Recalibrated:
    """A model at the parameters with which it fits best."""

    reference: Reference  #: reference with the model's own modes; `nominal` is the structure file's
    value: FloatArray  #: (n_knobs,)
    std: FloatArray  #: (n_knobs,) standard deviations, prior included
    p_value: float  #: chance of a worse fit of data and prior
    at_rest: bool  #: whether the parameters no longer change


def is_far(calibration: Calibration, measured: ModalMean) -> bool:
    """Return whether a structure file is inconsistent, by the median frequency error of its paired modes."""
    off = measured.log_frequency[calibration.tracks] - np.log(calibration.nominal_frequency)
    return bool(np.median(np.abs(off)) >= FAR)


def recalibrated(
    structure: Structure, there: Reference, measured: Measured, *, far: bool, start: Calibration | None = None
) -> Recalibrated | None:
    """Return the model with the parameters with which it fits best; None where too few modes can be paired with one.

    The parameters are first fitted to the frequencies, then to frequencies and shapes, with modes paired again each
    time, until they no longer change. The file's parameters remain the mean of the prior.

    Parameters
    ----------
    structure : as in the file
    there : reference of the file's own modes
    measured : modes to fit
    far : whether the file is far off, so that its parameters have wider priors
    start : to begin with; None: fitted to the frequencies alone
    """
    found = None
    knobs, modes = there.calibration.knobs, without_fault(there.baseline, measured.mean)
    with suppress(PairingError, ModalDataError):  # the last model that enough modes can be paired with is kept
        start = start or calibrate(structure, modes)
        value, model = _parameters_of(start), start.model
        value = np.append(
            value, np.zeros(len(knobs) - len(value))
        )  # sections and masses, in a calibration as in the file
        for number in range(_MAX_ROUNDS):
            if number:
                model = best_model(apply_parameters(structure, list(knobs), value))
            nearer = model_reference(model, structure, measured)
            nearer = replace(nearer, nominal=NominalModel(reference=there, value=value, far=far))
            cause, best, covariance, p_value = _best_parameters(
                nearer, modes, _N_STARTS if number < _SCATTERED_ROUNDS else 1
            )
            std = np.sqrt(np.diag(covariance))
            at_rest = bool((np.abs(best - cause.moved) < _AT_REST * std).all())
            found = Recalibrated(nearer, value, std, p_value, at_rest)
            if at_rest:
                break
            value = np.minimum(cause.file_value + best, [knob.upper for knob in knobs])
    return found


def std_by_file(structure: Structure, found: Recalibrated, measured: ModalMean) -> FloatArray:
    """Return standard deviations (n_knobs,) of fitted parameters by what the file has wrong and is not fitted.

    These are bodies that it lacks, and its sections and masses within their priors.

    Parameters
    ----------
    structure : as in the file
    found : the fit
    measured : modes that were fitted
    """
    reference, nominal = found.reference, found.reference.nominal
    assert nominal is not None
    every = tuple(model_parameters_of(structure, of_file=True))
    n_held = len(every) - len(found.value)
    nominal = replace(nominal, value=np.append(nominal.value, np.zeros(n_held)))
    reference = replace(reference, calibration=replace(reference.calibration, knobs=every), nominal=nominal)
    data = _compared(reference, without_fault(nominal.reference.baseline, measured))
    cause = propose_model_parameters(reference, data)
    assert cause is not None  # nothing was calibrated
    _, covariance = covariance_with_unlisted(reference, data, (SelectedCause(cause, 0, cause.moved),), n_held)
    return np.sqrt(np.diag(covariance))


def _parameters_of(calibration: Calibration) -> FloatArray:
    """Return the calibrated parameters (n_knobs,), logarithms of factors of stiffness."""
    pairs = zip(calibration.knobs, calibration.parameters, strict=True)
    return np.array([np.log(p.value) if knob.kind == "stiffness" else p.value for knob, p in pairs])


@dataclass(frozen=True, eq=False, kw_only=True)
class _Restarted(ModelParameters):
    """The same parameters from several starts: of symmetric structures softer left and right is as good as reversed."""

    starts: FloatArray  #: (n_starts, n_knobs)

    @property
    def start(self) -> FloatArray:
        """Begin at each of them."""
        return self.starts


def _best_parameters(
    reference: Reference, measured: ModalMean, n_starts: int
) -> tuple[ModelParameters, FloatArray, FloatArray, float]:
    """Return the parameters about a model: cause, best values over the file's, covariance and p value."""
    data = _compared(reference, measured)
    cause = propose_model_parameters(reference, data)
    assert cause is not None  # nothing was calibrated
    starts = _starts(cause, n_starts)
    given = {field.name: getattr(cause, field.name) for field in fields(cause)}
    found = fit(data, _Restarted(**given | {"lower": np.repeat(cause.lower, len(starts), axis=0)}, starts=starts))
    best = int(np.argmin(found.chi_square))
    return cause, found.theta[best], found.covariance[best], found.p_value


def _compared(reference: Reference, measured: ModalMean) -> Comparison:
    return compare(reference, matched(reference.baseline, measured), model_error=_ROUGHER * MODEL_ERROR)


def _starts(cause: ModelParameters, n: int) -> FloatArray:
    """Return where fits begin (n, n_knobs): at the model's own parameters, and with flexibilities scattered.

    Of external matrices also with the factors of groups scattered, within their priors.
    """
    random = np.random.default_rng(0)
    flexible = np.array([knob.kind in {"support", "joint", "wall"} for knob in cause.knobs])
    scatter = _SCATTER * random.standard_normal((n - 1, len(flexible)))
    own = cause.file_value + cause.moved
    of_groups = scatter * cause.prior_std * [knob.of_group for knob in cause.knobs]
    value = np.vstack([own, own * np.exp(scatter * flexible) + of_groups])
    return np.maximum(value - cause.file_value, cause.lower)


def model_reference(model: Model, structure: Structure, data: Measured) -> Reference:
    """Return a reference of a model's own modes; the file's parameters are those that may be off.

    Parameters
    ----------
    model : of the structure, with springs in the place of rigid connections
    structure : as in the file
    data : modes to pair the model's with

    Raises
    ------
    PairingError
        If fewer than three measured modes have a partner in the model.
    """
    measured = data.mean
    modes, seen, own = own_modes(model, measured, n_modes=data.n_modes)
    check_unit(np.exp(measured.log_frequency), measured.shape, np.exp(own.log_frequency), own.shape)
    found = match_modes(own, measured)
    paired = np.flatnonzero(found >= 0)
    if len(paired) < 3:
        raise PairingError(
            f"only {len(paired)} measured modes ({np.round(np.exp(measured.log_frequency), 2).tolist()} Hz) have a "
            f"partner in the model ({np.round(modes.frequency[:12], 2).tolist()} Hz), at least 3 are needed"
        )
    return Reference(
        measured=False,
        of_file=data.of_file,
        calibration=Calibration(
            structure=model.structure,
            nominal=structure,
            model=model,
            modes=modes,
            tracks=found[paired],
            paired=seen[paired],
            n_nominal=len(paired),
            nominal_frequency=modes.frequency[seen[paired]],
            nominal_mac=(own.shape[paired] * measured.shape[found[paired]]).sum(1) ** 2,
            parameters=(),
            reason="not_fitted",
            knobs=tuple(model_parameters_of(structure, of_file=data.of_file)),
        ),
        baseline=own.only(paired),
        scatter=data.scatter,
        frequency=modes.frequency,
        shape=modes.shape,
        windows=data.windows,
        delays=DeviceDelays(
            seconds=dict.fromkeys(data.devices, 0.0),
            std=dict.fromkeys(data.devices, _DELAY_STD),
            wander=0.0,
            noise_factor=1.0,
        ),
    )

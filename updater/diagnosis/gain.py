"""The gain of a diagnosis on data that did not choose it: of the written model, and of the changes predicted.

The model's figures are those of the structure file with the causes, solved again and compared with all measured modes;
without the causes, those of the file before. The predicted changes are relative to the baseline, on held-out records or
by cross-validation over the modes, so that errors of the model in the undisturbed state cancel. They decide whether the
causes are an improvement: the log likelihood must rise by more than two standard deviations of that rise, which for
independent noise are the whitened distance between the two predictions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import SelectedCause, prediction
from updater.diagnosis.model_extension import agreeing
from updater.diagnosis.schema import Gain, Pair
from updater.fe import Model
from updater.inference import Comparison, Prediction, Whitener, compare, residual, without_mode
from updater.modal_data import Circumstances, ModalMean
from updater.reference import Calibration, ModelFit, Reference, best_model, fit_of_model
from updater.structure import Structure, dump_structure, parse_structure

_SIGNIFICANT = 2.0  # standard deviations
_CONTRADICTS = 3.0  # standard deviations
_DOUBLE = 2.0  # times the error of frequencies without the causes
_BY_MODE = ("log_ratio", "shape", "imaginary", "log_damping")  # of a prediction
# largest median difference of a written model from its prediction: in ln f, and as a share of the changes' root mean
# square; of ten draws of nine causes, the largest was 4e-4
_EXACT, _SHARE = 5e-3, 0.2
_UNKNOWN = 1e4  # variance of a log frequency that was not measured


@dataclass(frozen=True, eq=False)
class Gained:
    """A gain and how sure it is."""

    gain: Gain
    std: Gain  #: standard deviations of the same figures
    significant: bool  #: whether the log likelihood of the changes has risen by more than chance

    @property
    def is_worse(self) -> bool:
        """True if the written model contradicts the measured modes: a right cause does not double the error."""
        error, std = self.gain.frequency_error_percent, self.std.frequency_error_percent
        likelihood = self.gain.log_likelihood
        if error.before is None or error.after is None or likelihood.before is None or likelihood.after is None:
            return False
        noise = _CONTRADICTS * math.hypot(std.before or 0.0, std.after or 0.0)
        return error.after > max(_DOUBLE * error.before, error.before + noise) and likelihood.after < likelihood.before


@dataclass(frozen=True, eq=False)
class ChangeGain:
    """The gain of predicted changes since the baseline."""

    error: Pair  #: root mean square of frequency ratios without and with the causes [%]
    std: Pair
    significant: bool


def change_gain_on(heldout: Comparison, chosen: Sequence[SelectedCause]) -> ChangeGain:
    """Return the gain of predicted changes on a record that was not used."""
    return _change_gain(heldout, prediction(heldout, chosen), chosen)


def change_gain_left_out(data: Comparison, chosen: Sequence[SelectedCause]) -> ChangeGain:
    """Return the gain of predicted changes of each mode when the parameters are fitted to the others.

    Places, channels and the causes themselves stay as they were found with all modes.
    """
    whole = prediction(data, chosen)
    predicted = replace(whole, **{name: getattr(whole, name).copy() for name in _BY_MODE})
    for i in range(len(data.log_ratio)):
        without = prediction(data, agreeing(_blind(data, i), chosen))
        for name in _BY_MODE:
            getattr(predicted, name)[:, i] = getattr(without, name)[:, i]
    return _change_gain(data, predicted, chosen)


def gain_of(before: ModelFit, after: ModelFit, change: ChangeGain, *, heldout: bool) -> Gained:
    """Return the gain of a written model.

    Parameters
    ----------
    before, after : (n_modes,) of the model without and with the causes, to the same measured modes
    change : of the changes since the baseline
    heldout : whether these modes were measured on a record that was not used
    """
    both = np.flatnonzero(np.isfinite(after.residual))
    fits = [before.only(both), after.only(both)]
    error, error_std = zip(*(fit.frequency_error() for fit in fits), strict=True)
    apart, apart_std = zip(*(fit.mac_error() for fit in fits), strict=True)
    common = np.flatnonzero(np.isfinite(fits[0].residual))
    likelihood = [float(fit.log_likelihood[common].sum()) for fit in fits]
    n_modes, noise = len(both), fits[1].noise_error()
    return Gained(
        gain=Gain(
            heldout=heldout,
            frequency_error_percent=_pair(error),
            one_minus_mac=_pair(apart),
            log_likelihood=_pair(likelihood),
            change_error_percent=change.error,
            n_modes=n_modes,
            n_measured=len(after.residual),
            noise_percent=noise,
            exceeds_noise=fits[1].exceeds_noise(),
        ),
        std=Gain(
            heldout=heldout,
            frequency_error_percent=_pair(error_std),
            one_minus_mac=_pair(apart_std),
            log_likelihood=_pair([float(np.linalg.norm(fit.log_likelihood_std[common])) for fit in fits]),
            change_error_percent=change.std,
            n_modes=n_modes,
        ),
        significant=change.significant,
    )


def _blind(data: Comparison, mode: int) -> Comparison:
    """Return the same data with one mode as if it had not been measured."""
    seen = (np.arange(len(data.log_ratio)) != mode).astype(float)
    return replace(
        data,
        plain=_without(data.plain, mode),
        drifting=_without(data.drifting, mode),
        shape_whitener=seen[:, None, None] * data.shape_whitener,
        imaginary_whitener=without_mode(data.imaginary_whitener, mode, len(data.channels)),
        damping_weight=seen * data.damping_weight,
        mass_tests=(),
    )


def _without(whitener: Whitener, mode: int) -> Whitener:
    root = np.linalg.inv(whitener.matrix)
    covariance = root @ root.T
    covariance[mode, mode] += _UNKNOWN
    matrix: FloatArray = np.linalg.inv(np.linalg.cholesky(covariance)).astype(np.float64)
    return Whitener(matrix, whitener.log_det)


def _change_gain(data: Comparison, after: Prediction, chosen: Sequence[SelectedCause]) -> ChangeGain:
    before = prediction(data, None)
    whitener = data.drifting if any(c.cause.drifting for c in chosen) else data.plain
    rests = [residual(data, before, data.plain)[0], residual(data, after, whitener)[0]]
    likelihood = [-0.5 * float(r @ r) + w.log_det for r, w in zip(rests, (data.plain, whitener), strict=True)]
    error, std = zip(*(_frequency_error(data, p) for p in (before, after)), strict=True)
    distance = float(np.linalg.norm(residual(data, before, whitener)[0] - rests[1]))
    return ChangeGain(_pair(error), _pair(std), likelihood[1] - likelihood[0] > _SIGNIFICANT * distance)


def _pair(values: Sequence[float | None]) -> Pair:
    return Pair(before=values[0], after=values[1])


def _frequency_error(data: Comparison, predicted: Prediction) -> tuple[float, float]:
    """Return root mean square and its standard deviation [%]."""
    rest = data.log_ratio - predicted.log_ratio[0]
    rms = float(np.sqrt(np.mean(rest**2)))
    std = np.linalg.norm(np.linalg.inv(data.plain.matrix), axis=1)
    return 100 * rms, 100 * float(np.linalg.norm(rest * std)) / (len(rest) * max(rms, 1e-12))


@dataclass(frozen=True, eq=False)
class WindowModes:
    """Modes of some windows."""

    event: ModalMean  #: (n_tracks,) in the order of the baseline's tracks, NaN where there is none
    every: ModalMean  #: (n_modes,) all that were measured, in any order

    @classmethod
    def of(cls, event: ModalMean, every: ModalMean | None) -> Self:
        """Return modes; all are those of the tracks where no others are given."""
        return cls(event, event.only(np.flatnonzero(np.isfinite(event.log_frequency))) if every is None else every)

    def rows(self, modes: ModalMean) -> IndexArray:
        """Return which of all modes some of them (n,) are: those of the same frequency."""
        return np.asarray(np.argmin(np.abs(self.every.log_frequency - modes.log_frequency[:, None]), axis=1))


def written_gain(
    reference: Reference,
    data: Comparison,
    measured: WindowModes,
    heldout: WindowModes | None,
    chosen: Sequence[SelectedCause],
    written: tuple[Model, Model],
    known: ModelFit | None = None,
) -> Gained:
    """Return the gain of a written structure over the same without causes.

    Parameters
    ----------
    reference : that the causes were sought with
    data, measured : the modes that were explained
    heldout : modes of windows that were not used, which the gain is measured on where they have all channels
    chosen : causes
    written : models of the structure without causes, and with them written into it, as their texts are read back
    known : fit of the latter to `measured`, if it is known
    """
    if heldout and set(data.channels) <= set(heldout.event.channels):
        predicted = Circumstances(mixing=data.circumstances.mixing)
        data, modes = compare(reference, heldout.event.at(data.channels), circumstances=predicted), heldout
        change = change_gain_on(data, chosen)
    else:
        change, modes = change_gain_left_out(data, chosen), measured
    before = fit_of_written(reference, data, modes, written[0], None)
    after = (
        known if known is not None and modes is measured else fit_of_written(reference, data, modes, written[1], chosen)
    )
    return gain_of(before, after, change, heldout=modes is heldout)


def fit_of_written(
    reference: Reference,
    data: Comparison,
    modes: WindowModes,
    model: Model,
    chosen: Sequence[SelectedCause] | None,
) -> ModelFit:
    """Return the fit of a written structure to all modes of windows.

    Parameters
    ----------
    reference : that the causes were sought with
    data : these modes compared with the baseline's
    model : of the structure with the causes chosen, if any, written in
    """
    expected = np.full(len(modes.every.n), np.nan)
    expected[modes.rows(modes.event.only(data.tracks))] = _expected(reference, data, chosen)
    every = modes.every.at(data.channels)
    return fit_of_model(model, every, expected=expected, overdispersion=data.overdispersion)


def _expected(reference: Reference, data: Comparison, chosen: Sequence[SelectedCause] | None) -> FloatArray:
    """Return the frequencies (n,) that a model with causes should have: its own, which may miss the measured ones."""
    frequency = reference.calibration.modes.frequency if reference.measured else data.frequency
    return np.asarray(frequency[data.paired] * np.exp(prediction(data, chosen).log_ratio[0]))


def differs_from_predicted(
    reference: Reference, data: Comparison, written: ModelFit, chosen: Sequence[SelectedCause]
) -> bool:
    """Return whether a written model has other frequencies than its causes predict: their approximations do not hold.

    The median over the modes counts, as close modes may be paired otherwise.

    Parameters
    ----------
    reference : that the causes were sought with
    data : the compared modes
    written : (n,) or more, fit of the written model to these modes, and then to others
    chosen : causes
    """
    apart = np.abs(np.log(written.frequency[: len(data.paired)] / _expected(reference, data, chosen)))
    apart = apart[np.isfinite(apart)]
    size = float(np.sqrt(np.mean(prediction(data, chosen).log_ratio[0] ** 2)))
    return bool(len(apart)) and float(np.median(apart)) > max(_EXACT, _SHARE * size)


def read_back(structure: Structure) -> Model:
    """Return the model of a structure as it is read back from its text."""
    return best_model(parse_structure(dump_structure(structure)))


@lru_cache(maxsize=4)
def calibrated_model(calibration: Calibration) -> Model:
    """Return the model of a calibrated structure as it is read back from its text: the same for all its diagnoses."""
    return read_back(calibration.structure)


def compared_rows(data: Comparison, modes: WindowModes) -> IndexArray:
    """Return which of all modes were compared, and then those that the baseline has not."""
    rows = modes.rows(modes.event.only(data.tracks))
    if data.circumstances.extra is not None:
        rows = np.concatenate([rows, modes.rows(data.circumstances.extra)])
    return rows

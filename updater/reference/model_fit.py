"""The fit of a written structure to measured modes: its own modes as they follow from the file, and nothing else.

A diagnosis predicts changes about measured modes, so that errors of the model in the undisturbed state cancel. A
structure file has no baseline to correct it: its errors are in its frequencies.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtrc

from daq import FloatArray, IndexArray
from updater.fe import Model, Modes
from updater.modal_data import ModalMean, match_modes
from updater.quantities import ASKEW_STD, FREQUENCY_STD
from updater.reference.calibration import UNLIKE, channel_rows, enough_modes, share_within
from updater.reference.model_error import frequency_error
from updater.reference.reference import SHAPE_STD

_STILL = 1e-9  # motion of a mode at the sensors [1/sqrt(kg)]: a smaller one is not measured


def own_modes(model: Model, measured: ModalMean, *, n_modes: int = 30) -> tuple[Modes, IndexArray, ModalMean]:
    """Return the modes of a model, those (n_seen,) that move the sensors, and these as a mean at the channels.

    Their deviations are those of each mode alone, without errors that have one factor for all modes.

    Parameters
    ----------
    model : whose sensors have the channels
    measured : modes with the channels, the highest frequency and the number
    n_modes : to solve for, at least
    """
    rows, highest = channel_rows(model, measured.channels), float(np.exp(np.nanmax(measured.log_frequency)))
    modes = enough_modes(model, rows, highest, len(measured.log_frequency), n_modes=n_modes)
    at_channels = (rows @ modes.shape).T
    seen = np.flatnonzero(np.linalg.norm(at_channels, axis=1) > _STILL)
    length = np.linalg.norm(at_channels[seen], axis=1, keepdims=True)
    shape = at_channels[seen] / length
    shapes = modes.shape[:, seen]
    across = channel_rows(model, measured.channels, across=True) @ shapes
    crossing: FloatArray = np.linalg.norm(across.reshape(2, *shape.T.shape), axis=0).T / length
    own = ModalMean(
        channels=measured.channels,
        n=np.ones(len(seen), np.intp),
        log_frequency=np.log(modes.frequency[seen]),
        log_frequency_std=np.hypot(FREQUENCY_STD, model.mesh_error(shapes)),
        damping=np.full(len(seen), np.nan),
        damping_std=np.full(len(seen), np.nan),
        shape=shape,
        shape_std=np.hypot(SHAPE_STD, ASKEW_STD * crossing),
        imaginary=np.zeros(shape.shape),
        imaginary_std=np.full(shape.shape, SHAPE_STD),
    )
    return modes, seen, own


_MIN_P = 1e-3  # of residuals by measurement noise alone, under which they are more than noise
_NEAR = 0.02  # of ln f: a mode of the structure that is the one expected
_TINY = 1e-12


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelFit:
    """Measured modes compared with a structure's own; NaN where it has no such mode."""

    frequency: FloatArray  #: (n_modes,) of the structure [Hz]
    residual: FloatArray  #: (n_modes,) ln of measured over the structure's frequency
    noise: FloatArray  #: (n_modes,) standard deviation of the measured ln frequency
    mac: FloatArray  #: (n_modes,)
    mac_std: FloatArray  #: (n_modes,) by measurement noise
    log_likelihood: FloatArray  #: (n_modes,) of frequency and shape, a good beam model's error allowed for
    log_likelihood_std: FloatArray  #: (n_modes,) by measurement noise of the frequency

    @property
    def paired(self) -> IndexArray:
        """Measured modes that the structure has."""
        return np.flatnonzero(np.isfinite(self.residual))

    def only(self, modes: IndexArray) -> "ModelFit":
        """Return the fit of some modes."""
        return ModelFit(**{name: values[modes] for name, values in vars(self).items()})

    def frequency_error(self) -> tuple[float, float] | tuple[None, None]:
        """Return the root mean square of the frequencies' errors and its standard deviation [%]; None without modes."""
        rest, noise = self.residual[self.paired], self.noise[self.paired]
        if not len(rest):
            return None, None
        rms = float(np.sqrt(np.mean(rest**2)))
        return 100 * rms, 100 * float(np.linalg.norm(rest * noise)) / (len(rest) * max(rms, _TINY))

    def noise_error(self) -> float | None:
        """Return the root mean square that measurement noise alone would leave [%]; None without modes."""
        return 100 * float(np.sqrt(np.mean(self.noise[self.paired] ** 2))) if len(self.paired) else None

    def exceeds_noise(self) -> bool:
        """Return whether the frequencies' errors are more than measurement noise."""
        z = self.residual[self.paired] / self.noise[self.paired]
        return bool(chdtrc(len(z), float(z @ z)) < _MIN_P)

    def mac_error(self) -> tuple[float, float] | tuple[None, None]:
        """Return the mean of 1 - MAC and its standard deviation; None where no shape is known well enough."""
        shaped = np.flatnonzero(np.isfinite(self.mac) & np.isfinite(self.mac_std))
        if not len(shaped):
            return None, None
        return float((1 - self.mac[shaped]).mean()), float(np.linalg.norm(self.mac_std[shaped])) / len(shaped)


def fit_of_model(
    model: Model, measured: ModalMean, *, expected: FloatArray | None = None, overdispersion: float = 1.0
) -> ModelFit:
    """Return how well a model's own modes fit measured ones.

    Parameters
    ----------
    model : of a structure as it is in a file
    measured : (n_modes,) in any order
    expected : (n_modes,) frequencies by which modes without a measured shape are paired [Hz]
    overdispersion : components of a shape that err as one [-]
    """
    modes, seen, own = own_modes(model, measured)
    answers = np.full(len(measured.n), -1, np.intp)
    found = match_modes(own, measured)
    answers[found[found >= 0]] = np.flatnonzero(found >= 0)
    near = share_within(measured, answers, modes.frequency[seen], own.shape)
    answers = np.where(near > UNLIKE, answers, -1)
    unshaped = np.flatnonzero(~np.isfinite(measured.shape).all(1))
    if expected is not None and len(unshaped):
        apart = np.abs(own.log_frequency - np.log(expected[unshaped, None]))
        apart = np.where(apart < _NEAR, apart, 1.0)
        row, column = linear_sum_assignment(apart)
        answers[unshaped[row]] = np.where(apart[row, column] < _NEAR, column, -1)
    here = answers >= 0
    number = np.maximum(answers, 0)
    paired, of_modes = own.only(number), seen[number]
    error = frequency_error(model, Modes(frequency=modes.frequency[of_modes], shape=modes.shape[:, of_modes]))
    frequency = np.where(here, np.exp(paired.log_frequency), np.nan)
    residual = measured.log_frequency - np.log(frequency)
    along = (measured.shape * paired.shape).sum(1, keepdims=True)
    rest = measured.shape - along * paired.shape
    variance = measured.shape_std**2
    mac_variance = 4 * (rest**2 * variance).sum(1) + 2 * (variance**2).sum(1)
    of_shape = (rest**2 / (variance + paired.shape_std**2)).sum(1) / overdispersion
    frequency_std = np.sqrt(measured.log_frequency_std**2 + FREQUENCY_STD**2 + error.std**2)
    known = here & (variance.sum(1) < 1)
    return ModelFit(
        frequency=frequency,
        residual=residual,
        noise=measured.log_frequency_std,
        mac=np.where(known, along[:, 0] ** 2, np.nan),
        mac_std=np.where(known, np.sqrt(mac_variance), np.nan),
        log_likelihood=-0.5 * ((residual / frequency_std) ** 2 + np.nan_to_num(of_shape)) - np.log(frequency_std),
        log_likelihood_std=np.abs(residual) * measured.log_frequency_std / frequency_std**2,
    )

"""Modes that the baseline has not, as data of a comparison."""

import numpy as np

from daq import FloatArray
from updater.inference.comparison import NewModes
from updater.inference.shape_covariance import SHAPE_BIAS, shape_whiteners
from updater.modal_data import ModalMean

_NARROW = 0.02  # of a squared frequency: nearer than this a mode resonates
_FREQUENCY_BIAS = 1e-4  # of ln f of a mode that is new
_UNKNOWN = 0.1  # of a unit shape's square, from which on it is not known


def new_shapes(
    extra: ModalMean | None,
    channels: tuple[str, ...],
    overdispersion: float,
    at_channels: FloatArray,
    frequency: FloatArray,
    model_error: float,
) -> NewModes | None:
    """Return those with a known shape at the channels, None without any: a mixture of two close modes is not new.

    Their shapes are those of a structure excited at one place: each mode contributes its motion there, with the errors
    of the reference as in `foreign_modes`, and its response.

    Parameters
    ----------
    extra : (n_extra,) modes that the baseline has not
    channels : that are compared
    overdispersion : components of a shape that err as one [-]
    at_channels, frequency : (n_channels, n_modes) and (n_modes,) [Hz] of the reference's modes
    model_error : of a mode's typical displacement
    """
    if extra is None:
        return None
    extra = extra.at(channels)
    known = np.isfinite(extra.shape + extra.shape_std).all(1) & ((extra.shape_std**2).sum(1) < _UNKNOWN)
    extra = extra.only(np.flatnonzero(known))
    if not len(extra.log_frequency):
        return None
    variance = overdispersion * extra.shape_std**2 + SHAPE_BIAS**2 + model_error**2 / len(channels)
    share = np.linalg.norm(at_channels, axis=0) * shaken(np.exp(extra.log_frequency)[:, None], frequency)
    turned = 2 * model_error * np.abs(share) / np.linalg.norm(share, axis=1, keepdims=True)
    unit = at_channels / np.maximum(np.linalg.norm(at_channels, axis=0), 1e-300)
    return NewModes(
        log_frequency=extra.log_frequency,
        log_frequency_std=np.hypot(extra.log_frequency_std, _FREQUENCY_BIAS),
        damping=extra.damping,
        damping_std=extra.damping_std,
        shape=extra.shape,
        whitener=shape_whiteners(variance, extra.shape, turned[:, :, None] * unit.T),
    )


def shaken(at: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return the response of modes of frequencies (n_modes,) to an excitation at others [Hz].

    1 / (omega_r^2 / omega^2 - 1), limited where a mode would resonate.
    """
    gap = (frequency / at) ** 2 - 1
    return np.asarray(1 / np.where(np.abs(gap) < _NARROW, np.copysign(_NARROW, gap), gap))

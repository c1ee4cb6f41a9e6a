"""Errors of sensors in a structure file, which all modes have in common: gains, directions and places.

A channel has one gain, one direction and one place in all modes. Of a structure file compared with measured modes, they
are not errors of single shapes, which average out over modes, but parameters with a prior. They are eliminated: the
covariance of all shapes together has their products between modes. With reference logs they cancel, but for modes that
were not measured.
"""

from dataclasses import replace

import numpy as np

from daq import BoolArray, FloatArray, IndexArray
from updater.inference.shape_covariance import beside, turned_back
from updater.modal_data import Mixing, ModalMean
from updater.quantities import ASKEW_STD, GAIN_STD, PLACE_STD
from updater.reference import Reference
from updater.structure import size

# of the variance of SHAPE_STD (updater/reference/reference.py): the rest of it is by gains and places
_OF_MODEL = 0.5


def sensor_errors(reference: Reference, tracks: IndexArray, channels: tuple[str, ...]) -> FloatArray:
    """Return the standard deviations of unit shapes by each error of the sensors (n, n_channels, n_errors).

    Gains of channels, turns about the two axes across each, offsets of each place along the three global axes. No
    errors of channels at which the reference was measured with the same sensors.

    Parameters
    ----------
    tracks : (n,) of the reference
    channels : compared ones
    """
    paired = reference.paired[tracks]
    unmeasured = reference.unmeasured(channels)
    if not unmeasured.any():
        return np.zeros((len(paired), len(channels), 0))
    errors = _errors(reference, channels, unmeasured, np.eye(len(reference.frequency))[:, paired])
    shape = reference.at_channels(channels)[:, paired]
    length = np.linalg.norm(shape, axis=0)
    return np.asarray(beside((errors / length).transpose(0, 2, 1), (shape / length).T).transpose(1, 2, 0))


def sensor_errors_of_mixed(
    reference: Reference, tracks: IndexArray, channels: tuple[str, ...], mixing: Mixing, base: FloatArray
) -> FloatArray:
    """Return the standard deviations of unit shapes (n, n_channels, n_errors) by sensors that read unmeasured modes.

    Measured shapes contain the errors of the sensors. The shape of a mode that was not measured, and that a change
    mixes into a compared one, is that of the model, without these errors. They are those of `sensor_errors`.

    Parameters
    ----------
    base : (n, n_channels) of the compared modes before, unit norm
    """
    paired = reference.paired[tracks]
    share = mixing.shape[:, paired].copy()
    now = (reference.at_channels(channels) @ share).T
    sign = np.where((now * base).sum(1) < 0, -1.0, 1.0)[:, None]  # the error of a sensor has one sign in all modes
    length = sign * np.linalg.norm(now, axis=1, keepdims=True)
    share[paired] = 0.0
    errors = _errors(reference, channels, np.ones(len(channels), bool), share).transpose(0, 2, 1)
    turned = turned_back(beside(errors / length, now / length), now / length, base)
    return np.asarray(turned.transpose(1, 2, 0))


def _errors(reference: Reference, channels: tuple[str, ...], chosen: BoolArray, share: FloatArray) -> FloatArray:
    """Return the standard deviations (n_errors, n_channels, n) of what chosen channels read of modes.

    Parameters
    ----------
    chosen : (n_channels,) mask of the channels with errors
    share : (n_modes, n) of the reference's modes in each
    """
    shape = reference.at_channels(channels) @ share
    across = (reference.across_channels(channels) @ share).reshape(2, *shape.shape)
    of_one = np.eye(len(channels))[chosen][:, :, None]
    gains, turns = GAIN_STD * of_one * shape, ASKEW_STD * of_one * across[:, None]
    sensor = {s.channel: s for s in reference.structure.corrected_sensors}
    places = [sensor[c].at for c in channels]
    new = dict.fromkeys(at for at, one in zip(places, chosen, strict=True) if one)
    together = (np.array([[there == at for there in places] for at in new]) & chosen)[:, None, :, None]
    offsets = PLACE_STD * size(reference.structure) * together * (reference.per_offset(channels) @ share)
    return np.concatenate([each.reshape(-1, *shape.shape) for each in (gains, turns, offsets)])


def without_sensor_errors(reference: Reference, tracks: IndexArray, base: ModalMean) -> ModalMean:
    """Return modes (n,) where the model predicts shapes with deviations by its errors alone, without those of sensors.

    Parameters
    ----------
    tracks : (n,) of the reference
    base : (n,) the baseline's modes at the compared channels
    """
    unmeasured = reference.unmeasured(base.channels)
    if not unmeasured.any():
        return base
    paired = reference.paired[tracks]
    across = reference.across_channels(base.channels)[:, paired].reshape(2, len(base.channels), -1)
    length = np.linalg.norm(reference.at_channels(base.channels)[:, paired], axis=0)
    turned = ASKEW_STD * np.linalg.norm(across, axis=0) / length
    of_model = np.sqrt(_OF_MODEL * np.maximum(base.shape_std**2 - turned.T**2, 0.0))
    return replace(base, shape_std=np.where(unmeasured, of_model, base.shape_std))

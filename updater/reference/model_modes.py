"""The modes of a model at the sensors, as if they had been measured, with the errors of a good beam model."""

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe import Model, Modes
from updater.modal_data import ModalMean
from updater.quantities import FREQUENCY_STD
from updater.reference.calibration import channel_rows, enough_modes

SHAPE_STD = 0.01  #: relative to a unit shape's components: gains are known to half a per cent, positions to millimetres
_TURNED = 0.02  # rad that sensors are turned by: share of the motion across them that they read
_STILL = 1e-9  # motion of a mode at the sensors [1/sqrt(kg)]: a smaller one is not measured


def own_modes(model: Model, measured: ModalMean, *, n_modes: int = 30) -> tuple[Modes, IndexArray, ModalMean]:
    """Return a model's modes, which of them (n_seen,) the sensors see, and these as a mean at the channels.

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
    across = channel_rows(model, measured.channels, across=True) @ modes.shape[:, seen]
    crossing: FloatArray = np.linalg.norm(across.reshape(2, *shape.T.shape), axis=0).T / length
    own = ModalMean(
        channels=measured.channels,
        n=np.ones(len(seen), np.intp),
        log_frequency=np.log(modes.frequency[seen]),
        log_frequency_std=np.full(len(seen), FREQUENCY_STD),
        damping=np.full(len(seen), np.nan),
        damping_std=np.full(len(seen), np.nan),
        shape=shape,
        shape_std=np.hypot(SHAPE_STD, _TURNED * crossing),
        imaginary=np.zeros(shape.shape),
        imaginary_std=np.full(shape.shape, SHAPE_STD),
    )
    return modes, seen, own

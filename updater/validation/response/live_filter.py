"""Estimates and innovations of signals that arrive block by block."""

from collections.abc import Sequence

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray
from updater.validation.response.response_model import Place, ResponseModel


class LiveFilter:
    """Kalman filter of a model, behind its band-pass filter run forward only: delayed, and distorted in phase alike.

    Parameters
    ----------
    model : learned from a record of the undisturbed structure
    places : whose response is estimated
    """

    def __init__(self, model: ResponseModel, places: Sequence[Place] = ()) -> None:
        self._sections = model.band_pass()
        self._kalman = model.filter(places)
        self._state = np.zeros((len(self._sections), 2, len(model.channels)))
        self._offset: FloatArray | None = None  # (n_channels,) of the first block [m/s2]
        self._left = 2 * model.settling

    @property
    def settled(self) -> bool:
        """True once transients of the start have decayed."""
        return self._left <= 0

    def run(self, data: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Continue with measured samples (n, n_channels) without gaps [m/s2].

        Returns
        -------
        (n, n_places) estimates, and (n, n_channels) innovations [m/s2]: measured less predicted from the past
        """
        if self._offset is None:
            self._offset = data.mean(0)
        self._left -= len(data)
        signals, self._state = scipy.signal.sosfilt(self._sections, data - self._offset, axis=0, zi=self._state)
        return self._kalman.run(signals)

"""Sensors predicted from those at other places: a test of the estimates where there is no sensor.

All sensors of a place are left out of the expansion of the shapes, of the excitation and of the filter. What they
measure is then the truth at a point without a sensor. The calibrated model and the damping are those of all sensors.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, Recording
from updater.errors import ModalDataError
from updater.reference import Reference
from updater.validation.response.response_model import ResponseModel, SensorSignal, places_of

_LEAST_PLACES = 4  # one of them is left out


@dataclass(frozen=True, eq=False, kw_only=True)
class PredictedSensors:
    """Signals of the sensors of one place, measured and predicted from the other places."""

    measured: Recording  #: in the band [m/s2], NaN near gaps of these sensors
    predicted: FloatArray  #: (n_samples, n_channels), NaN where the filter settles [m/s2]
    std: FloatArray  #: (n_channels,) standard deviation of the prediction, without the noise of the sensor [m/s2]


@dataclass(frozen=True, eq=False, kw_only=True)
class SensorPredictor:
    """Model that was learned without the sensors of one place."""

    channels: tuple[str, ...]  #: of the place
    model: ResponseModel

    def predict(self, recording: Recording) -> PredictedSensors:
        """Predict the sensors of the place from the others; the structure must not have changed.

        Parameters
        ----------
        recording : signals of all channels at the rate that was learned from, the delays of devices removed

        Raises
        ------
        ModalDataError
            If a channel is missing, the rate is another, no stretch without gaps is long enough, or no sample is both
            measured and predicted.
        """
        found = self.model.estimate(recording, [SensorSignal(channel=channel) for channel in self.channels])
        names = [channel.name for channel in recording.channels]
        if missing := [channel for channel in self.channels if channel not in names]:
            raise ModalDataError(f"recording: channel {missing[0]!r} of the reference is missing")
        columns = [names.index(channel) for channel in self.channels]
        channels = tuple(recording.channels[k] for k in columns)
        own = replace(recording, channels=channels, data=recording.data[:, columns])
        measured = self.model.in_band(own)
        if not np.isfinite(measured.data + found.recording.data).any():
            raise ModalDataError(f"recording: no sample of {', '.join(self.channels)} is both measured and predicted")
        return PredictedSensors(measured=measured, predicted=found.recording.data, std=found.std)


def learn_predictors(reference: Reference, recording: Recording) -> tuple[SensorPredictor, ...]:
    """Learn one predictor per measured place from a record of the undisturbed structure.

    Parameters
    ----------
    reference : learned from windows of the same structure
    recording : signals of the reference's channels, the delays of devices removed

    Raises
    ------
    ModalDataError
        If fewer than four places are measured, or `ResponseModel.learn` raises it.
    """
    places = places_of(reference)
    if len(places) < _LEAST_PLACES:
        raise ModalDataError(f"measured places: expected at least {_LEAST_PLACES}, found {len(places)}")
    return tuple(
        SensorPredictor(channels=own, model=ResponseModel.learn(reference.without(own), recording)) for own in places
    )

"""Response of a structure where there is no sensor, with its standard deviation: motion, and stresses of sections."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy  # its parts at their first use

from daq import Channel, FloatArray, IndexArray, Recording
from oma.preparation import gapless_stretches
from updater.errors import ModalDataError
from updater.reference import Reference, channel_rows
from updater.validation.response.excitation import Excitation, estimate_excitation, spectral_matrices
from updater.validation.response.kalman_filter import ModalKalmanFilter, Outputs
from updater.validation.response.modal_system import (
    NYQUIST,
    ModalSystem,
    MotionQuantity,
    band_about,
    damping_of_all,
)
from updater.validation.response.section_stress import Fibre, modal_stress

_AXES = ("x", "y", "z")
_ORDER = 4  # of the band-pass filter
_SKIRT = (0.3, 2.0)  # times the limits of the band: range in which the filter passes anything
_LINES = 4000  # of the integral of an error spectrum
_PERIODS = 3  # of the lowest frequency, in which the band-pass filter settles
_LEAST_PERIODS = 40  # periods of the lowest frequency of the band that a record has at least
_LEAST_PLACES = 3  # from which the error of shapes without a sensor is estimated


@dataclass(frozen=True, kw_only=True)
class Point:
    """Motion at a point on a member."""

    at: tuple[float, float, float]  #: [m]
    axis: int  #: global axis 0, 1, 2 = x, y, z
    quantity: MotionQuantity = "acceleration"

    @property
    def name(self) -> str:
        """Short name, such as `acceleration_z at 0.2 0 1.48`."""
        return f"{self.quantity}_{_AXES[self.axis]} at {' '.join(f'{value:g}' for value in self.at)}"


@dataclass(frozen=True, kw_only=True)
class SensorSignal:
    """Acceleration along a sensor of the structure, with its gain."""

    channel: str
    quantity: Literal["acceleration"] = "acceleration"

    @property
    def name(self) -> str:
        """Name of the signal: the channel's."""
        return self.channel


Place = Point | Fibre | SensorSignal  #: of a signal


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseEstimate:
    """Estimated signals at points without a sensor."""

    points: tuple[Place, ...]
    recording: Recording  #: (n_samples, n_points) [m, m/s, m/s2 or Pa], NaN about gaps of the measured signals
    std: FloatArray  #: (n_points,) standard deviation of the error in the band, constant over the recording
    band: tuple[float, float]  #: of the signals [Hz]
    level: float  #: root mean square of the innovations over that of the record that was learned from [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseModel:
    """Reference with the excitation and noise of a record: a model that runs in parallel to the structure.

    The signals are those in a band about the measured modes. Each standard deviation combines three errors: that of the
    Kalman filter, which follows the level of the innovations; that of the expanded shapes; that of the devices' clocks,
    by their variation about the delays that are removed. The second is estimated from sensors at n places; its
    predictive distribution is Student's with n degrees of freedom, of variance n / (n - 2).
    """

    reference: Reference
    channels: tuple[str, ...]  #: of the sensors
    rate: float  #: [Hz]
    band: tuple[float, float]  #: [Hz]
    modes: IndexArray  #: (n_modes,) of the reference in the system
    system: ModalSystem
    excitation: Excitation
    shape_error: FloatArray  #: (n_modes,) standard deviation of a component where there is no sensor over its size [-]
    innovation: FloatArray  #: (n_channels,) root mean square in the band, of the learned record [m/s2]

    @classmethod
    def learn(cls, reference: Reference, recording: Recording) -> "ResponseModel":
        """Learn from a record of the undisturbed structure.

        Parameters
        ----------
        reference : learned from windows of the same structure
        recording : signals of the reference's channels, the delays of devices removed

        Raises
        ------
        ModalDataError
            If a channel of the reference is missing, fewer than three places are measured, no stretch without gaps is
            long enough, or the rate is too low for the measured modes.
        """
        channels = reference.baseline.channels
        data = _signals(recording, channels)
        places = len(places_of(reference))
        if places < _LEAST_PLACES:
            raise ModalDataError(f"measured places: expected at least {_LEAST_PLACES}, found {places}")
        measured = np.exp(reference.baseline.log_frequency)
        highest, limit = float(measured.max()), NYQUIST * recording.rate
        if highest > limit:
            raise ModalDataError(
                f"recording: expected a rate of at least {highest / NYQUIST:.4g} Hz, found {recording.rate:g} Hz"
            )
        low, high = band_about(measured)
        band = low, min(high, limit)
        modes = np.flatnonzero(reference.frequency < NYQUIST * recording.rate)
        damping = damping_of_all(reference.baseline.damping, reference.paired, len(reference.frequency))
        system = ModalSystem(frequency=reference.frequency[modes], damping=damping[modes])
        shape = reference.at_channels(channels)[:, modes]
        start, stop = max(gapless_stretches(data), key=lambda part: part[1] - part[0], default=(0, 0))
        if stop - start < _LEAST_PERIODS * recording.rate / band[0]:
            raise ModalDataError(f"recording: {(stop - start) / recording.rate:.3g} s without a gap are too short")
        longest = data[start:stop] - data[start:stop].mean(0)
        lines, matrices = spectral_matrices(longest, recording.rate, band, system)
        share = places / (places - 2)
        error = np.sqrt(share) * shape_error(reference)[modes]
        size = np.sqrt((shape**2).mean(0))
        excitation = estimate_excitation(lines, matrices, system, shape).with_shape_errors(lines, system, error * size)
        model = cls(
            reference=reference,
            channels=channels,
            rate=recording.rate,
            band=band,
            modes=modes,
            system=system,
            excitation=excitation,
            shape_error=error,
            innovation=np.ones(len(channels)),
        )
        _, innovation = model._run(data, Outputs(state=np.zeros((0, 2 * len(modes))), force=np.zeros((0, len(modes)))))
        return replace(model, innovation=_root_mean_square(innovation))

    def filter(self, points: Sequence[Place]) -> ModalKalmanFilter:
        """Return a filter that estimates the response at points, block by block.

        Raises
        ------
        ModelError
            If a point is on no member.
        """
        return self._filter(self._outputs(points, self._modal(points)[0]))

    def estimate(self, recording: Recording, points: Sequence[Place]) -> ResponseEstimate:
        """Estimate the response at points; the structure must not have changed.

        The band-pass filter has no phase; the Kalman filter starts anew after each gap.

        Parameters
        ----------
        recording : signals of the channels at the rate that was learned from, the delays of devices removed
        points : on members

        Raises
        ------
        ModelError
            If a point is on no member.
        ModalDataError
            If a channel is missing, the rate is another, or no stretch without gaps is long enough.
        """
        if not np.isclose(recording.rate, self.rate, rtol=1e-6):
            raise ModalDataError(f"recording: expected a rate of {self.rate:g} Hz, found {recording.rate:g} Hz")
        data = _signals(recording, self.channels)
        quantities = [_derivative(point) for point in points]
        at, error = self._modal(points)
        outputs = self._outputs(points, at)
        modal = {quantity: self.system.outputs(quantity) for quantity in dict.fromkeys(quantities)}
        every = Outputs(
            state=np.vstack([outputs.state, *(state for state, _ in modal.values())]),
            force=np.vstack([outputs.force, *(force for _, force in modal.values())]),
        )
        estimates, innovation = self._run(data, every)
        level = float(np.sqrt(np.mean((_root_mean_square(innovation) / self.innovation) ** 2)))
        signals, others = estimates[:, : len(points)], estimates[:, len(points) :]
        squares = dict(zip(modal, _root_mean_square(others).reshape(len(modal), len(self.modes)) ** 2, strict=True))
        by_shape = np.array([squares[quantity] @ own**2 for quantity, own in zip(quantities, error, strict=True)])
        lines = np.geomspace(_SKIRT[0] * self.band[0], min(_SKIRT[1] * self.band[1], self.rate / 2), _LINES)
        _, gain = scipy.signal.freqz_sos(self.band_pass(), lines, fs=self.rate)
        late = np.array([*self.reference.delays.astray().values()] or [0.0])  # [s]; none where no delays were learned
        by_time = np.mean(late**2) * _root_mean_square(np.diff(signals, axis=0) * self.rate) ** 2
        variance = level**2 * self._filter(outputs).variance(lines, np.abs(gain) ** 4) + by_shape + by_time
        axes = [point.axis if isinstance(point, Point) else 0 for point in points]
        channels = tuple(
            Channel(name=point.name, device="estimated", axis=axis) for point, axis in zip(points, axes, strict=True)
        )
        return ResponseEstimate(
            points=tuple(points),
            recording=replace(recording, channels=channels, data=signals, gaps=()),
            std=np.sqrt(variance),
            band=self.band,
            level=level,
        )

    def in_band(self, recording: Recording) -> Recording:
        """Return a recording in the band of the estimates, NaN where these do not settle.

        Raises
        ------
        ModalDataError
            If no stretch without gaps is long enough.
        """
        signals = np.full_like(recording.data, np.nan)
        for part, settled in self._stretches(recording.data):
            signals[settled] = part[self.settling : -self.settling]
        return replace(recording, data=signals)

    def _modal(self, points: Sequence[Place]) -> tuple[FloatArray, FloatArray]:
        """Return the values (n_points, n_modes) of unit modal coordinates, and their standard deviations."""
        size = np.sqrt((self.reference.at_channels(self.channels)[:, self.modes] ** 2).mean(0))
        rows, error = np.empty((2, len(points), len(self.modes)))
        moving = [i for i, point in enumerate(points) if isinstance(point, Point)]
        if moving:
            places = [point for point in points if isinstance(point, Point)]
            reader = self.reference.model.reader(np.array([point.at for point in places]))
            motion = np.asarray(reader @ self.reference.shape[:, self.modes]).reshape(len(places), 6, -1)
            rows[moving] = motion[np.arange(len(places)), [point.axis for point in places]]
            error[moving] = self.shape_error * size
        sensed = [i for i, point in enumerate(points) if isinstance(point, SensorSignal)]
        own = tuple(point.channel for point in points if isinstance(point, SensorSignal))
        rows[sensed], error[sensed] = self.reference.at_channels(own)[:, self.modes], self.shape_error * size
        strained = [i for i, point in enumerate(points) if isinstance(point, Fibre)]
        stress, along = modal_stress(self.reference, [point for point in points if isinstance(point, Fibre)])
        rows[strained], error[strained] = stress[:, self.modes], self.shape_error * along[:, self.modes]
        return rows, error

    def _outputs(self, points: Sequence[Place], rows: FloatArray) -> Outputs:
        parts = [self.system.outputs(_derivative(point)) for point in points]
        n = len(self.modes)
        return Outputs(
            state=np.array([row @ state for row, (state, _) in zip(rows, parts, strict=True)]).reshape(-1, 2 * n),
            force=np.array([row @ force for row, (_, force) in zip(rows, parts, strict=True)]).reshape(-1, n),
        )

    def _filter(self, outputs: Outputs) -> ModalKalmanFilter:
        shape = self.reference.at_channels(self.channels)[:, self.modes]
        return ModalKalmanFilter(self.system, shape, self.excitation, outputs, rate=self.rate)

    def band_pass(self) -> FloatArray:
        """Return second-order sections; applied forward and backward, the gain is squared and the phase zero."""
        return np.asarray(scipy.signal.butter(_ORDER, self.band, "bandpass", fs=self.rate, output="sos"))

    def _run(self, data: FloatArray, outputs: Outputs) -> tuple[FloatArray, FloatArray]:
        """Return outputs (n_samples, n_outputs) and innovations (n_samples, n_channels), NaN where none is settled."""
        estimates = np.full((len(data), len(outputs.state)), np.nan)
        innovations = np.full(data.shape, np.nan)
        for part, settled in self._stretches(data):
            estimate, innovation = self._filter(outputs).run(part)
            estimates[settled] = estimate[self.settling : -self.settling]
            innovations[settled] = innovation[self.settling : -self.settling]
        return estimates, innovations

    def _stretches(self, data: FloatArray) -> Iterator[tuple[FloatArray, slice]]:
        """Yield the stretches without gaps in the band, and the samples at which filters that begin there settle."""
        sections, settling = self.band_pass(), self.settling
        long = [(start, stop) for start, stop in gapless_stretches(data) if stop - start > 2 * settling]
        if not long:
            raise ModalDataError("recording: no stretch without a gap is long enough for the filter to settle")
        for start, stop in long:
            part = data[start:stop] - data[start:stop].mean(0)
            yield scipy.signal.sosfiltfilt(sections, part, axis=0), slice(start + settling, stop - settling)

    @cached_property
    def settling(self) -> int:
        """Number of samples after which the filters have settled."""
        n = len(self.modes)
        kalman = self._filter(Outputs(state=np.zeros((0, 2 * n)), force=np.zeros((0, n))))
        return max(kalman.settling, round(_PERIODS * self.rate / self.band[0]))


def _derivative(point: Place) -> MotionQuantity:
    """Return the derivative of the modal coordinates that a signal is made of."""
    return "displacement" if isinstance(point, Fibre) else point.quantity


def _signals(recording: Recording, channels: tuple[str, ...]) -> FloatArray:
    """Return the data (n_samples, n_channels) of channels."""
    present = {channel.name: i for i, channel in enumerate(recording.channels)}
    missing = [name for name in channels if name not in present]
    if missing:
        raise ModalDataError(f"recording: channel {missing[0]!r} of the reference is missing")
    return recording.data[:, [present[name] for name in channels]]


def places_of(reference: Reference) -> tuple[tuple[str, ...], ...]:
    """Return the channels of the baseline, place by place."""
    at = {sensor.channel: sensor.at for sensor in reference.structure.corrected_sensors}
    places: defaultdict[tuple[float, ...], list[str]] = defaultdict(list)
    for channel in reference.baseline.channels:
        places[at[channel]].append(channel)
    return tuple(map(tuple, places.values()))


def _root_mean_square(data: FloatArray) -> FloatArray:
    """Return the root mean square (n_columns,) of data (n, n_columns) with NaN in whole rows."""
    return np.asarray(np.sqrt(np.nanmean(data**2, axis=0)))


def shape_error(reference: Reference) -> FloatArray:
    """Return the root mean square error (n_modes,) of a mode's shape over that of the shape, both at the sensors [-].

    The sensors of each place in turn are left out of the expansion of the measured modes (eqs 9 to 12). The difference
    between their measured components and the expanded ones is the error at a place without a sensor. For modes without
    a measured counterpart it is the median of the others.

    Parameters
    ----------
    reference : with measured shapes at two places at least
    """
    baseline, paired = reference.baseline, reference.paired
    rows = channel_rows(reference.model, baseline.channels)
    error = np.empty((len(paired), len(baseline.channels)))
    for place in places_of(reference):
        own = np.isin(baseline.channels, place)
        expanded = (rows @ reference.without(place).shape[:, paired]).T
        seen = baseline.shape[:, ~own]
        scale = (seen * expanded[:, ~own]).sum(1, keepdims=True) / (seen**2).sum(1, keepdims=True)
        error[:, own] = expanded[:, own] - scale * baseline.shape[:, own]
    size = ((rows @ reference.shape[:, paired]) ** 2).sum(0)
    share = np.sqrt((error**2).sum(1) / size)
    every = np.full(len(reference.frequency), float(np.median(share)))
    every[paired] = share
    return every

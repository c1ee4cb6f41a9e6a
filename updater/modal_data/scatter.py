"""Scatter of windows about their mean: the law of a single window, learned or stated."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from updater.errors import ModalDataError
from updater.modal_data.device_delays import NO_DELAYS, DeviceDelays
from updater.modal_data.tracked import ModalMean, TrackedModes, mean_modes, mean_over_windows

USUAL_OVERDISPERSION = 3.0  #: of shapes: the median of 40 simulated records of 300 s was 2.8
_AS_STATED = 1000  # degrees of freedom of deviations that are taken at their word
_WORTH_WINDOWS = 4  # windows of equal weight: eight windows of eight modes determine it to a third
_WORTH_DATA = 20  # that stated deviations are worth, where windows scatter by less
_MIN_DAMPING = 1e-9  # [-], standard deviation of one, whatever is stated


@dataclass(frozen=True, eq=False, kw_only=True)
class Scatter:
    """Scatter of windows about their mean without a change.

    Each window states a standard deviation. The ratio of the actual to the stated scatter of the baseline is one factor
    for all frequencies (and one for all shapes), pooled over modes and windows, so that few windows give many degrees
    of freedom. The errors of a shape's components are correlated, mainly along the modes nearest in frequency.
    """

    frequency_factor: float  #: actual over stated standard deviation of log frequency, after shrinkage [-]
    shape_factor: float  #: the same for shapes [-]
    #: number of correlated components of a shape's error, by the variance of chi-square [-]
    shape_overdispersion: float
    phase_factor: float  #: real over stated standard deviation of the shapes' imaginary parts [-]
    phase_overdispersion: float  #: the same for the imaginary part [-]
    damping_factor: float  #: real over stated standard deviation of damping [-]
    degrees_of_freedom: int  #: degrees of freedom of window_std
    window_std: FloatArray  #: (n_tracks,) of one window's log frequency, as windows scatter

    def mean(self, modes: TrackedModes) -> ModalMean:
        """Average windows with the standard deviations that the baseline has shown to be real."""
        return mean_modes(
            modes,
            frequency_factor=self.frequency_factor,
            shape_factor=self.shape_factor,
            phase_factor=self.phase_factor,
            damping_factor=self.damping_factor,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class BaselineModes:
    """Measured modes of a baseline: everything that is known without a model."""

    windows: TrackedModes  #: windows without a change
    scatter: Scatter  #: scatter of the windows
    mean: ModalMean  #: mean of the windows, by that scatter
    delays: DeviceDelays  #: constant delays of the devices, removed from the windows


def learn_baseline_modes(windows: TrackedModes, delays: DeviceDelays = NO_DELAYS) -> BaselineModes:
    """Learn the modes of a baseline from its windows, from which the delays have been removed.

    Raises
    ------
    ModalDataError
        With fewer than three windows, or no mode seen in two of them.
    """
    scatter = learn_scatter(windows)
    return BaselineModes(windows=windows, scatter=scatter, mean=scatter.mean(windows), delays=delays)


def learn_scatter(modes: TrackedModes) -> Scatter:
    """Learn the scatter from baseline windows.

    Raises
    ------
    ModalDataError
        With fewer than three windows, or no mode seen in two of them.
    """
    if len(modes.log_frequency) < 3:
        raise ModalDataError(f"baseline: expected at least 3 windows, found {len(modes.log_frequency)}")
    stated = np.sqrt(mean_over_windows(modes.log_frequency_std**2))
    z = (modes.log_frequency - mean_over_windows(modes.log_frequency)) / stated
    freedom = int(np.maximum(np.isfinite(z).sum(0) - 1, 0).sum())
    if not freedom:
        raise ModalDataError("baseline: expected a mode identified in at least two windows, found none")
    factor = float(np.sqrt(np.nansum(z**2) / freedom))
    shape_factor, shape_overdispersion = _spread_of_shapes(modes.shape, modes.shape_std)
    phase_factor, phase_overdispersion = _spread_of_shapes(modes.imaginary, modes.shape_std)
    damping_std = np.maximum(np.sqrt(mean_over_windows(modes.damping_std**2)), _MIN_DAMPING)
    return Scatter(
        frequency_factor=_believed(factor, freedom),
        degrees_of_freedom=freedom,
        window_std=factor * stated,
        shape_factor=shape_factor,
        shape_overdispersion=shape_overdispersion,
        phase_factor=phase_factor,
        phase_overdispersion=phase_overdispersion,
        damping_factor=_factor((modes.damping - mean_over_windows(modes.damping)) / damping_std),
    )


def _believed(factor: float, freedom: int) -> float:
    """Return the actual over the stated standard deviation; a value below 1 is shrunk by the number of data.

    Three windows of seven modes may scatter by half of the stated deviation, and their mean may still be off by all of
    it.
    """
    if factor >= 1:
        return factor
    return float(np.sqrt((_WORTH_DATA + freedom * factor**2) / (_WORTH_DATA + freedom)))


def _factor(z: FloatArray) -> float:
    """Return the real over the stated standard deviation, from deviations (n_windows, n_tracks) over the stated."""
    seen = np.isfinite(z)
    freedom = int(np.maximum(seen.sum(0) - 1, 0).sum())
    return float(np.sqrt((z[seen] ** 2).sum() / freedom)) if freedom else 1.0


def stated_scatter(modes: TrackedModes) -> Scatter:
    """Return the scatter that the records themselves state, where they are too few to learn it from."""
    stated = np.sqrt(mean_over_windows(modes.log_frequency_std**2))
    return Scatter(
        frequency_factor=1.0,
        shape_factor=1.0,
        shape_overdispersion=USUAL_OVERDISPERSION,
        phase_factor=1.0,
        phase_overdispersion=USUAL_OVERDISPERSION,
        damping_factor=1.0,
        degrees_of_freedom=_AS_STATED,
        window_std=stated,
    )


def _spread_of_shapes(shape: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Return factor and overdispersion of `Scatter`, of the shapes' real or imaginary parts."""
    z = (shape - mean_over_windows(shape)) / np.sqrt(mean_over_windows(std**2))
    # unit norm leaves a shape one free component fewer than it has channels
    freedom = int(np.maximum(np.isfinite(z[:, :, 0]).sum(0) - 1, 0).sum()) * (z.shape[2] - 1)
    factor = float(np.sqrt(np.nansum(z**2) / freedom)) if freedom else 1.0
    return factor, _overdispersion(z / max(factor, 1e-12))


def _overdispersion(z: FloatArray) -> float:
    """Return tr(R^2) / tr(R), pooled over modes, of the components' covariance R; one if they are independent.

    tr(R^2) is estimated without bias from few windows (Bai and Saranadasa, Statistica Sinica 6 (1996) 311-329), and
    shrunk towards the value of records of other structures.

    Parameters
    ----------
    z : (n_windows, n_tracks, n_channels) deviations from the mean, standardised; NaN where a window lacks a mode
    """
    squares = traces = 0.0
    for track in range(z.shape[1]):
        rows = z[np.isfinite(z[:, track, 0]), track]
        n = len(rows) - 1
        if n < 2:
            continue
        covariance = rows.T @ rows / n
        trace = float(np.trace(covariance))
        squares += n**2 / ((n - 1) * (n + 2)) * (float((covariance**2).sum()) - trace**2 / n)
        traces += trace
    n = len(z) if traces else 0
    seen = max(1.0, squares / traces) if traces else 1.0
    return (n * seen + _WORTH_WINDOWS * USUAL_OVERDISPERSION) / (n + _WORTH_WINDOWS)

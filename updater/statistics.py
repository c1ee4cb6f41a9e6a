"""Means of tracked modes over windows, and how far a window may lie from them by chance."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.stats import f as f_distribution

from daq import FloatArray, IndexArray
from oma import ModalEstimate
from updater.delays import split_shape
from updater.errors import ModalDataError
from updater.modal_checks import check_windows

_USUAL_OVERDISPERSION = 3.0  # of shapes: the median of 40 simulated records of 300 s was 2.8
_AS_STATED = 1000  # degrees of freedom of deviations that are taken at their word
_WORTH_WINDOWS = 4  # that this knowledge is worth: eight windows of eight modes tell it to a third
_WORTH_DATA = 20  # that stated deviations are worth, where windows scatter by less
_LEAST_DAMPING = 1e-9  # [-], standard deviation of one, whatever is stated
COMMON_STD = 3e-3  # of a change common to all log frequencies (temperature: steel 0.018 %/K)


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackedModes:
    """Modes of many windows in the order of their tracks; NaN where a window lacks one."""

    channels: tuple[str, ...]
    log_frequency: FloatArray  #: (n_windows, n_tracks) [ln Hz]
    log_frequency_std: FloatArray  #: (n_windows, n_tracks)
    damping: FloatArray  #: (n_windows, n_tracks) [-]
    damping_std: FloatArray  #: (n_windows, n_tracks)
    shape: FloatArray  #: (n_windows, n_tracks, n_channels) real, unit norm [-]
    shape_std: FloatArray  #: (n_windows, n_tracks, n_channels), of the imaginary part too
    imaginary: FloatArray  #: (n_windows, n_tracks, n_channels) of the shape, turned to be least; NaN: a real estimate

    def windows(self, chosen: IndexArray) -> "TrackedModes":
        """Return some of the windows."""
        kept = {f.name: getattr(self, f.name)[chosen] for f in fields(self) if f.name != "channels"}
        return TrackedModes(channels=self.channels, **kept)

    def tracks(self, chosen: IndexArray) -> "TrackedModes":
        """Return some of the tracks; NaN for those given as -1."""
        kept = {}
        for f in fields(self):
            if f.name != "channels":
                values = getattr(self, f.name)[:, chosen]
                unknown = (chosen < 0).reshape(1, -1, *[1] * (values.ndim - 2))
                kept[f.name] = np.where(unknown, np.nan, values)
        return TrackedModes(channels=self.channels, **kept)


def stack_tracks(estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray]) -> TrackedModes:
    """Order the modes of windows by track; `tracks` holds for each window (n_tracks,) indices into its modes, or -1.

    Windows that lack channels of the first keep their frequencies and give no shapes.

    Raises
    ------
    ModalDataError
        Naming the window and the mode that cannot be right.
    """
    check_windows(estimates, tracks)
    channels = max((e.channels for e in estimates), key=len)
    n_windows, n_tracks = len(estimates), len(tracks[0])
    flat = np.full((4, n_windows, n_tracks), np.nan)
    shaped = np.full((3, n_windows, n_tracks, len(channels)), np.nan)
    for w, (estimate, track) in enumerate(zip(estimates, tracks, strict=True)):
        seen = np.flatnonzero(track >= 0)
        mode = track[seen]
        flat[0, w, seen] = np.log(estimate.frequency[mode])
        flat[1, w, seen] = estimate.frequency_std[mode] / estimate.frequency[mode]
        flat[2, w, seen] = estimate.damping[mode]
        flat[3, w, seen] = estimate.damping_std[mode]
        if estimate.channels == channels:
            shaped[0, w, seen], imaginary = split_shape(estimate.shape[mode])
            shaped[1, w, seen] = estimate.shape_std[mode]
            shaped[2, w, seen] = imaginary if np.iscomplex(estimate.shape).any() else np.nan
    _same_signs(shaped[0], shaped[2])
    return TrackedModes(
        channels=channels,
        log_frequency=flat[0],
        log_frequency_std=flat[1],
        damping=flat[2],
        damping_std=flat[3],
        shape=shaped[0],
        shape_std=shaped[1],
        imaginary=shaped[2],
    )


def _same_signs(shape: FloatArray, imaginary: FloatArray) -> None:
    """Turn each track's shapes (n_windows, n_tracks, n_channels) to the sign of its first, in place."""
    for track in range(shape.shape[1]):
        seen = np.flatnonzero(np.isfinite(shape[:, track, 0]))
        if len(seen):
            agreement = shape[seen, track] @ shape[seen[0], track]
            sign = np.where(agreement < 0, -1.0, 1.0)[:, None]
            shape[seen, track] *= sign
            imaginary[seen, track] *= sign


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalMean:
    """Mean of tracked modes; standard deviations are of the mean. NaN for a track never seen."""

    channels: tuple[str, ...]
    n: IndexArray  #: (n_tracks,) windows that entered
    log_frequency: FloatArray  #: (n_tracks,) [ln Hz]
    log_frequency_std: FloatArray  #: (n_tracks,)
    damping: FloatArray  #: (n_tracks,) [-]
    damping_std: FloatArray  #: (n_tracks,)
    shape: FloatArray  #: (n_tracks, n_channels) unit norm [-]
    shape_std: FloatArray  #: (n_tracks, n_channels)
    imaginary: FloatArray  #: (n_tracks, n_channels) of the shape, turned to be least; NaN where phases are not known
    imaginary_std: FloatArray  #: (n_tracks, n_channels)

    def at(self, channels: tuple[str, ...]) -> "ModalMean":
        """Return the same modes at some of the channels, at unit norm there."""
        if channels == self.channels:
            return self
        column = [self.channels.index(c) for c in channels]
        norm = np.linalg.norm(self.shape[:, column], axis=1, keepdims=True)
        names = ("shape", "shape_std", "imaginary", "imaginary_std")
        return replace(self, channels=channels, **{name: getattr(self, name)[:, column] / norm for name in names})

    def without_shapes(self) -> "ModalMean":
        """Return the same modes as if only their frequencies had been measured."""
        unknown = np.full(self.shape.shape, np.nan)
        return replace(self, shape=unknown, shape_std=unknown, imaginary=unknown, imaginary_std=unknown)

    def joined(self, other: "ModalMean") -> "ModalMean":
        """Return these modes and then another's, at the same channels."""
        both = {
            f.name: np.concatenate([getattr(self, f.name), getattr(other, f.name)])
            for f in fields(self)
            if f.name != "channels"
        }
        return ModalMean(channels=self.channels, **both)

    def only(self, tracks: IndexArray) -> "ModalMean":
        """Return the mean of some tracks."""
        kept = {f.name: getattr(self, f.name)[tracks] for f in fields(self) if f.name != "channels"}
        return ModalMean(channels=self.channels, **kept)


def mean_modes(
    modes: TrackedModes,
    *,
    frequency_factor: float = 1.0,
    shape_factor: float = 1.0,
    phase_factor: float = 1.0,
    damping_factor: float = 1.0,
) -> ModalMean:
    """Average windows; the factors correct the windows' own standard deviations (see `Scatter`)."""
    n = np.isfinite(modes.log_frequency).sum(0).astype(np.intp)
    n_shape = np.isfinite(modes.shape[:, :, 0]).sum(0)
    shape = _mean(modes.shape)
    size = np.linalg.norm(shape, axis=1, keepdims=True)
    return ModalMean(
        channels=modes.channels,
        n=n,
        log_frequency=_mean(modes.log_frequency),
        log_frequency_std=frequency_factor * _std_of_mean(modes.log_frequency_std, n),
        damping=_mean(modes.damping),
        damping_std=damping_factor * _std_of_mean(modes.damping_std, n),
        shape=shape / size,
        shape_std=shape_factor * _std_of_mean(modes.shape_std, n_shape[:, None]),
        imaginary=_mean(modes.imaginary) / size,
        imaginary_std=phase_factor * _std_of_mean(modes.shape_std, n_shape[:, None]),
    )


def _mean(values: FloatArray) -> FloatArray:
    seen = np.isfinite(values)
    count = seen.sum(0)
    total = np.where(seen, values, 0).sum(0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _std_of_mean(std: FloatArray, n: IndexArray) -> FloatArray:
    return np.asarray(np.sqrt(_mean(std**2) / np.maximum(n, 1)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Scatter:
    """Scatter of windows about their mean without a change.

    Each window states a standard deviation; what the baseline really scatters over what was stated is one factor for
    all frequencies (and one for all shapes), pooled over modes and windows, so that few windows give many degrees
    of freedom. A shape's components err together, largely along the modes nearest in frequency.
    """

    frequency_factor: float  #: real over stated standard deviation of log frequency, as far as believed [-]
    shape_factor: float  #: the same for shapes [-]
    shape_overdispersion: float  #: how many of a shape's components err as one, by the variance of chi-square [-]
    phase_factor: float  #: real over stated standard deviation of the shapes' imaginary parts [-]
    phase_overdispersion: float  #: how many of the imaginary part's components err as one [-]
    damping_factor: float  #: real over stated standard deviation of damping [-]
    degrees_of_freedom: int  #: of window_std
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


def learn_scatter(modes: TrackedModes) -> Scatter:
    """Learn the scatter from baseline windows.

    Raises
    ------
    ModalDataError
        With fewer than three windows, or no mode seen in two of them.
    """
    if len(modes.log_frequency) < 3:
        raise ModalDataError(f"baseline: expected at least 3 windows, found {len(modes.log_frequency)}")
    stated = np.sqrt(_mean(modes.log_frequency_std**2))
    z = (modes.log_frequency - _mean(modes.log_frequency)) / stated
    freedom = int(np.maximum(np.isfinite(z).sum(0) - 1, 0).sum())
    if not freedom:
        raise ModalDataError("baseline: expected a mode seen in at least two windows, found none")
    factor = float(np.sqrt(np.nansum(z**2) / freedom))
    shape_factor, shape_overdispersion = _spread_of_shapes(modes.shape, modes.shape_std)
    phase_factor, phase_overdispersion = _spread_of_shapes(modes.imaginary, modes.shape_std)
    return Scatter(
        frequency_factor=_believed(factor, freedom),
        degrees_of_freedom=freedom,
        window_std=factor * stated,
        shape_factor=shape_factor,
        shape_overdispersion=shape_overdispersion,
        phase_factor=phase_factor,
        phase_overdispersion=phase_overdispersion,
        damping_factor=_factor(
            (modes.damping - _mean(modes.damping)) / np.maximum(np.sqrt(_mean(modes.damping_std**2)), _LEAST_DAMPING)
        ),
    )


def _believed(factor: float, freedom: int) -> float:
    """Return the real over the stated standard deviation; less than is stated is believed as far as there are data.

    Three windows of seven modes may scatter by half of what is stated, and their mean still be off by all of it.
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
    stated = np.sqrt(_mean(modes.log_frequency_std**2))
    return Scatter(
        frequency_factor=1.0,
        shape_factor=1.0,
        shape_overdispersion=_USUAL_OVERDISPERSION,
        phase_factor=1.0,
        phase_overdispersion=_USUAL_OVERDISPERSION,
        damping_factor=1.0,
        degrees_of_freedom=_AS_STATED,
        window_std=stated,
    )


def _spread_of_shapes(shape: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Return factor and overdispersion of `Scatter`, of the shapes' real or imaginary parts."""
    z = (shape - _mean(shape)) / np.sqrt(_mean(std**2))
    # unit norm leaves a shape one free component fewer than it has channels
    freedom = int(np.maximum(np.isfinite(z[:, :, 0]).sum(0) - 1, 0).sum()) * (z.shape[2] - 1)
    factor = float(np.sqrt(np.nansum(z**2) / freedom)) if freedom else 1.0
    return factor, _overdispersion(z / max(factor, 1e-12))


def _overdispersion(z: FloatArray) -> float:
    """Return tr(R^2) / tr(R), pooled over modes, of the components' covariance R; one if they are independent.

    tr(R^2) is estimated without bias from few windows (Bai and Saranadasa, Statistica Sinica 6 (1996) 311-329), and
    drawn towards what records of other structures showed.

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
    return (n * seen + _WORTH_WINDOWS * _USUAL_OVERDISPERSION) / (n + _WORTH_WINDOWS)


def novelty(log_frequency: FloatArray, baseline: ModalMean, scatter: Scatter) -> tuple[float, int]:
    """Return T2 over its degrees of freedom p, and p, of one window's log frequencies (n_tracks,).

    While nothing has changed it follows F(p, scatter.degrees_of_freedom): the predictive distribution, which allows
    for what the baseline itself does not know. A window that states a larger deviation than the baseline's is not
    believed more.
    """
    variance = scatter.window_std**2 + baseline.log_frequency_std**2
    z2 = (log_frequency - baseline.log_frequency) ** 2 / variance
    p = int(np.isfinite(z2).sum())
    return (float(np.nansum(z2) / p) if p else 0.0), p


def novelty_limit(p: int, scatter: Scatter, false_alarm_probability: float) -> float:
    """Return the limit of `novelty` for p modes at a false alarm probability a window."""
    return float(f_distribution.isf(false_alarm_probability, max(p, 1), scatter.degrees_of_freedom))

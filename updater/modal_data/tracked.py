"""Modes of many windows in the order of their tracks, and their means."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from daq import FloatArray, IndexArray
from oma import ModalEstimate
from updater.errors import ModalDataError
from updater.modal_data.device_delays import split_shape

_OF_SHAPES = ("shape", "shape_std", "imaginary", "imaginary_std")
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
    """Order the modes of windows by track.

    Parameters
    ----------
    estimates : of the windows
    tracks : per window (n_tracks,) indices into its modes, -1 for a mode that was not seen

    Returns
    -------
    TrackedModes
        (n_windows, n_tracks), NaN for a mode that was not seen.

    Notes
    -----
    Shapes are of the windows with the most channels of those that show a track; others give frequencies only.

    Raises
    ------
    ModalDataError
        Naming the window and the mode that cannot be right.
    """
    check_windows(estimates, tracks)
    showing = [e.channels for e, track in zip(estimates, tracks, strict=True) if (track >= 0).any()]
    channels = max(showing or [e.channels for e in estimates], key=len)
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

    @property
    def has_shapes(self) -> bool:
        """Return whether shapes were measured: stand-ins are the same in all windows, without a deviation."""
        return bool((self.shape_std > 0).any())

    def at(self, channels: tuple[str, ...]) -> "ModalMean":
        """Return the same modes at some of the channels, at unit norm there."""
        if channels == self.channels:
            return self
        column = [self.channels.index(c) for c in channels]
        some = {name: getattr(self, name)[:, column] for name in _OF_SHAPES}
        return replace(self, channels=channels, **some).at_unit_norm()

    def at_unit_norm(self) -> "ModalMean":
        """Return the same modes with shapes of unit norm; without any motion, all are as likely: deviations of one."""
        norm = np.linalg.norm(self.shape, axis=1, keepdims=True)
        moves = norm != 0
        known = {name: getattr(self, name) / np.where(moves, norm, 1.0) for name in _OF_SHAPES}
        any_one = {
            "shape": self.shape.shape[1] ** -0.5,
            "shape_std": 1.0,
            "imaginary": 0.0,
            "imaginary_std": 1.0,
        }
        return replace(self, **{name: np.where(moves, known[name], any_one[name]) for name in _OF_SHAPES})

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
    """Average windows.

    Parameters
    ----------
    modes : (n_windows, n_tracks); a value that is NaN is left out
    frequency_factor, shape_factor, phase_factor, damping_factor : factors [-] on the windows' standard deviations
        (`Scatter`)

    Returns
    -------
    ModalMean
        (n_tracks,), each with its number of windows; NaN for a track that no window shows.
    """
    n = np.isfinite(modes.log_frequency).sum(0).astype(np.intp)
    n_shape = np.isfinite(modes.shape[:, :, 0]).sum(0)
    shape = mean_over_windows(modes.shape)
    size = np.linalg.norm(shape, axis=1, keepdims=True)
    return ModalMean(
        channels=modes.channels,
        n=n,
        log_frequency=mean_over_windows(modes.log_frequency),
        log_frequency_std=frequency_factor * _std_of_mean(modes.log_frequency_std, n),
        damping=mean_over_windows(modes.damping),
        damping_std=damping_factor * _std_of_mean(modes.damping_std, n),
        shape=shape / size,
        shape_std=shape_factor * _std_of_mean(modes.shape_std, n_shape[:, None]),
        imaginary=mean_over_windows(modes.imaginary) / size,
        imaginary_std=phase_factor * _std_of_mean(modes.shape_std, n_shape[:, None]),
    )


def mean_over_windows(values: FloatArray) -> FloatArray:
    """Return the mean over the first axis of the values that are finite; NaN where none is."""
    seen = np.isfinite(values)
    count = seen.sum(0)
    total = np.where(seen, values, 0).sum(0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _std_of_mean(std: FloatArray, n: IndexArray) -> FloatArray:
    return np.asarray(np.sqrt(mean_over_windows(std**2) / np.maximum(n, 1)))


def check_windows(estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray]) -> None:
    """Refuse windows with invalid modes.

    Parameters
    ----------
    estimates : modes of each window
    tracks : (n_tracks,) indices into each window's modes, or -1

    Raises
    ------
    ModalDataError
        Naming the window and the mode: one on two tracks, no positive frequency, a shape of zeros or with gaps.
    """
    for number, (estimate, track) in enumerate(zip(estimates, tracks, strict=True)):
        used = track[track >= 0]
        twice = np.flatnonzero(np.bincount(used, minlength=1) > 1)
        if len(twice):
            raise ModalDataError(f"window {number}: mode {twice[0]} is on more than one track")
        for mode in used:
            fault = _fault(estimate, int(mode))
            if fault:
                raise ModalDataError(f"window {number}, mode {mode}: {fault}")


def _fault(estimate: ModalEstimate, mode: int) -> str:
    frequency, shape = estimate.frequency[mode], estimate.shape[mode]
    if not (np.isfinite(frequency) and frequency > 0):
        return f"expected a frequency over 0 Hz, found {frequency:g} (a rigid-body mode?)"
    if not np.isfinite(shape).all():
        channel = estimate.channels[int(np.argmin(np.isfinite(shape)))]
        return f"the shape at {frequency:.4g} Hz has no value at channel {channel}"
    return "" if shape.any() else f"the shape at {frequency:.4g} Hz is zero at every channel"

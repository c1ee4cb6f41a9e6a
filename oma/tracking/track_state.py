"""State of tracked modes: a value that is passed in and out and can be stored in a file."""

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from daq.bounded_text import parse_json
from oma.types import ComplexArray, ModalEstimate

_ARRAYS = ("identity", "log_frequency", "shape", "seen", "since", "first", "last")  # of Tracks, but for the covariance
_EXACT = 3e-4  # error of identification in ln f beyond the stated deviation


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracks:
    """State of the modes identified so far."""

    channels: tuple[str, ...]
    time: int  #: time of the last window [ns UTC]
    identity: IndexArray  #: (n_tracks,) never given twice [-]
    log_frequency: FloatArray  #: (n_tracks,) [ln Hz]
    covariance: FloatArray  #: (n_tracks, n_tracks) of the log frequencies [-]
    shape: ComplexArray  #: (n_tracks, n_channels) slow mean, unit norm [-]
    seen: IndexArray  #: (n_tracks,) windows that showed the mode [-]
    since: IndexArray  #: (n_tracks,) windows since the first of them, it included [-]
    first: IndexArray  #: (n_tracks,) end of the first of them [ns UTC]
    last: IndexArray  #: (n_tracks,) end of the last of them [ns UTC]
    next_identity: int  #: identity of the next new mode

    @property
    def frequency(self) -> FloatArray:
        """Expected frequency of each mode (n_tracks,) [Hz]."""
        return np.exp(self.log_frequency)

    @property
    def frequency_std(self) -> FloatArray:
        """Standard deviations of the expected frequencies (n_tracks,) [Hz]."""
        return np.asarray(self.frequency * np.sqrt(np.diag(self.covariance)))

    def to_json(self) -> str:
        """Return all of it as text, to the last digit."""
        shape = np.stack([self.shape.real, self.shape.imag], axis=-1)
        return json.dumps(
            {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()}
            | {"shape": shape.tolist()}
        )

    @classmethod
    def from_json(cls, text: str) -> "Tracks":
        """Read the output of `to_json`.

        Raises
        ------
        ValueError
            If the text is not such an output.
        """
        try:
            values: dict[str, Any] = parse_json(text)
            parts = np.array(values["shape"], np.float64).reshape(-1, len(values["channels"]), 2)
            values |= {"channels": tuple(values["channels"]), "shape": parts.view(np.complex128)[..., 0]}
            n = len(values["identity"])
            for name in ("identity", "seen", "since", "first", "last"):
                values[name] = np.array(values[name], np.intp)
            values["log_frequency"] = np.array(values["log_frequency"], np.float64)
            values["covariance"] = np.array(values["covariance"], np.float64).reshape(n, n)
            return cls(**values)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"tracks: expected what Tracks.to_json writes: {error!r}") from error


def no_tracks(estimate: ModalEstimate) -> Tracks:
    """Return the memory before the first window."""
    empty, indices = np.empty(0), np.empty(0, np.intp)
    return Tracks(
        channels=estimate.channels,
        time=estimate.start,
        identity=indices,
        log_frequency=empty,
        covariance=np.empty((0, 0)),
        shape=np.empty((0, len(estimate.channels)), np.complex128),
        seen=indices,
        since=indices,
        first=indices,
        last=indices,
        next_identity=1,
    )


def only(tracks: Tracks, kept: IndexArray) -> Tracks:
    """Return some of the tracks."""
    arrays = {name: getattr(tracks, name)[kept] for name in _ARRAYS}
    return replace(tracks, covariance=tracks.covariance[np.ix_(kept, kept)], **arrays)


def relative_variance(estimate: ModalEstimate) -> FloatArray:
    """Return the variance of the log frequencies (n_modes,)."""
    return np.asarray((estimate.frequency_std / estimate.frequency) ** 2 + _EXACT**2)


def common_places(tracks: Tracks, estimate: ModalEstimate) -> tuple[IndexArray, IndexArray]:
    """Return the positions of the common channels in the tracks and in the estimate.

    Raises
    ------
    ValueError
        If there are fewer than two.
    """
    common = [name for name in tracks.channels if name in estimate.channels]
    if len(common) < 2:
        raise ValueError(f"estimate: expected at least 2 of the channels {tracks.channels}, found {estimate.channels}")
    ours, theirs = ([names.index(name) for name in common] for names in (tracks.channels, estimate.channels))
    return np.array(ours, np.intp), np.array(theirs, np.intp)


def joined(tracks: Tracks, estimate: ModalEstimate, new: IndexArray) -> Tracks:
    """Return the tracks with new ones for some modes of an estimate."""
    if not len(new):
        return tracks
    n, m = len(tracks.identity), len(new)
    covariance = np.zeros((n + m, n + m))
    covariance[:n, :n] = tracks.covariance
    covariance[n:, n:] = np.diag(relative_variance(estimate)[new])
    shape = np.zeros((m, len(tracks.channels)), np.complex128)
    ours, theirs = common_places(tracks, estimate)
    shape[:, ours] = estimate.shape[np.ix_(new, theirs)]
    return replace(
        tracks,
        identity=np.concatenate([tracks.identity, tracks.next_identity + np.arange(m)]),
        log_frequency=np.concatenate([tracks.log_frequency, np.log(estimate.frequency[new])]),
        covariance=covariance,
        shape=np.concatenate([tracks.shape, shape]),
        seen=np.concatenate([tracks.seen, np.ones(m, np.intp)]),
        since=np.concatenate([tracks.since, np.ones(m, np.intp)]),
        first=np.concatenate([tracks.first, np.full(m, estimate.end)]),
        last=np.concatenate([tracks.last, np.full(m, estimate.end)]),
        next_identity=tracks.next_identity + m,
    )

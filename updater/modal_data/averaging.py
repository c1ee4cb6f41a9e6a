"""Modes of many windows: identified, tracked and averaged to one estimate."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from oma import (
    ComplexArray,
    IdentificationError,
    ModalEstimate,
    Tracker,
    merge,
    normalise,
)
from oma.windows import Windows, common_band
from updater.modal_data.plausibility import doubles
from updater.modal_data.scatter import learn_scatter
from updater.modal_data.tracked import mean_modes, stack_tracks

MIN_PRESENCE = 0.7  #: share of windows that must show a mode for it to be tracked [-]
_MIN_CHANNELS = 2  # in common, that shapes of two windows are compared at
_MODAL = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")


@dataclass(frozen=True, eq=False, kw_only=True)
class FusedModes:
    """One estimate out of many windows; its standard deviations are of the means."""

    estimate: ModalEstimate
    n: IndexArray  #: (n_modes,) windows that entered
    scatter: float | None  #: real over stated standard deviation of frequencies; None with fewer than three windows


def choose_tracks(
    estimates: Sequence[ModalEstimate], least_presence: float = MIN_PRESENCE, *, identified: bool = True
) -> tuple[ModalEstimate, IndexArray, list[IndexArray]]:
    """Find the modes that most windows show.

    Parameters
    ----------
    estimates : of the windows
    least_presence : share of windows that must show a mode [-]
    identified : whether windows may have one mode twice by chance, which goes then; else that is someone's mistake

    Returns
    -------
    seed : the window that names the tracks: with the most modes of those that share channels with the most windows
    kept : (n_tracks,) modes of the seed that are seen often enough
    tracks : for each window (n_tracks,) indices into its modes, or -1
    """
    seed = _seed(estimates)
    assigned = np.array([Tracker(reference=seed).assign(e) for e in estimates])
    kept = np.flatnonzero((assigned >= 0).mean(0) >= least_presence)
    if identified and len(kept):
        kept = np.delete(kept, doubles(mean_modes(stack_tracks(estimates, list(assigned[:, kept])))))
    return seed, kept, list(assigned[:, kept])


def _seed(estimates: Sequence[ModalEstimate]) -> ModalEstimate:
    """Return the window with the most modes of those that can be compared with the most windows.

    Windows without data of different devices may have no channel in common.
    """
    times = Counter(e.channels for e in estimates)
    comparable = {
        channels: sum(n for others, n in times.items() if len(set(channels) & set(others)) >= _MIN_CHANNELS)
        for channels in times
    }
    return max(estimates, key=lambda e: (comparable[e.channels], e.n_modes))


def fuse(estimates: Sequence[ModalEstimate]) -> FusedModes:
    """Average the modes that most windows show.

    Standard deviations are those of the means. From three windows on they are corrected by the ratio of actual to
    stated scatter, but never reduced.

    Raises
    ------
    IdentificationError
        If no mode is identified in `MIN_PRESENCE` of the windows.
    """
    if len(estimates) == 1:
        return FusedModes(estimate=estimates[0], n=np.ones(estimates[0].n_modes, np.intp), scatter=None)
    tracks = _all_tracks(estimates) if estimates else [np.empty(0, np.intp)]
    if not len(tracks[0]):
        raise IdentificationError(f"no mode is identified in {MIN_PRESENCE:.0%} of the {len(estimates)} windows")
    stacked = stack_tracks(estimates, tracks)
    scatter = learn_scatter(stacked) if len(estimates) > 2 else None
    frequency_factor = max(1.0, scatter.frequency_factor) if scatter else 1.0
    shape_factor = max(1.0, scatter.shape_factor) if scatter else 1.0
    mean = mean_modes(stacked, frequency_factor=frequency_factor, shape_factor=shape_factor)
    frequency = np.exp(mean.log_frequency)
    estimate = ModalEstimate(
        channels=mean.channels,
        frequency=frequency,
        frequency_std=frequency * mean.log_frequency_std,
        damping=mean.damping,
        damping_std=frequency_factor * np.sqrt(_mean(estimates, tracks, "damping_std", 2) / mean.n),
        shape=_mean_shapes(estimates, tracks, mean.channels),
        shape_std=mean.shape_std,
        support=_mean(estimates, tracks, "support"),
        law_ratio=_mean(estimates, tracks, "law_ratio"),
        start=min(e.start for e in estimates),
        end=max(e.end for e in estimates),
    )
    return FusedModes(estimate=estimate, n=mean.n, scatter=scatter.frequency_factor if scatter else None)


def _all_tracks(estimates: Sequence[ModalEstimate]) -> list[IndexArray]:
    """Return the tracks of `choose_tracks`, and of modes that its seed lacks but most windows show, by frequency."""
    everything = _seed(estimates)
    for estimate in estimates:
        if estimate.channels == everything.channels:
            known = Tracker(reference=everything).assign(estimate)
            everything = _joined(everything, estimate, np.setdiff1d(np.arange(estimate.n_modes), known))
    assigned = np.array([Tracker(reference=everything).assign(e) for e in estimates])
    kept = np.flatnonzero((assigned >= 0).mean(0) >= MIN_PRESENCE)
    return list(assigned[:, kept[np.argsort(everything.frequency[kept])]])


def _joined(estimate: ModalEstimate, other: ModalEstimate, modes: IndexArray) -> ModalEstimate:
    """Return an estimate with some modes of another one appended."""
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(estimate, name), getattr(other, name)[modes]]) for name in _MODAL
    }
    return replace(estimate, **joined)


def _mean(estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray], name: str, power: int = 1) -> FloatArray:
    """Return the mean over the windows that show each track (n_tracks,) of a power of one field."""
    values = [np.where(t >= 0, getattr(e, name)[t] ** power, np.nan) for e, t in zip(estimates, tracks, strict=True)]
    return np.asarray(np.nanmean(values, axis=0))


def _mean_shapes(
    estimates: Sequence[ModalEstimate], tracks: Sequence[IndexArray], channels: tuple[str, ...]
) -> ComplexArray:
    """Return the mean complex shapes (n_tracks, n_channels) of the windows that have all channels."""
    total = np.zeros((len(tracks[0]), len(channels)), np.complex128)
    for estimate, track in zip(estimates, tracks, strict=True):
        if estimate.channels == channels:
            shape = np.where((track >= 0)[:, None], estimate.shape[track], 0)
            sign = np.where(np.real(np.sum(shape * total.conj(), axis=1)) < 0, -1.0, 1.0)
            total += sign[:, None] * shape
    return normalise(total)


_SAME_TONE = 2e-3  # relative difference of frequencies up to which tones of two set-ups are the same one


def merge_setups(parts: Sequence[tuple[Windows, FusedModes]], references: Sequence[str]) -> tuple[Windows, FusedModes]:
    """Merge the results of set-ups; a set-up takes the place of a window.

    Raises
    ------
    ValueError
        If a set-up lacks a reference, or two of them share another channel.
    NoCommonModes
        If no mode is identified in all set-ups.
    """
    windows = [part for part, _ in parts]
    estimates = tuple(fused.estimate for _, fused in parts)
    merged = merge(estimates, references)
    faults = {channel: fault for part in reversed(windows) for channel, fault in part.faults.items()}
    tones = np.sort(np.concatenate([w.harmonics for w in windows]))
    new = np.diff(np.log(tones), prepend=-np.inf) > _SAME_TONE
    return (
        Windows(
            estimates=estimates,
            harmonics=tones[new],
            channels={c: str(faults.get(c, "ok")) for w in windows for c in w.channels},
            quality=tuple(quality for w in windows for quality in w.quality),
            problems=tuple(problem for w in windows for problem in w.problems),
            start=min(w.start for w in windows),
            end=max(w.end for w in windows),
            rate=windows[0].rate,
            may_be_tones=np.concatenate([w.may_be_tones for w in windows]),
            band=common_band([w.band for w in windows if w.band]),
            faults=faults,
        ),
        FusedModes(estimate=merged, n=np.full(merged.n_modes, len(parts), np.intp), scatter=None),
    )

"""Modes of many windows: identified, tracked and averaged to one estimate."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray, Recording
from oma import (
    ChannelFault,
    ComplexArray,
    IdentificationError,
    Method,
    ModalEstimate,
    Tracker,
    WindowQuality,
    channel_faults,
    identify_all,
    normalise,
)
from updater import doubles, learn_scatter, mean_modes, stack_tracks

LEAST_PRESENCE = 0.7  #: share of windows that must show a mode for it to be tracked [-]
_MODAL = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")
_SAME_TONE = 2e-3  # relative difference of frequencies up to which tones are the same one


@dataclass(frozen=True, eq=False, kw_only=True)
class Windows:
    """Identified windows of a recording."""

    estimates: tuple[ModalEstimate, ...]  #: of the windows that gave modes
    harmonics: FloatArray  #: (n_harmonics,) tones seen in most of these windows [Hz]
    channels: dict[str, str]  #: "ok", or what is wrong and in how many windows
    quality: tuple[WindowQuality, ...]  #: of the windows that gave modes
    problems: tuple[str, ...]  #: of the windows that gave none
    start: int  #: of the earliest window [ns UTC]
    end: int  #: of the latest one [ns UTC]
    rate: float  #: samples a second [Hz]
    delays: tuple[Mapping[str, float], ...] = ()  #: of the windows that gave modes: taken out of each device [s]
    may_be_tones: FloatArray = field(default_factory=lambda: np.empty(0))
    """(n,) frequencies of modes that may be tones in most of these windows [Hz]"""
    frequency_moves: tuple[FloatArray, ...] = ()
    """Of the windows that gave modes: (n_modes, n_blocks) influence of each block of time on each frequency [Hz]"""
    band: tuple[float, float] | None = None  #: band analysed in all these windows [Hz]; None: modes from elsewhere
    faults: Mapping[str, ChannelFault] = field(default_factory=dict)  #: most frequent fault of each faulty channel

    @property
    def worst_quality(self) -> WindowQuality:
        """Lowest quality among the windows with modes."""
        return WindowQuality(
            complete=min(q.complete for q in self.quality),
            rms_variation=max(q.rms_variation for q in self.quality),
            cycles=min(q.cycles for q in self.quality),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FusedModes:
    """One estimate out of many windows; its standard deviations are of the means."""

    estimate: ModalEstimate
    n: IndexArray  #: (n_modes,) windows that entered
    scatter: float | None  #: real over stated standard deviation of frequencies; None with fewer than three windows


def identify_windows(
    recordings: Iterable[Recording],
    method: Method | None = None,
    band: tuple[float, float] | None = None,
    on_window: Callable[[Recording], None] = lambda _: None,
    *,
    uncertain: bool = False,
) -> Windows:
    """Identify the modes of each window.

    Parameters
    ----------
    recordings : windows
    method, band : as for `oma.identify`
    on_window : called before each window is analysed
    uncertain : keep modes that may be tones (`oma.Identification.may_be_tone`)

    Raises
    ------
    IdentificationError
        If there is no window.
    ValueError
        If the band is empty or beyond the rate.
    """
    estimates: list[ModalEstimate] = []
    tones: list[FloatArray] = []
    problems: list[str] = []
    faults: list[Mapping[str, ChannelFault]] = []
    names: dict[str, None] = {}
    qualities: list[WindowQuality] = []
    spans: list[tuple[int, int, float]] = []
    delays: list[Mapping[str, float]] = []
    bands: list[tuple[float, float]] = []
    doubtful: list[FloatArray] = []
    moves: list[FloatArray] = []
    for recording in recordings:
        on_window(recording)
        spans.append((recording.start, recording.end, recording.rate))
        names |= dict.fromkeys(channel.name for channel in recording.channels)
        try:
            found = identify_all(recording, method, band)
            found = found if uncertain else found.without_uncertain()
        except IdentificationError as error:
            problems.append(str(error))
            faults.append(channel_faults(recording))
            continue
        faults.append(found.faults)
        qualities.append(found.quality)
        estimates.append(found.estimate)
        delays.append(found.delays)
        bands.append(found.band)
        moves.append(found.frequency_moves)
        doubtful.append(found.estimate.frequency[found.may_be_tone])
        tones.append(found.harmonics)
    if not spans:
        raise IdentificationError("no window: the recording is too short")
    usual = _usual_faults(faults)
    return Windows(
        estimates=tuple(estimates),
        harmonics=common_tones(tones),
        channels={name: str(usual.get(name, "ok")) for name in names},
        quality=tuple(qualities),
        problems=tuple(problems),
        start=min(start for start, _, _ in spans),
        end=max(end for _, end, _ in spans),
        rate=spans[0][2],
        delays=tuple(delays),
        band=common_band(bands),
        faults=usual,
        may_be_tones=common_tones(doubtful),
        frequency_moves=tuple(moves),
    )


def common_band(bands: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the band that all windows share [Hz]; None without windows."""
    return (max(low for low, _ in bands), min(high for _, high in bands)) if bands else None


def common_tones(tones: Sequence[FloatArray]) -> FloatArray:
    """Return the tones that more than half of the windows show."""
    every = np.sort(np.concatenate([np.unique(t) for t in tones])) if tones else np.empty(0)
    groups = np.split(every, np.flatnonzero(np.diff(np.log(every)) > _SAME_TONE) + 1) if len(every) else []
    return np.array([np.median(group) for group in groups if len(group) > len(tones) / 2])


def are_near(frequency: FloatArray, tones: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which frequencies are those of tones (n_modes,)."""
    return np.asarray(np.any(np.abs(np.log(frequency[:, None] / tones)) < _SAME_TONE, axis=1))


def _usual_faults(windows: Sequence[Mapping[str, ChannelFault]]) -> dict[str, ChannelFault]:
    """Return the most frequent fault of each channel, with the number of windows where it is not in all of them."""
    found = {}
    for channel in dict.fromkeys(name for window in windows for name in window):
        seen = [window[channel] for window in windows if channel in window]
        kind = Counter(fault.kind for fault in seen).most_common(1)[0][0]
        most = Counter(fault for fault in seen if fault.kind == kind).most_common(1)[0][0]
        part = f" (in {len(seen)} of {len(windows)} windows)" if len(seen) < len(windows) else ""
        found[channel] = replace(most, text=most.text + part)
    return found


def choose_tracks(
    estimates: Sequence[ModalEstimate], least_presence: float = LEAST_PRESENCE, *, identified: bool = True
) -> tuple[ModalEstimate, IndexArray, list[IndexArray]]:
    """Find the modes that most windows show.

    Parameters
    ----------
    estimates : of the windows
    least_presence : share of windows that must show a mode [-]
    identified : whether windows may have one mode twice by chance, which goes then; else that is someone's mistake

    Returns
    -------
    seed : the window with the most modes, which names the tracks
    kept : (n_tracks,) modes of the seed that are seen often enough
    tracks : for each window (n_tracks,) indices into its modes, or -1
    """
    seed = max(estimates, key=lambda e: e.n_modes)
    assigned = np.array([Tracker(reference=seed).assign(e) for e in estimates])
    kept = np.flatnonzero((assigned >= 0).mean(0) >= least_presence)
    if identified and len(kept):
        kept = np.delete(kept, doubles(mean_modes(stack_tracks(estimates, list(assigned[:, kept])))))
    return seed, kept, list(assigned[:, kept])


def fuse(estimates: Sequence[ModalEstimate]) -> FusedModes:
    """Average the modes that most windows show.

    Standard deviations are those of the means; from three windows on they are corrected by how much the windows really
    scatter over what they state, but never made smaller.

    Raises
    ------
    IdentificationError
        If no mode is seen in `LEAST_PRESENCE` of the windows.
    """
    if len(estimates) == 1:
        return FusedModes(estimate=estimates[0], n=np.ones(estimates[0].n_modes, np.intp), scatter=None)
    tracks = _all_tracks(estimates) if estimates else [np.empty(0, np.intp)]
    if not len(tracks[0]):
        raise IdentificationError(f"no mode is seen in {LEAST_PRESENCE:.0%} of the {len(estimates)} windows")
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
    everything = max(estimates, key=lambda e: e.n_modes)
    for estimate in estimates:
        if estimate.channels == everything.channels:
            known = Tracker(reference=everything).assign(estimate)
            everything = _joined(everything, estimate, np.setdiff1d(np.arange(estimate.n_modes), known))
    assigned = np.array([Tracker(reference=everything).assign(e) for e in estimates])
    kept = np.flatnonzero((assigned >= 0).mean(0) >= LEAST_PRESENCE)
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

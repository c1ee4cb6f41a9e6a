"""From recordings to a diagnosis: windows, tracks, a reference, and the causes weighed against each other."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray, Recording
from monitor.fusion import Windows, choose_tracks, identify_windows
from oma import IdentificationError, ModalEstimate, aligned, device_delays
from updater import (
    Circumstances,
    Explained,
    ModalMean,
    Reference,
    Structure,
    TrackedModes,
    build_model,
    diagnose,
    estimate_delays,
    learn_delays,
    learn_reference,
    match_modes,
    matched,
    nominal_reference,
    remove_delays,
    stack_tracks,
    tone_ratios,
    trend_of,
)

_PERIODS = 250  # of the structure's first mode in a window: what identification needs
_MOST_WINDOWS = 24
_LEAST_WINDOWS = 3  # from which their own scatter is learnt
_THERMOMETER_STD = 0.5  # K, of the mean of a log


@dataclass(frozen=True, eq=False, kw_only=True)
class Observation:
    """Modes of many windows of one state."""

    windows: Windows
    estimates: tuple[ModalEstimate, ...]
    tracks: tuple[IndexArray, ...]  #: for each window (n_tracks,) indices into its modes, or -1
    temperature: FloatArray  #: (n_windows,) mean over the devices [degC], NaN where none has a sensor
    rms: FloatArray  #: (n_windows,) of the acceleration, over all channels [m/s2]
    sample: Recording | None = None  #: signals of the last window, the devices' delays removed; None: not kept

    @property
    def modes(self) -> TrackedModes:
        """In the order of the tracks."""
        return stack_tracks(self.estimates, self.tracks)


def window_seconds(structure: Structure, shortest: float, n_logs: int = 1) -> float:
    """Return the length [s] of the windows that logs are cut into.

    Parameters
    ----------
    structure : its first mode says how much identification needs
    shortest : duration of the shortest log [s]
    n_logs : how many there are

    Raises
    ------
    ValueError
        If there is too little for three windows.
    """
    first = float(build_model(structure, shear_flexible=True, mass="consistent").modes(1).frequency[0])
    need = _PERIODS / first
    n = min(max(1, _MOST_WINDOWS // n_logs), int(shortest / need))
    if n * n_logs < _LEAST_WINDOWS:
        raise ValueError(
            f"expected at least {_LEAST_WINDOWS * need:.0f} s, three windows of {_PERIODS} periods of the first mode "
            f"at {first:.3g} Hz; found {n_logs * shortest:.0f} s"
        )
    return shortest / n


def observe(recordings: Iterable[Recording], on_window: Callable[[Recording], None] = lambda _: None) -> Observation:
    """Identify the modes of every window and track them.

    Raises
    ------
    IdentificationError
        If fewer than three windows give modes, or no mode is seen in most of them.
    """
    devices: dict[str, str] = {}
    seen: list[tuple[int, float, float]] = []
    last: list[Recording] = []

    def note(recording: Recording) -> None:
        devices.update({channel.name: channel.device for channel in recording.channels})
        seen.append((recording.start, recording.temperature, _rms(recording)))
        last[:] = [recording]
        on_window(recording)

    return follow(identify_windows(recordings, on_window=note), devices, seen, last[-1] if last else None)


def follow(
    windows: Windows,
    devices: dict[str, str],
    seen: Sequence[tuple[int, float, float]],
    sample: Recording | None = None,
) -> Observation:
    """Track the modes of windows, the devices' constant delays taken out; errors as for `observe`.

    Parameters
    ----------
    windows : what identification made of them
    devices : of each channel
    seen : start [ns UTC], temperature [degC] and rms [m/s2] of every window, those that gave no modes included
    sample : signals of the last window, to be kept
    """
    if len(windows.estimates) < _LEAST_WINDOWS:
        why = f": {windows.problems[0]}" if windows.problems else ""
        raise IdentificationError(f"{len(windows.estimates)} windows give modes, at least 3 are needed{why}")
    delays = learn_delays(windows.estimates, devices)
    late = [estimate_delays(e, devices, delays) for e in windows.estimates]
    estimates = [remove_delays(e, devices, tau) for e, tau in zip(windows.estimates, late, strict=True)]
    _, kept, tracks = choose_tracks(estimates)
    if not len(kept):
        raise IdentificationError("no mode is seen in most of the windows")
    temperature, rms = _at_windows(seen, estimates)
    return Observation(
        windows=windows,
        estimates=tuple(estimates),
        tracks=tuple(tracks),
        temperature=temperature,
        rms=rms,
        sample=_in_time(sample, late[-1]) if sample else None,
    )


def _in_time(recording: Recording, late: Mapping[str, float]) -> Recording:
    """Return a recording without the delays [s] that phases of its spectra and then those of its modes show."""
    try:
        coarse = device_delays(recording)
    except IdentificationError:
        return recording  # it gave no modes either
    return aligned(recording, {device: tau + late.get(device, 0.0) for device, tau in coarse.items()})


def _rms(recording: Recording) -> float:
    """Return the root mean square over time and channels, each channel's mean taken off [m/s2]."""
    present = np.isfinite(recording.data)
    count = np.maximum(present.sum(0), 1)
    mean = np.where(present, recording.data, 0.0).sum(0) / count
    square = np.where(present, recording.data - mean, 0.0) ** 2
    return float(np.sqrt(np.mean(square.sum(0) / count)))


def _at_windows(
    seen: Sequence[tuple[int, float, float]], estimates: Sequence[ModalEstimate]
) -> tuple[FloatArray, FloatArray]:
    """Return temperature and rms of the windows that gave modes; alignment may have moved their start a little."""
    start = np.array([at for at, _, _ in seen])
    chosen = [seen[int(np.argmin(np.abs(start - estimate.start)))] for estimate in estimates]
    return np.array([t for _, t, _ in chosen]), np.array([rms for _, _, rms in chosen])


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """A diagnosis with what it rests on."""

    explained: Explained
    reference: Reference  #: of the structure as it was, or of the nominal model
    measured: ModalMean  #: (n_modes,) all modes of the logs that were to be explained


def explain(
    structure: Structure, before: Observation | None, now: Observation, heldout: Observation | None = None
) -> Explanation:
    """Explain what has changed since reference logs; without them, what the structure file gets wrong about logs.

    Raises
    ------
    PairingError, ValueError
        If fewer than three modes can be compared.
    """
    if before:
        reference = learn_reference(structure, before.estimates, before.tracks)
    else:
        reference = nominal_reference(structure, now.modes)
    explained = diagnose(
        reference,
        _event(reference, now),
        heldout=_event(reference, heldout) if heldout else None,
        circumstances=circumstances_of(reference, before, now),
    )
    return Explanation(explained=explained, reference=reference, measured=reference.mean_of(now.modes))


def explain_change(
    structure: Structure, before: Observation, after: Observation, heldout: Observation | None = None
) -> Explained:
    """Explain what has changed since the reference logs; errors as for `explain`."""
    return explain(structure, before, after, heldout).explained


def circumstances_of(reference: Reference, before: Observation | None, now: Observation) -> Circumstances:
    """Return what logs say beside their tracked modes; without logs from before only what they say by themselves."""
    event = reference.mean_of(now.modes)
    channels = tuple(c for c in reference.baseline.channels if c in event.channels)
    found = match_modes(reference.baseline.at(channels), event.at(channels))
    earlier = (reference.windows, before.rms) if before else None
    extra = np.setdiff1d(np.arange(len(event.log_frequency)), found)
    return Circumstances(
        warmer=_mean(now.temperature) - _mean(before.temperature) if before else float("nan"),
        warmer_std=_THERMOMETER_STD * 2**0.5,
        tones=tone_ratios(before.windows.harmonics, now.windows.harmonics) if before else np.empty(0),
        extra=event.only(extra) if len(extra) else None,
        trend=trend_of(now.modes.tracks(found), now.rms, earlier),
    )


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _event(reference: Reference, observation: Observation) -> ModalMean:
    return matched(reference.baseline, reference.mean_of(observation.modes))

"""Observation of a structure: windows of recordings with their tracked modes."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from types import MappingProxyType

import numpy as np

from daq import FloatArray, IndexArray, Recording
from monitor.analysis.event import Conditions
from monitor.errors import RecordLengthError
from oma import ChannelFault, IdentificationError, ModalEstimate, aligned
from oma.windows import Windows, identify_windows
from updater import (
    Structure,
    TrackedModes,
    build_model,
    stack_tracks,
)
from updater.modal_data import NOTHING_REMOVED, SynchronizedWindows, choose_tracks, remove_device_delays, without_known

_PERIODS = 250  # periods of the structure's first mode in a window, required for identification
_FEWEST_PERIODS = 100  # in a window in which identification seeks the first mode at all
_SUFFICIENT_PERIODS = 200  # of a measured mode below the model's first one, from which windows are not lengthened
_PILOT_PERIODS = 1000  # of the structure's first mode in a window that seeks lower ones, down to a tenth of it
_MAX_WINDOWS = 24
_MIN_WINDOWS = 3  # from which their own scatter is learned
_IN_TIME: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, eq=False, kw_only=True)
class Observation:
    """Modes of many windows of one state."""

    windows: Windows
    estimates: tuple[ModalEstimate, ...]
    tracks: tuple[IndexArray, ...]  #: per window (n_tracks,) indices into its modes, or -1
    temperature: FloatArray  #: (n_windows,) mean over the devices [degC], NaN where none has a sensor
    rms: FloatArray  #: (n_windows,) of the acceleration, over all channels [m/s2]
    lateness: SynchronizedWindows = NOTHING_REMOVED  #: delays of the devices, removed from the estimates
    shaped: bool = True  #: whether shapes were measured; else only frequencies count
    stated: bool = False  #: whether deviations are used as stated: too few windows to learn their scatter
    sample: Recording | None = None  #: signals of the last window, the devices' delays removed; None: not kept

    @property
    def modes(self) -> TrackedModes:
        """In the order of the tracks."""
        return stack_tracks(self.estimates, self.tracks)

    @property
    def lowest_frequency(self) -> float:
        """Lowest frequency of a mode, as the mean over the windows [Hz]; infinite without modes."""
        if not self.estimates:
            return math.inf
        return float(np.exp(np.nanmean(self.modes.log_frequency, axis=0).min(initial=np.inf)))

    @property
    def conditions(self) -> Conditions:
        """In the windows that gave modes."""
        return Conditions(
            temperature=self.temperature, rms=self.rms, tones=self.windows.harmonics, left_out=given_up(self)
        )

    def chosen(self, windows: IndexArray) -> "Observation":
        """Return some of the windows that gave modes, ascending; signals only if their window is one of them."""
        with_signals = len(windows) > 0 and windows[-1] == len(self.estimates) - 1
        return replace(
            self,
            sample=self.sample if with_signals else None,
            estimates=tuple(self.estimates[w] for w in windows),
            tracks=tuple(self.tracks[w] for w in windows),
            temperature=self.temperature[windows],
            rms=self.rms[windows],
        )


def window_seconds(
    structure: Structure,
    shortest: float,
    n_logs: int = 1,
    record: float = math.inf,
    lowest_measured: float = math.inf,
) -> float:
    """Return the length [s] of the windows that logs are cut into.

    Parameters
    ----------
    structure : its first mode determines the required length
    shortest : duration of the shortest log [s]
    n_logs : how many there are
    record : length of a record of a logger that pauses, in which a window lies if it can [s]
    lowest_measured : frequency of the lowest measured mode [Hz]; where it is far below the structure's first mode, the
        windows are as long as it requires, as far as three of them exist

    Raises
    ------
    RecordLengthError
        If there is too little for three windows.
    """
    first = _first_frequency(structure)
    need = _PERIODS / first
    n = min(max(1, _MAX_WINDOWS // n_logs), int(shortest / need))
    if n * n_logs < _MIN_WINDOWS:
        less = int(shortest / -(-_MIN_WINDOWS // n_logs))
        way_out = (
            f"; --window {less} allows shorter ones, with larger standard deviations"
            if less * first > _FEWEST_PERIODS
            else ""
        )
        raise RecordLengthError(
            f"expected at least {_MIN_WINDOWS * need:.0f} s, three windows of {_PERIODS} periods of the first mode "
            f"at {first:.3g} Hz; found {n_logs * shortest:.0f} s{way_out}"
        )
    if shortest / n * lowest_measured < _SUFFICIENT_PERIODS:
        need = _PERIODS / lowest_measured
        n = min(n, max(int(shortest / need), -(-_MIN_WINDOWS // n_logs)))
    seconds = shortest / n
    parts = min(math.ceil(record / seconds), int(record / need)) if math.isfinite(record) else 0
    return record / parts if parts else seconds


def pilot_seconds(structure: Structure, shortest: float, n_logs: int = 1, record: float = math.inf) -> float:
    """Return the length [s] of windows that show modes far below the structure's first one; others as above."""
    return min(shortest / -(-_MIN_WINDOWS // n_logs), record, _PILOT_PERIODS / _first_frequency(structure))


def lowest_frequency(recordings: Iterable[Recording]) -> float:
    """Return the lowest frequency [Hz] of a mode that most of the first three windows have; infinite without one."""
    try:
        return observe(islice(recordings, _MIN_WINDOWS)).lowest_frequency
    except IdentificationError:
        return math.inf


def _first_frequency(structure: Structure) -> float:
    """Return the frequency of the first mode [Hz]."""
    return float(build_model(structure, shear_flexible=True, mass="consistent").modes(1).frequency[0])


def observe(
    recordings: Iterable[Recording],
    on_window: Callable[[Recording], None] = lambda _: None,
    late: Mapping[str, float] = _IN_TIME,
) -> Observation:
    """Identify the modes of every window and track them.

    Parameters
    ----------
    recordings : windows
    on_window : called before each window is analysed
    late : channel -> delay that is known of it, which is taken out [s]

    Raises
    ------
    IdentificationError
        If fewer than three windows give modes, or no mode is identified in most of them.
    """
    devices: dict[str, str] = {}
    seen: list[tuple[int, float, float]] = []
    last: list[Recording] = []

    def note(recording: Recording) -> None:
        devices.update({channel.name: channel.device for channel in recording.channels})
        seen.append((recording.start, recording.temperature, root_mean_square(recording)))
        last[:] = [recording]
        on_window(recording)

    windows = identify_windows(recordings, on_window=note)
    return follow(windows, devices, seen, last[-1] if last else None, late)


def follow(
    windows: Windows,
    devices: dict[str, str],
    seen: Sequence[tuple[int, float, float]],
    sample: Recording | None = None,
    late: Mapping[str, float] = _IN_TIME,
) -> Observation:
    """Track the modes of windows, the devices' constant delays taken out; errors as for `observe`.

    Parameters
    ----------
    windows : identified
    devices : of each channel
    seen : start [ns UTC], temperature [degC] and rms [m/s2] of every window, those that gave no modes included
    sample : signals of the last window, to be kept
    late : channel -> delay that is known of it, which is taken out [s]
    """
    if len(windows.estimates) < _MIN_WINDOWS:
        why = f": {windows.problems[0]}" if windows.problems else ""
        raise IdentificationError(f"{len(windows.estimates)} windows give modes, at least 3 are needed{why}")
    removed = windows.delays or ({},) * len(windows.estimates)
    known = [without_known(e, r, devices, late) for e, r in zip(windows.estimates, removed, strict=True)]
    lateness = remove_device_delays([e for e, _ in known], [r for _, r in known], devices)
    estimates = lateness.estimates
    _, kept, tracks = choose_tracks(estimates)
    if not len(kept):
        raise IdentificationError("no mode is identified in most of the windows")
    start = np.array([at for at, _, _ in seen])
    chosen = [seen[int(np.argmin(np.abs(start - estimate.start)))] for estimate in estimates]
    temperature, rms = np.array([t for _, t, _ in chosen]), np.array([rms for _, _, rms in chosen])
    return Observation(
        windows=windows,
        estimates=estimates,
        tracks=tuple(tracks),
        temperature=temperature,
        rms=rms,
        lateness=lateness,
        sample=without_delays(sample, lateness.removed[-1], late) if sample else None,
    )


def without_delays(recording: Recording, removed: Mapping[str, float], late: Mapping[str, float]) -> Recording:
    """Return a recording without the delays [s] that its modes show by device, and those known by channel."""
    own = [replace(c, device=c.name) for c in recording.channels]
    tau = {c.name: removed.get(c.device, 0.0) + late.get(c.name, 0.0) for c in recording.channels}
    return replace(aligned(replace(recording, channels=tuple(own)), tau), channels=recording.channels)


def root_mean_square(recording: Recording) -> float:
    """Return the root mean square over time and channels, each channel's mean taken off [m/s2]."""
    power = np.empty(len(recording.channels))
    for k, signal in enumerate(recording.data.T):
        there = np.isfinite(signal)
        n = max(np.count_nonzero(there), 1)
        known = signal if n == len(signal) else np.where(there, signal, 0.0)
        deviation = known - known.sum() / n
        power[k] = np.square(deviation, where=there, out=np.zeros(len(signal))).sum() / n
    return float(np.sqrt(np.mean(power)))


def given_up(observation: Observation) -> dict[str, ChannelFault]:
    """Return the faults of the channels that no window gave shapes of."""
    there = {c for e in observation.estimates for c in e.channels}
    return {c: fault for c, fault in observation.windows.faults.items() if c not in there}

"""Identified windows: one that needs no state of the watch, and its part that is saved for a restart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, Recording
from monitor.analysis.observation import root_mean_square, without_delays
from monitor.results.convert import spectrum_result, with_poles
from monitor.results.windows import Spectrum
from oma import ChannelFault, IdentificationError, ModalEstimate
from oma.identification import identify_cleaned
from oma.preparation import cleaned, enough
from updater import estimate_delays, remove_delays
from updater.modal_data import DeviceDelays, SynchronizedWindows, without_known


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedWindow:
    """Conditions of a window, without its signals."""

    start: int  #: [ns UTC]
    end: int  #: [ns UTC]
    channels: tuple[str, ...]
    temperature: float  #: mean over the devices [degC], NaN if none has a sensor
    rms: Mapping[str, float]  #: of the acceleration of each channel [m/s2]
    whole_rms: float  #: over all channels [m/s2]

    @classmethod
    def of(cls, recording: Recording) -> "RecordedWindow":
        """Return the conditions of a recording."""
        return cls(
            start=recording.start,
            end=recording.end,
            channels=tuple(channel.name for channel in recording.channels),
            temperature=float(recording.temperature),
            rms={c.name: _rms(signal) for c, signal in zip(recording.channels, recording.data.T, strict=True)},
            whole_rms=root_mean_square(recording),
        )


def _rms(signal: FloatArray) -> float:
    """Return the root mean square of the samples that are there; 0 if none is."""
    there = np.isfinite(signal)
    n = np.count_nonzero(there)
    power = np.square(signal if n == len(signal) else np.where(there, signal, 0.0)).sum() / max(n, 1)
    return float(np.sqrt(power))


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModes:
    """Modes of a window as identified, with nothing of the watch's state."""

    estimate: ModalEstimate  #: without modes that may be tones or aliases
    delays: Mapping[str, float]  #: device -> removed before identification [s]
    harmonics: FloatArray  #: (n_harmonics,) tones [Hz]
    left_out: Mapping[str, ChannelFault]  #: channels that are not in the estimate


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedWindow:
    """A window with its modes: a function of its signals and of the band alone, which any process can compute."""

    recorded: RecordedWindow
    modes: IdentifiedModes | None  #: None if the window gives none
    problem: str = ""  #: reason why it gives none
    spectrum: Spectrum | None = None
    signals: Recording | None = None  #: None of a window that was identified elsewhere


def identify_window(recording: Recording, band: tuple[float, float] | None) -> IdentifiedWindow:
    """Identify the modes of a recording in a band [Hz]; by default in that of `oma.identify`."""
    recorded = RecordedWindow.of(recording)
    clean = cleaned(recording)
    try:
        spectrum = spectrum_result(enough(clean))
        found = identify_cleaned(recording, clean, band=band).without_uncertain()
    except IdentificationError as error:
        return IdentifiedWindow(recorded=recorded, modes=None, problem=str(error))
    modes = IdentifiedModes(
        estimate=found.estimate, delays=found.delays, harmonics=found.harmonics, left_out=found.left_out
    )
    spectrum = spectrum and with_poles(spectrum, found.poles)
    return IdentifiedWindow(recorded=recorded, modes=modes, spectrum=spectrum, signals=recording)


@dataclass(frozen=True, eq=False, kw_only=True)
class Window:
    """One window's modes and circumstances; its signals are in the log only."""

    index: int  #: counted from 0, over restarts
    start: int  #: [ns UTC]
    end: int  #: [ns UTC]
    temperature: float  #: mean over the devices [degC], NaN if none has a sensor
    rms: float  #: rms of the acceleration, over all channels [m/s2]
    harmonics: FloatArray  #: (n_harmonics,) tones [Hz]
    left_out: Mapping[str, ChannelFault]  #: channels that are not in the estimate
    estimate: ModalEstimate  #: modes as identified, with known delays of channels removed
    delays: Mapping[str, float]  #: device -> taken out of `estimate` [s]
    synchronized: ModalEstimate  #: the same with known delays of the devices removed
    removed: Mapping[str, float]  #: device -> total delay removed [s]


def window_of(
    index: int,
    recorded: RecordedWindow,
    found: IdentifiedModes,
    temperature: float,
    devices: Mapping[str, str],
    late: Mapping[str, float],
    known: DeviceDelays,
) -> Window:
    """Return the part of a window that is kept.

    Parameters
    ----------
    index : its number
    recorded, found : its conditions and modes
    temperature : by which it is judged [degC]
    devices : of each channel
    late : channel -> known delay, of the structure file [s]
    known : delays of the devices that the baseline has shown
    """
    estimate, seen = without_known(found.estimate, found.delays, devices, late)
    tau = estimate_delays(estimate, devices, known.beyond(seen))
    return Window(
        index=index,
        start=recorded.start,
        end=recorded.end,
        temperature=temperature,
        rms=recorded.whole_rms,
        harmonics=found.harmonics,
        left_out=found.left_out,
        estimate=estimate,
        delays=dict(seen),
        synchronized=remove_delays(estimate, devices, tau),
        removed={device: seen[device] + t for device, t in tau.items()},
    )


def signals_of(window: Window, recording: Recording, late: Mapping[str, float]) -> Recording:
    """Return the signals of a window in the channels of its estimate, without the delays of devices.

    Parameters
    ----------
    window : with the delays that were removed from its modes
    recording : its signals
    late : channel -> known delay, of the structure file [s]
    """
    kept = [k for k, channel in enumerate(recording.channels) if channel.name in window.estimate.channels]
    channels = tuple(recording.channels[k] for k in kept)
    return without_delays(replace(recording, channels=channels, data=recording.data[:, kept]), window.removed, late)


def synchronized_windows(windows: Sequence[Window], devices: Mapping[str, str]) -> SynchronizedWindows:
    """Return windows with the delays of their devices (of each channel)."""
    return SynchronizedWindows(tuple(w.synchronized for w in windows), devices, tuple(w.removed for w in windows))

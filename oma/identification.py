"""The front of identification: a recording or a stream in, modes out, nothing to choose."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from daq import FloatArray, Recording
from oma.errors import InputError, NumericalFault, TooFewModes, TooShort
from oma.methods import EFDD, FDD, FSDD, PLSCF, CovarianceSSI, DataSSI, LevelModes, Method
from oma.preparation import (
    ALIAS_FREE,
    PASS,
    TOP,
    BlockQuality,
    BoolArray,
    ChannelFault,
    Cleaned,
    Decimator,
    HighPass,
    WindowQuality,
    cleaned,
    enough,
    levels,
    usable_share,
    window_quality,
)
from oma.selection import Mode, distinct, join, physical, repeats_of_tones
from oma.spectral import LineClasses, aligned, classify, delays_of_clean, drawn_spectrum, plot_spectrum
from oma.types import ModalEstimate, Stabilization

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS: Mapping[str, Callable[[], Method]] = MappingProxyType(
    {m.name: m for m in (DataSSI, CovarianceSSI, PLSCF, FDD, EFDD, FSDD)}
)
"""Every way of identification, by its name on the command line."""

_DRIFT = 0.1  # corner of the filter against drift, as a share of the lower end of the band


@dataclass(frozen=True, eq=False, kw_only=True)
class Identification:
    """Modes, and the poles from which they were selected."""

    estimate: ModalEstimate  #: estimate, with the devices' `delays` removed
    poles: Stabilization
    harmonics: FloatArray  #: (n_harmonics,) frequencies of tones: machines, mains; no modes [Hz]
    may_be_tone: BoolArray  #: (n_modes,) modes that may also be tones: the record is too short to distinguish them
    frequency_moves: FloatArray  #: (n_modes, n_blocks) influence of each block of time on each frequency [Hz]
    quality: WindowQuality
    band: tuple[float, float]  #: frequencies in which modes were sought [Hz]
    recorded: tuple[str, ...]
    """Names of all channels; those that were left out are not in the estimate."""
    faults: Mapping[str, ChannelFault] = field(default_factory=dict)
    """Faults of channels that were left out or repaired (`channel_faults`)."""
    alias_from: float = np.inf  #: frequency above which modes may be aliases; infinite where the band was chosen [Hz]
    delays: Mapping[str, float] = field(default_factory=dict)
    """Device -> how late it was, 0 if that does not matter (`device_delays`) [s]."""

    def __repr__(self) -> str:
        return f"Identification({self.estimate!r}, {len(self.poles)} poles, {len(self.harmonics)} tones)"

    def _repr_html_(self) -> str:
        """Return a table of the modes, for notebooks."""
        return self.estimate._repr_html_()

    @property
    def channels(self) -> dict[str, str]:
        """Channel -> "ok", or a description of its fault."""
        return {name: str(self.faults.get(name, "ok")) for name in self.recorded}

    @property
    def left_out(self) -> dict[str, ChannelFault]:
        """Faults of the channels that are not in the estimate."""
        return {name: fault for name, fault in self.faults.items() if name not in self.estimate.channels}

    def without_uncertain(self) -> "Identification":
        """Return the identification without modes that may be tones or aliases.

        Raises
        ------
        TooFewModes
            If no other is left.
        """
        sure = ~self.may_be_tone & (self.estimate.frequency <= self.alias_from)
        if not sure.any():
            raise TooFewModes(len(self.poles))
        return replace(
            self,
            estimate=self.estimate[sure],
            may_be_tone=self.may_be_tone[sure],
            frequency_moves=self.frequency_moves[sure],
        )

    def plot_stabilization(self, recording: Recording | None = None, estimate: ModalEstimate | None = None) -> "Figure":
        """Draw poles over frequency by model order, and their damping; modes and tones are marked.

        Parameters
        ----------
        recording : its spectrum is drawn behind the poles. Default: no spectrum
        estimate : modes to mark, as the mean of many windows. Default: those of this identification
        """
        from oma.plots import stabilization_figure  # matplotlib is loaded only for a figure

        spectrum = None if recording is None else drawn_spectrum(recording)
        return stabilization_figure(self.poles, estimate or self.estimate, self.harmonics, spectrum)

    def plot_spectrum(self, recording: Recording) -> "Figure":
        """Draw the singular values of the spectral matrix of the recording; modes and tones are marked."""
        return plot_spectrum(recording, self.estimate, self.harmonics)


def identify(
    recording: Recording, method: Method | None = None, band: tuple[float, float] | None = None
) -> ModalEstimate:
    """Identify the modes of a structure from its ambient vibration.

    Parameters
    ----------
    recording : Recording
    method : Method, optional
        `DataSSI`, `CovarianceSSI`, ... with their options. Default: DataSSI().
    band : (float, float), optional
        Frequencies in which modes are sought [Hz], up to 0.48 of the rate. Default: from 100 periods in the recording
        to 0.48 of the rate, or to 0.40 where the spectrum shows an anti-alias filter (`oma.preparation.pyramid`).

    Returns
    -------
    ModalEstimate
        Of the channels that carry a signal (`channel_faults` names the others), without their devices' delays
        (`device_delays`). Where gaps leave too little for the lowest frequencies, these are passed over. It has its
        poles. `identify_all` also returns tones, faults of channels and the quality of the record.

    Raises
    ------
    TooFewChannels, TooShort, TooFewModes
        If the recording does not allow an estimate; all are `IdentificationError`.
    InputError
        If the band is empty or begins above 0.48 of the rate.
    """
    found = identify_all(recording, method, band)
    return replace(found.estimate, poles=found.poles)


def identify_all(
    recording: Recording, method: Method | None = None, band: tuple[float, float] | None = None
) -> Identification:
    """Identify modes, and keep poles, tones [Hz], faults of channels and the quality of the record.

    Parameters and errors are those of `identify`.
    """
    _band(recording, method or DataSSI(), band)  # before the work
    return identify_cleaned(recording, cleaned(recording), method, band)


def identify_cleaned(
    recording: Recording,
    clean: Cleaned,
    method: Method | None = None,
    band: tuple[float, float] | None = None,
    *,
    overwrite: bool = False,
) -> Identification:
    """Identify modes in a recording that is cleaned already; else as `identify_all`.

    Parameters
    ----------
    recording, clean : Recording, Cleaned
        As measured, and the same cleaned.
    method, band : as for `identify`
    overwrite : bool
        Write into the data of the recording, instead of a copy.
    """
    try:
        return _identify_all(recording, clean, method or DataSSI(), band, overwrite=overwrite)
    except np.linalg.LinAlgError as error:  # a ValueError, but no wrong argument
        raise NumericalFault(str(error)) from error


def _identify_all(
    recording: Recording, clean: Cleaned, method: Method, chosen: tuple[float, float] | None, *, overwrite: bool
) -> Identification:
    low, high = _band(recording, method, chosen)
    recorded = tuple(channel.name for channel in recording.channels)
    delays = dict.fromkeys(sorted({channel.device for channel in recording.channels}), 0.0)
    measured = recording.data
    recording, faults = enough(clean), clean.faults
    del clean  # its samples are held once
    if chosen is None:
        high = usable_share(recording.data) * recording.rate
    delays |= delays_of_clean(recording)
    if any(delays.values()):
        recording = aligned(recording, delays, in_place=overwrite or recording.data is not measured)
    names = [channel.name for channel in recording.channels]
    stream = IdentificationStream(names, recording.rate, (low, high), method, start=recording.start)
    for block in np.array_split(recording.data, method.n_blocks):
        stream.add(block)
    found = stream.identify(recording.data)
    alias_from = ALIAS_FREE * recording.rate if chosen is None else np.inf
    return replace(found, delays=delays, recorded=recorded, faults=faults, alias_from=alias_from)


class IdentificationStream:
    """Identification of a stream in bounded memory: blocks of time are added at one end and dropped at the other.

    A rolling window is one block added, one dropped, and `identify`.

    Parameters
    ----------
    channels : sequence of str
        Names of the channels; all must carry a signal.
    rate : float
        [Hz].
    band : (float, float)
        Frequencies in which modes are sought [Hz].
    method : Method, optional
        Default: DataSSI(). The standard deviations come from the scatter of the blocks: use about thirty.
    start : int
        Time of the first sample [ns UTC].

    Raises
    ------
    TooFewChannels
        If none of the references that the method names is among the channels.
    """

    def __init__(
        self,
        channels: Sequence[str],
        rate: float,
        band: tuple[float, float],
        method: Method | None = None,
        start: int = 0,
    ) -> None:
        self._channels, self._rate, self._start = tuple(channels), rate, start
        self._band = (band[0], min(band[1], TOP * rate))
        self._method = method or DataSSI()
        spans = levels(rate, band, self._method.decimation)
        self._drift = HighPass(_DRIFT * band[0] / rate)
        self._decimators = [Decimator(self._method.decimation) for _ in spans[1:]]
        self._levels = [level and self._method.start(self._channels, level) for level in spans]
        self._blocks: list[BlockQuality] = []

    def add(self, data: FloatArray) -> None:
        """Add the block of time that follows, (n_samples, n_channels), NaN where a sample is missing."""
        data = self._drift.add(data)
        self._blocks.append(BlockQuality.of(data))
        for k, level in enumerate(self._levels):
            if k:
                data = self._decimators[k - 1].add(data)
            if level:
                level.add(data)

    def drop(self, n_blocks: int = 1) -> None:
        """Remove the oldest blocks."""
        self._start += round(sum(block.length for block in self._blocks[:n_blocks]) / self._rate * 1e9)
        del self._blocks[:n_blocks]
        for level in self._levels:
            if level:
                level.drop(n_blocks)

    def identify(self, data: FloatArray | None = None) -> Identification:
        """Return the modes in the blocks held.

        Parameters
        ----------
        data : (n_samples, n_channels) array, optional
            Signals of these blocks, which distinguish tones from modes (`oma.spectral.harmonics`). Without them, the
            damping does.

        Raises
        ------
        TooShort, TooFewModes
            If they do not allow an estimate.
        """
        found = [f for level in self._levels if level and (f := level.identify())]
        if not found:
            needed = self._method.least_samples(len(self._channels))
            raise TooShort(self._duration, needed / self._rate)
        poles, modes = join([level.poles for level in found]), self._chosen(found)
        if not modes:
            raise TooFewModes(len(poles))
        both = self._estimate(modes)
        lines = self._lines(both, data)
        # one channel has no shapes, but the damping of noise poles scatters
        certain = both.damping > self._method.selection.min_damping_sigmas * both.damping_std
        is_mode = ~lines.tone & (certain | (len(self._channels) > 1))
        if not is_mode.any():
            raise TooFewModes(len(poles))
        estimate = both[is_mode]
        return Identification(
            estimate=estimate,
            poles=poles,
            harmonics=np.sort(lines.frequency[lines.tone]),
            may_be_tone=lines.uncertain[is_mode],
            frequency_moves=np.array([mode.frequency_moves for mode in modes])[is_mode],
            quality=window_quality(self._blocks, self._rate, float(estimate.frequency[0])),
            band=self._band,
            recorded=self._channels,
        )

    @property
    def _duration(self) -> float:
        """Length of the blocks held [s]."""
        return sum(block.length for block in self._blocks) / self._rate

    def _chosen(self, found: Sequence[LevelModes]) -> list[Mode]:
        """Return modes and tones."""
        limits = self._method.selection
        return distinct(physical([mode for level in found for mode in level.modes], limits), limits)

    def _lines(self, both: ModalEstimate, data: FloatArray | None) -> LineClasses:
        """Return which are tones."""
        limits = self._method.selection
        undamped: BoolArray = both.damping < limits.min_damping
        undamped = undamped | repeats_of_tones(both, undamped, limits)
        if data is None:
            return LineClasses(tone=undamped, uncertain=np.zeros_like(undamped), frequency=both.frequency)
        return classify(data, self._rate, both, undamped, limits)

    def _estimate(self, modes: Sequence[Mode]) -> ModalEstimate:
        """Put modes into arrays."""
        return ModalEstimate(
            channels=self._channels,
            frequency=np.array([m.frequency for m in modes]),
            frequency_std=np.array([m.frequency_std for m in modes]),
            damping=np.array([m.damping for m in modes]),
            damping_std=np.array([m.damping_std for m in modes]),
            shape=np.stack([m.shape for m in modes]),
            shape_std=np.stack([m.shape_std for m in modes]),
            support=np.array([m.support for m in modes]),
            law_ratio=np.array([m.law_ratio for m in modes]),
            start=self._start,
            end=self._start + round(self._duration * 1e9),
        )


def least_frequency(duration: float, method: Method | None = None) -> float:
    """Return the frequency from which modes are sought in a recording of some length [s] by default [Hz]."""
    return (method or DataSSI()).min_cycles / duration


def shortest_duration(rate: float, method: Method | None = None) -> float:
    """Return the length below which a recording at a rate [Hz] has no band for identification [s]."""
    method = method or DataSSI()
    return method.min_cycles * method.decimation / PASS / rate


def _band(recording: Recording, method: Method, band: tuple[float, float] | None) -> tuple[float, float]:
    """Return the band to search, checked; by default up to `TOP` of the rate."""
    rate, duration = recording.rate, recording.duration
    if duration == 0:
        raise TooShort(0, shortest_duration(rate, method))
    if band is None:
        low = least_frequency(duration, method)
        if low >= PASS * rate / method.decimation:
            raise TooShort(duration, shortest_duration(rate, method))
        return low, TOP * rate
    if not 0 < band[0] < band[1] <= 0.5 * rate:
        raise InputError(f"band: expected 0 < low < high <= {0.5 * rate} Hz, found {band}")
    if band[0] >= TOP * rate:
        raise InputError(f"band: expected low < {TOP * rate:g} Hz ({TOP:g} of the rate), found {band[0]:g} Hz")
    return band

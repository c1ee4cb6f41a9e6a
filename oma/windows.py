"""Windows of recordings, identified one by one."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from daq import FloatArray, Recording
from daq.notebook import notebook_extra
from oma.errors import IdentificationError
from oma.identification import identify_cleaned
from oma.methods import Method
from oma.preparation import ChannelFault, WindowQuality, cleaned
from oma.tracking import plot_tracks
from oma.types import ModalEstimate

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

_SAME_TONE = 2e-3  # relative difference of frequencies up to which tones are the same one


@dataclass(frozen=True, eq=False, kw_only=True)
class Windows:
    """Identified windows of a recording."""

    estimates: tuple[ModalEstimate, ...]  #: estimates of the windows with modes
    harmonics: FloatArray  #: (n_harmonics,) tones seen in most of these windows [Hz]
    channels: dict[str, str]  #: "ok", or the fault and the number of windows with it
    quality: tuple[WindowQuality, ...]  #: quality of the windows with modes
    problems: tuple[str, ...]  #: problems of the windows without modes
    start: int  #: start of the earliest window [ns UTC]
    end: int  #: end of the latest one [ns UTC]
    rate: float  #: samples per second [Hz]
    delays: tuple[Mapping[str, float], ...] = ()  #: delays removed from each device, per window with modes [s]
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

    def to_dataframe(self, *, shapes: bool = False) -> "pandas.DataFrame":
        """Return one row per window and mode, by the window's start (UTC) and the mode's number in the window.

        Parameters
        ----------
        shapes : as for `ModalEstimate.to_dataframe`

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        with notebook_extra():
            import pandas
        start = pandas.to_datetime([estimate.start for estimate in self.estimates], unit="ns", utc=True)
        tables = [estimate.to_dataframe(shapes=shapes) for estimate in self.estimates]
        return pandas.concat(tables, keys=start, names=["start"]) if tables else pandas.DataFrame()

    def plot_tracks(self) -> "Figure":
        """Draw the frequencies of all windows over time; errors as for `oma.plot_tracks`."""
        return plot_tracks(self.estimates)


def identify_windows(
    recordings: Iterable[Recording],
    method: Method | None = None,
    band: tuple[float, float] | None = None,
    on_window: Callable[[Recording], None] = lambda _: None,
    *,
    uncertain: bool = False,
    overwrite: bool = False,
) -> Windows:
    """Identify the modes of each window.

    Parameters
    ----------
    recordings : windows
    method, band : as for `oma.identify`
    on_window : called before each window is analysed
    uncertain : keep modes that may be tones (`oma.Identification.may_be_tone`)
    overwrite : write into the data of windows that are not read-only, instead of a copy

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
        own = overwrite and recording.data.flags.writeable
        clean = cleaned(recording, overwrite=own)
        try:
            found = identify_cleaned(recording, clean, method, band, overwrite=own)
            found = found if uncertain else found.without_uncertain()
        except IdentificationError as error:
            problems.append(str(error))
            faults.append(clean.faults)
            del recording, clean
            continue
        faults.append(found.faults)
        qualities.append(found.quality)
        estimates.append(found.estimate)
        delays.append(found.delays)
        bands.append(found.band)
        moves.append(found.frequency_moves)
        doubtful.append(found.estimate.frequency[found.may_be_tone])
        tones.append(found.harmonics)
        del recording, clean  # while the next one is made
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

"""From a recording to clean channels."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from daq import FloatArray, Recording
from oma.errors import TooFewChannels
from oma.preparation.faults import (
    MAX_SPIKES,
    ChannelFault,
    FaultKind,
    signal_faults,
    value_limits,
    without_clipped,
    without_spikes,
)
from oma.preparation.gaps import filled

_MENTIONED = 0.01  # share of samples missing in a channel above which it is reported

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class Cleaned:
    """Recording prepared for analysis, and its faults."""

    recording: Recording  #: recording of the channels kept, without spikes, with short gaps filled
    faults: Mapping[str, ChannelFault]  #: faults of the channels left out, and of those repaired


def cleaned(recording: Recording, min_complete: float = 0.5, *, overwrite: bool = False) -> Cleaned:
    """Leave out channels without a signal of the structure, repair the others, and report the faults.

    Only samples that all channels have are analysed, so that the channels with most gaps are left out until enough
    of the recording is complete. Gaps of a few samples are filled before (`oma.preparation.gaps`);
    spikes and a few clipped samples count as such gaps.

    Parameters
    ----------
    recording : Recording
    min_complete : float
        Smallest share of samples that the channels kept have in common [-].
    overwrite : bool
        Write into the data of the recording, instead of a copy.

    Returns
    -------
    Cleaned
        With no channels if none is left.
    """
    names = [channel.name for channel in recording.channels]
    is_complete = bool(np.isfinite(recording.data).all())
    data = recording.data
    if not is_complete:
        data = data if overwrite else data.copy()
        data[~np.isfinite(data)] = np.nan
    limits = value_limits(data)
    faults = {names[column]: fault for column, fault in signal_faults(data, names, limits)}
    given_up = set(faults)
    data, clipped = without_clipped(data, limits, in_place=overwrite or data is not recording.data)
    for name, share in zip(names, clipped.tolist(), strict=True):
        if share:
            text = f"clipped: {share:.1%} of the samples are at a limit, and replaced"
            faults.setdefault(name, ChannelFault(kind="clipped", text=text))
    data, taken = without_spikes(data, in_place=overwrite or data is not recording.data)
    for name, share in zip(names, taken.tolist(), strict=True):
        if share:
            text = f"spikes: {share:.2%} of the samples are taken out"
            faults.setdefault(name, ChannelFault(kind="spikes", text=text))
        if share > MAX_SPIKES:
            given_up.add(name)
    kept = [i for i, name in enumerate(names) if name not in given_up]
    is_complete &= not (clipped.any() or taken.any())
    lost = np.zeros(len(names)) if is_complete else np.isnan(data).mean(axis=0)
    if not is_complete:
        in_place = overwrite or data is not recording.data
        if len(kept) == len(names):
            data = filled(data, in_place=in_place)
        else:
            data = data if in_place else data.copy()
            data[:, kept] = filled(data[:, kept], in_place=True)
    for i, fault in () if is_complete else _incomplete(data, kept, min_complete):
        kept.remove(i)
        faults[names[i]] = fault
    for i in kept:
        if lost[i] > _MENTIONED:
            left = np.isnan(data[:, i]).mean()
            text = f"gaps: {lost[i]:.1%} of the samples were missing, {lost[i] - left:.1%} are filled"
            faults.setdefault(names[i], ChannelFault(kind="gaps", text=text))
    channels = tuple(recording.channels[i] for i in kept)
    return Cleaned(
        recording=replace(recording, channels=channels, data=_columns(data, kept, overwrite=overwrite)),
        faults={name: faults[name] for name in names if name in faults},
    )


def _columns(data: FloatArray, kept: Sequence[int], *, overwrite: bool) -> FloatArray:
    """Return some columns, in ascending order; to overwrite, they are moved to the front."""
    if len(kept) == data.shape[1]:
        return data
    if not overwrite:
        return data[:, kept]
    for place, column in enumerate(kept):
        data[:, place] = data[:, column]
    return data[:, : len(kept)]


def _incomplete(data: FloatArray, columns: Sequence[int], min_complete: float) -> Iterator[tuple[int, ChannelFault]]:
    """Yield the columns that have to go until enough rows are complete."""
    valid, kept = np.isfinite(data), list(columns)
    while kept and np.count_nonzero(valid[:, kept].all(axis=1)) < min_complete * len(valid):
        share = valid[:, kept].mean(axis=0)
        text = f"{share.min():.0%} of the samples are there"
        kind: FaultKind = "gaps" if share.min() > 0 else "no_signal"
        yield kept.pop(int(np.argmin(share))), ChannelFault(kind=kind, text=text)


def channel_faults(recording: Recording) -> dict[str, ChannelFault]:
    """Return the faults of channels that are left out, and of channels that are repaired.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    dict
        Channel name to fault.
    """
    return dict(cleaned(recording).faults)


def usable(recording: Recording) -> Recording:
    """Return the repaired recording without the channels that have no signal.

    Raises
    ------
    TooFewChannels
        If fewer than two channels are left of several, or none of one.
    """
    return enough(cleaned(recording))


def enough(clean: Cleaned) -> Recording:
    """Return a cleaned recording if it has enough channels: two, or one if no more was measured.

    Raises
    ------
    TooFewChannels
        If fewer are left.
    """
    names = tuple(channel.name for channel in clean.recording.channels)
    needed = 1 if len({*names, *clean.faults}) == 1 else 2
    if len(names) < needed:
        raise TooFewChannels(names, needed, {name: str(fault) for name, fault in clean.faults.items()})
    return clean.recording


def detrended(data: FloatArray) -> FloatArray:
    """Remove mean and slope of each channel, NaN left out.

    Parameters
    ----------
    data : (n_samples, n_channels) array

    Returns
    -------
    (n_samples, n_channels) array
    """
    return next(detrended_pieces(data, max(len(data), 1)), data)


def detrended_pieces(data: FloatArray, length: int) -> Iterator[FloatArray]:
    """Yield the result of `detrended` in pieces of `length` samples; mean and slope are those of the whole record."""
    time = np.linspace(-1.0, 1.0, len(data))
    mean, slope = data.mean(axis=0), time @ data / max(float(time @ time), 1e-300)
    is_complete = np.isfinite(mean).all() and np.isfinite(slope).all()
    if not is_complete:  # else mean and slope are independent of each other
        for k, signal in enumerate(data.T):
            valid = np.isfinite(signal)
            basis = np.column_stack((np.ones(valid.sum()), time[valid]))
            mean[k], slope[k] = np.linalg.lstsq(basis, signal[valid], rcond=None)[0]
    for start in range(0, len(data), length):
        some = slice(start, start + length)
        piece = data[some] if is_complete else np.where(np.isfinite(data[some]), data[some], np.nan)
        result = np.empty_like(piece)
        for column, signal, level, rise in zip(result.T, piece.T, mean.tolist(), slope.tolist(), strict=True):
            np.multiply(time[some], -rise, out=column)
            column += signal
            column -= level
        yield result

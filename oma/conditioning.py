"""From a recording to clean channels."""

import numpy as np
import numpy.typing as npt

from daq import FloatArray, Recording
from oma.errors import TooFewChannels

BoolArray = npt.NDArray[np.bool_]


def channel_faults(recording: Recording, min_complete: float = 0.5) -> dict[str, str]:
    """Name the channels that identification has to do without, and say why.

    Only samples that all channels have are analysed, so that the channels with most gaps are given up until enough
    of the recording is complete.

    Parameters
    ----------
    recording : Recording
    min_complete : float
        Smallest share of samples that the channels kept have in common [-].

    Returns
    -------
    dict
        Channel name to reason.
    """
    valid = np.isfinite(recording.data)
    faults = {}
    for channel, column, there in zip(recording.channels, recording.data.T, valid.T, strict=True):
        if np.any(there) and np.ptp(column[there]) == 0:
            faults[channel.name] = "constant"
    kept = [i for i, channel in enumerate(recording.channels) if channel.name not in faults]
    while kept and np.count_nonzero(valid[:, kept].all(axis=1)) < min_complete * len(valid):
        share = valid[:, kept].mean(axis=0)
        worst = kept.pop(int(np.argmin(share)))
        faults[recording.channels[worst].name] = f"{share.min():.0%} of the samples are there"
    return {c.name: faults[c.name] for c in recording.channels if c.name in faults}


def usable(recording: Recording) -> tuple[tuple[str, ...], FloatArray]:
    """Leave out the channels that carry no signal.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    names : tuple of str
    data : (n_samples, n_names) array

    Raises
    ------
    TooFewChannels
        If fewer than two are left.
    """
    faults = channel_faults(recording)
    names = tuple(c.name for c in recording.channels if c.name not in faults)
    if len(names) < 2:
        raise TooFewChannels(names, 2, faults)
    return names, recording.data[:, [c.name not in faults for c in recording.channels]]


def detrended(data: FloatArray) -> FloatArray:
    """Remove mean and slope of each channel, NaN left out.

    Parameters
    ----------
    data : (n_samples, n_channels) array

    Returns
    -------
    (n_samples, n_channels) array
    """
    result = np.where(np.isfinite(data), data, np.nan)
    time = np.linspace(-1.0, 1.0, len(data))
    for column in result.T:
        valid = np.isfinite(column)
        basis = np.column_stack((np.ones(valid.sum()), time[valid]))
        column[valid] -= basis @ np.linalg.lstsq(basis, column[valid], rcond=None)[0]
    return result


def bridged(data: FloatArray, missing: BoolArray) -> FloatArray:
    """Fill gaps with straight lines."""
    result = data.copy()
    time = np.arange(len(data))
    for column, gap in zip(result.T, missing.T, strict=True):
        if gap.any():
            column[gap] = np.interp(time[gap], time[~gap], column[~gap]) if not gap.all() else 0.0
    return result

"""Signals before a change: the end of the first calm window of a reference, in single precision."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from daq import Channel, Recording
from updater import ModalDataError
from updater.validation import gapless_part

_LONGEST = 1 << 14  # samples that are kept: 0.8 MB of 12 channels
_SHORTEST = 1 << 13  # of a stretch without a gap


@dataclass(frozen=True, eq=False, kw_only=True)
class CalmSignals:
    """Signals of a calm window, as saved."""

    channels: tuple[Channel, ...]
    data: npt.NDArray[np.float32]  #: (n_samples, n_channels) acceleration [m/s2]
    rate: float  #: [Hz]
    start: int  #: [ns UTC]

    @classmethod
    def of(cls, recording: Recording) -> Self | None:
        """Return the end of the longest stretch without a gap; None if it is too short."""
        try:
            first, data = gapless_part(recording, tuple(channel.name for channel in recording.channels))
        except ModalDataError:
            return None
        if len(data) < _SHORTEST:
            return None
        left_out = max(0, len(data) - _LONGEST)
        return cls(
            channels=recording.channels,
            data=data[left_out:].astype(np.float32),
            rate=recording.rate,
            start=recording.start + round((first + left_out) / recording.rate * 1e9),
        )

    @property
    def recording(self) -> Recording:
        """Return the signals in double precision."""
        return Recording(channels=self.channels, data=self.data.astype(np.float64), rate=self.rate, start=self.start)

"""Quality of a window for identification: reasons to repeat the measurement."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray

_MIN_COMPLETE, _MAX_VARIATION = 0.9, 0.5
_FEW_CYCLES = 300.0  # with 1 % damping the law leaves 23 % of the damping then


@dataclass(frozen=True, kw_only=True)
class WindowQuality:
    """Quality of a window, and its defects."""

    complete: float  #: share of samples that all channels in use have [-]
    rms_variation: float  #: standard deviation of the blocks' rms over its mean; steady forces leave below 0.3 [-]
    cycles: float  #: periods of the lowest mode in the window [-]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Advice in words; empty for a good window."""
        texts = []
        if self.complete < _MIN_COMPLETE:
            texts.append(f"only {self.complete:.0%} of the samples are complete")
        if self.rms_variation > _MAX_VARIATION:
            texts.append(f"the vibration varies: rms of the blocks ± {self.rms_variation:.0%}")
        if self.cycles < _FEW_CYCLES:
            texts.append(f"{self.cycles:.0f} periods of the lowest mode: use longer windows for its damping")
        return tuple(texts)


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockQuality:
    """Statistics of one block of time."""

    length: int  #: [samples]
    n_complete: int  #: samples that all channels have
    power: float  #: mean over samples and channels of squared signals [(m/s2)^2]

    @classmethod
    def of(cls, data: FloatArray) -> "BlockQuality":
        """Return the statistics of zero-mean signals, (n_samples, n_channels), NaN where a sample is missing."""
        total = np.vdot(data.T, data.T)  # columns are contiguous
        if np.isfinite(total):
            return cls(length=len(data), n_complete=len(data), power=float(total) / max(data.size, 1))
        there = np.isfinite(data)
        power = float(np.mean(data[there] ** 2)) if there.any() else 0.0
        return cls(length=len(data), n_complete=int(np.count_nonzero(there.all(axis=1))), power=power)


def window_quality(blocks: Sequence[BlockQuality], rate: float, lowest: float) -> WindowQuality:
    """Sum up the blocks of a window.

    Parameters
    ----------
    blocks : sequence of BlockQuality
    rate : float
        [Hz].
    lowest : float
        Frequency of the lowest mode [Hz].

    Returns
    -------
    WindowQuality
    """
    rms = np.sqrt([block.power for block in blocks if block.n_complete])
    length = sum(block.length for block in blocks)
    return WindowQuality(
        complete=sum(block.n_complete for block in blocks) / length,
        rms_variation=float(np.std(rms) / np.mean(rms)),
        cycles=lowest * length / rate,
    )

"""Residuals of channels predicted from the others, block by block: a change is visible before its window is complete.

Blocks of a twentieth of a window, half overlapping, are predicted by the spectral matrix of blocks of calm windows
(`oma.spectral.ChannelPrediction`). The logarithm of the residual has a mean and a standard deviation over these
blocks. The newest calm window is learned one window later: a change that begins at its end is not learned.
Nothing here is logged or saved: after a start and after a new reference, it is learned again.
"""

from collections.abc import Iterator

import numpy as np

from daq import Assembler, Block, Event, Recording
from monitor.results.residuals import ChannelResiduals
from monitor.results.windows import ReferenceResult, Result, WindowResult
from monitor.settings import Settings
from monitor.watch.live.levels import CalmLevels, is_calm
from oma.spectral import ChannelPrediction

LIMIT = 6.0  #: standard deviations; the rate of false exceedances is in docs/validation/detection/residuals.md
_BLOCKS = 20  # in a window, without overlap
_LEAST_SAMPLES, _MOST_SAMPLES = 64, 2048  # of a block
_MEMORY = 50.0  # windows
_MOST_CHANNELS = 32  # the cost rises with their square
_LEAST_RESIDUAL = 1e-12  # mean square over the learned one, as the least power of the prediction: of a constant channel


class ResidualMonitor:
    """Predicts blocks as their signals arrive, and learns those of calm windows.

    Parameters
    ----------
    settings : of the site; with fewer than three or more than 32 channels there are no residuals
    """

    def __init__(self, settings: Settings) -> None:
        self._channels = tuple(channel.name for channel in settings.channels)
        names = list(dict.fromkeys(channel.device for channel in settings.channels))
        self._devices = np.array([names.index(channel.device) for channel in settings.channels], np.intp)
        rates = {device.name: device.rate for device in settings.device}
        rate = min(rates.values())
        wanted = settings.analysis.window_seconds / _BLOCKS * rate
        self._n = round(min(max(wanted, _LEAST_SAMPLES), _MOST_SAMPLES))
        self.seconds = self._n / rate  #: length of a block [s]
        step = (self._n // 2) / rate
        self._memory = _MEMORY * settings.analysis.window_seconds / step  # blocks
        self._assembler = (
            Assembler(settings.channels, rates, window_seconds=self.seconds, step_seconds=step)
            if 2 < len(self._channels) <= _MOST_CHANNELS
            else None
        )
        self._has_reference = False
        self._begin()

    def _begin(self) -> None:
        """Forget what was learned."""
        self._prediction = ChannelPrediction(self._n, self._devices, self._memory)
        self._levels = CalmLevels(len(self._channels), self._memory)
        self._calm_before = False

    def push(self, item: Block | Event) -> Iterator[ChannelResiduals]:
        """Process one item in the log's order; yield the residuals of the blocks that are complete."""
        if self._assembler is None:
            return
        blocks = self._assembler.push(item) if isinstance(item, Block) else self._assembler.push_event(item)
        for block in blocks:
            if np.isfinite(block.data).all():
                yield from self._predict(block)

    def take(self, result: Result) -> None:
        """Learn the blocks of the last calm window but one, or discard those of a changed one and of the one before.

        Before the first calm window, as after a start during an alarm, everything is discarded.
        A window belongs to the blocks since the last one: it is complete within a block of its end.
        """
        if isinstance(result, ReferenceResult):
            if self._has_reference:
                self._begin()
            self._has_reference = True
        elif isinstance(result, WindowResult):
            calm = is_calm(result)
            if not calm and not self._calm_before:
                self._begin()
            for part in (self._prediction, self._levels):
                if calm:
                    part.learn()
                else:
                    part.discard()
            self._calm_before |= calm

    def _predict(self, block: Recording) -> Iterator[ChannelResiduals]:
        spectrum = self._prediction.spectrum(block.data)
        found = self._prediction.residuals(spectrum)
        self._prediction.add(spectrum)
        if found is None:
            return
        level = np.log(np.maximum(found, _LEAST_RESIDUAL)) / 2
        self._levels.add(level)
        if self._levels.known:
            off = level - self._levels.mean
            yield ChannelResiduals(
                time=block.end,
                seconds=self.seconds,
                ratio=dict(zip(self._channels, np.exp(off).tolist(), strict=True)),
                deviation=dict(zip(self._channels, (off / self._levels.std).tolist(), strict=True)),
                limit=LIMIT,
            )

"""Innovations of a Kalman filter of the modes, block by block: a change is visible before its window is complete.

The filter predicts each sample from the past by the modes of the reference. Where frequencies or shapes change, the
innovations gain power about the changed modes. For mode k with shape phi, the innovations e of a covariance S are
projected onto phi^T S^-1 e, and their mean power about its frequency is divided by the power of all innovations: the
level of the excitation cancels. Its cube root is nearly normal, as that of a chi-square variable (Wilson & Hilferty
1931); mean and standard deviation are those of blocks of calm windows. A small change shows in the exponentially
weighted mean of the last blocks instead (Roberts 1959): the deviation is the larger one of both.

The filter is learned from the last signals of the baseline, and from calm windows after it where these are too short or
have gaps. It is learned again, from calm windows, after a start and after a new reference.

References
----------
Mehra & Peschon (1971). An innovations approach to fault detection and diagnosis in dynamic systems. Automatica 7,
637-640. Roberts (1959). Control chart tests based on geometric moving averages. Technometrics 1, 239-250.
"""

import logging
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import chain

import numpy as np

from daq import Assembler, Block, Event, FloatArray, IndexArray, Recording
from monitor.results.innovations import ModeInnovations
from monitor.results.windows import ReferenceResult, Result, WindowResult
from monitor.settings import Settings
from monitor.watch.live.levels import CalmLevels, is_calm
from updater import ModalDataError, Reference
from updater.validation import LiveFilter, ResponseModel

LIMIT = 6.0  #: standard deviations; the rate of false exceedances is in docs/validation/detection/innovations.md
_LEAST_SECONDS, _PERIODS = 1.0, 8  # of a block; of the lowest frequency in it
_LEARN_SECONDS, _LEARN_PERIODS = 60.0, 100  # of the record that is learned from; of the lowest frequency in it
_MEMORY = 50.0  # windows
_LINES, _SHARE = 2, 0.03  # each way of a mode: lines, and share of its frequency
_WEIGHT = 0.2  # of the last block in the running mean
_LEAST_MEANS = 300  # blocks before the running mean is used: its own deviation is that of few independent means
_MEAN_STD = (_WEIGHT / (2 - _WEIGHT)) ** 0.5  # of it over that of a block, if blocks are independent
_MOST_KEPT = 24_000_000  # bytes of items before the first reference: 222 s of six devices with three axes at 1000 Hz
_ITEM_BYTES = 600  # of a block or event, besides its counts
_MOST_CHANNELS = 12  # up to which the cost was measured: the filter is learned in the analysis process
_log = logging.getLogger(__name__)


class InnovationMonitor:
    """Learns the filter from blocks of calm windows, those of the baseline too, and runs it as signals arrive.

    Parameters
    ----------
    settings : of the site; with more than 12 channels there are no innovations
    present : returns the present reference; None before it is learned, and without a model
    """

    def __init__(self, settings: Settings, present: Callable[[], Reference | None]) -> None:
        self._settings, self._present = settings, present
        self._reference: Reference | None = None
        self._numbers: dict[int, int] = {}  # mode of the model -> number of the measured one
        self._assembler: Assembler | None = None
        self._awaited = len(settings.channels) <= _MOST_CHANNELS  # true until the first reference
        self._kept: deque[Block | Event] = deque()  # last items of the calm windows before the first reference
        self._n_kept = 0  # bytes of them
        self._seconds, self._learn_seconds = _LEAST_SECONDS, _LEARN_SECONDS
        self._forget()

    def _forget(self) -> None:
        self._filter: _ModeFilter | None = None
        self._calm: list[Recording] = []  # blocks of the calm windows before the last one, since the last gap
        self._held: list[Recording] = []  # blocks of the last calm window
        self._pending: list[Recording] = []  # blocks since

    def push(self, item: Block | Event) -> Iterator[ModeInnovations]:
        """Process one item in the log's order; yield the innovations of the blocks that are complete."""
        if self._awaited:
            self._keep(item)
        for block in self._assembled(item):
            if self._filter is None:
                self._pending.append(block)
            else:
                yield from self._filter.run(block)

    def _assembled(self, item: Block | Event) -> Iterator[Recording]:
        if self._assembler is not None:
            blocks = self._assembler.push(item) if isinstance(item, Block) else self._assembler.push_event(item)
            yield from blocks

    def _keep(self, item: Block | Event) -> None:
        """Keep an item until the first reference is known, and drop the oldest ones of too many."""
        self._kept.append(item)
        self._n_kept += _size(item)
        while self._n_kept > _MOST_KEPT:
            self._n_kept -= _size(self._kept.popleft())

    def take(self, result: Result) -> None:
        """Learn the blocks of the last calm window but one, or discard those of a changed one and of the one before."""
        if isinstance(result, ReferenceResult):
            self._begin(self._present(), result)
        elif isinstance(result, WindowResult):
            calm = is_calm(result)
            if self._filter:
                self._filter.learn(calm=calm)
            elif calm:
                self._calm = _without_gap([*self._calm, *self._held])
                self._held, self._pending = self._pending, []
                self._learn()
            else:
                self._calm, self._held, self._pending = [], [], []
                self._drop_kept()

    def _drop_kept(self) -> None:
        self._kept.clear()
        self._n_kept = 0

    def _begin(self, reference: Reference | None, reported: ReferenceResult) -> None:
        """Take a new reference; blocks have no delays of devices from now on."""
        self._forget()
        self._reference, self._assembler, self._awaited = reference, None, False
        settings = self._settings
        if reference is None or len(settings.channels) > _MOST_CHANNELS:
            self._drop_kept()
            return
        self._numbers = {int(k): mode.id for k, mode in zip(reference.paired, reported.modes, strict=True)}
        lowest = float(np.exp(reference.baseline.log_frequency.min()))
        self._seconds = max(_LEAST_SECONDS, _PERIODS / lowest)
        self._learn_seconds = max(_LEARN_SECONDS, _LEARN_PERIODS / lowest)
        self._assembler = Assembler(
            settings.channels,
            {device.name: device.rate for device in settings.device},
            window_seconds=self._seconds,
            step_seconds=self._seconds,
            late=dict(reference.delays.seconds),
        )
        self._learn_kept()

    def _learn_kept(self) -> None:
        """Learn the filter from the first blocks of the baseline that were kept, and its levels from the others."""
        blocks = _without_gap(list(chain.from_iterable(map(self._assembled, self._kept))))
        self._drop_kept()
        n = math.ceil(self._learn_seconds / self._seconds)
        self._calm = blocks[:n]
        self._learn()
        if self._filter is not None:
            for block in blocks[n:]:
                for _ in self._filter.run(block):  # none: its levels are not known yet
                    pass
            for _ in range(2):  # all windows of the baseline are calm: none is held back
                self._filter.learn(calm=True)

    def _learn(self) -> None:
        """Learn the filter as soon as the calm blocks last long enough; a reference that is not suitable is left."""
        if self._reference is None or not self._calm:
            return
        record = replace(self._calm[0], data=np.vstack([block.data for block in self._calm]))
        if len(record.data) < self._learn_seconds * record.rate:
            return
        try:
            model = ResponseModel.learn(self._reference, record)
        except ModalDataError as error:
            _log.info("no innovations of the modes: %s", error)
            self._assembler = None
            self._forget()
            return
        memory = _MEMORY * self._settings.analysis.window_seconds / self._seconds
        self._filter = _ModeFilter(model, record, self._numbers, self._seconds, memory)
        self._calm, self._held, self._pending = [], [], []


def _size(item: Block | Event) -> int:
    """Return the memory of an item [bytes]."""
    return _ITEM_BYTES + (item.counts.nbytes if isinstance(item, Block) else 0)


def _without_gap(blocks: list[Recording]) -> list[Recording]:
    """Return the last blocks that follow each other without a gap."""
    stretch: list[Recording] = []
    for block in blocks:
        if stretch and not _follows(stretch[-1], block):
            stretch = []
        if np.isfinite(block.data).all():
            stretch.append(block)
    return stretch


def _follows(before: Recording, block: Recording) -> bool:
    return abs(block.start - before.end) * 1e-9 * block.rate < 0.5


class _ModeFilter:
    """Filter that was learned, and the levels of its innovations.

    Parameters
    ----------
    model, record : learned model, and the signals that it was learned from
    numbers : mode of the model -> number of the measured one
    seconds : length of a block [s]
    memory : number of blocks over which older ones are forgotten
    """

    def __init__(
        self, model: ResponseModel, record: Recording, numbers: Mapping[int, int], seconds: float, memory: float
    ) -> None:
        self._model, self._seconds = model, seconds
        names = [channel.name for channel in record.channels]
        self._columns: IndexArray = np.array([names.index(channel) for channel in model.channels], np.intp)
        measured = np.flatnonzero(np.isin(model.modes, model.reference.paired))
        self._frequency = model.system.frequency[measured]
        self._numbers = [numbers[int(mode)] for mode in model.modes[measured]]
        innovations = LiveFilter(model).run(record.data[:, self._columns])[1][2 * model.settling :]
        self._inverse = np.linalg.inv(innovations.T @ innovations / len(innovations))
        shape = model.reference.at_channels(model.channels)[:, model.modes[measured]]
        self._onto = self._inverse @ shape / np.sqrt(np.einsum("ck,cd,dk->k", shape, self._inverse, shape))
        n = round(seconds * record.rate)
        lines = np.fft.rfftfreq(n, 1 / record.rate)[:, None]
        reach = _LINES * lines[1] + _SHARE * self._frequency
        self._near = np.abs(lines - self._frequency) <= reach
        self._taper = np.hanning(n)[:, None]
        self._levels = CalmLevels(2 * len(measured), memory)  # of blocks, and of their running means
        self._restart()

    def _restart(self) -> None:
        self._live = LiveFilter(self._model)
        self._before: Recording | None = None
        self._mean: FloatArray | None = None  # (n_modes,) running mean of the powers

    def learn(self, *, calm: bool) -> None:
        """Learn the levels of the last calm window but one, or discard those of a changed one."""
        if calm:
            self._levels.learn()
        else:
            self._levels.discard()

    def run(self, block: Recording) -> Iterator[ModeInnovations]:
        """Yield the innovations of a block; the filter starts again after a gap."""
        data = block.data[:, self._columns]
        if not np.isfinite(data).all():
            self._restart()
            return
        if self._before is not None and not _follows(self._before, block):
            self._restart()
        settled = self._live.settled
        self._before = block
        innovations = self._live.run(data)[1]
        if not settled:
            return
        power, level = self._powers(innovations)
        if self._mean is None:
            self._mean = self._levels.mean[: len(power)] if self._levels.known else power
        self._mean = self._mean + _WEIGHT * (power - self._mean)
        levels = np.concatenate([power, self._mean])
        self._levels.add(levels)
        if self._levels.known:
            std, of_means = np.split(self._levels.std, 2)
            off = (levels - self._levels.mean) / np.concatenate([std, np.maximum(of_means, _MEAN_STD * std)])
            use_means = self._levels.n_blocks >= _LEAST_MEANS
            yield ModeInnovations(
                time=block.end,
                seconds=self._seconds,
                level=level,
                mode=self._numbers,
                frequency=self._frequency.tolist(),
                deviation=(off.reshape(2, -1).max(0) if use_means else off[: len(power)]).tolist(),
                limit=LIMIT,
            )

    def _powers(self, innovations: FloatArray) -> tuple[FloatArray, float]:
        """Return the cube roots of the relative powers about modes (n_modes,), and the level of all innovations."""
        whole = float(((innovations @ self._inverse) * innovations).sum(1).mean()) / innovations.shape[1]
        spectrum = np.abs(np.fft.rfft((innovations @ self._onto) * self._taper, axis=0)) ** 2
        power = (spectrum * self._near).sum(0) / self._near.sum(0) / (self._taper**2).sum()
        return np.cbrt(power / whole), float(np.sqrt(whole))

"""What is in a log, counted."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq.errors import LogError
from daq.log import read_attachments, read_log
from daq.recording import Block, Flag
from daq.repair import LogState, inspect_log


@dataclass(kw_only=True)
class DeviceInfo:
    """What a log holds of one device."""

    rate: float  #: nominal scans a second [Hz]
    n_axes: int
    scale: float  #: m/s2 a count
    start: int  #: of the first scan [ns UTC]
    end: int = 0  #: after the last scan [ns UTC]
    n_scans: int = 0
    missing: int = 0  #: scans between the first and the last that are not there
    gaps: int = 0
    restarts: int = 0  #: times that the device was taken back
    temperatures: list[float] = field(default_factory=list)  #: of each block [degC], where known

    def add(self, block: Block, end_index: int) -> None:
        """Count a block; `end_index` is where the one before ended."""
        self.n_scans += block.n_scans
        self.end = _time(block, block.end_index)
        lost = block.first_index - end_index
        self.missing += max(lost, 0)
        self.gaps += lost > 0
        self.restarts += bool(block.flags & Flag.RESTARTED)
        if np.isfinite(block.temperature):
            self.temperatures.append(block.temperature)


@dataclass(frozen=True, eq=False, kw_only=True)
class LogInfo:
    """What is in a log."""

    state: LogState
    size: int  #: of the file [bytes]
    attachments: dict[str, int]  #: name -> characters
    devices: dict[str, DeviceInfo]
    events: dict[str, int]  #: topic -> number of messages; results are topics too

    @property
    def start(self) -> int | None:
        """Time of the first scan [ns UTC]."""
        return min((d.start for d in self.devices.values()), default=None)

    @property
    def end(self) -> int | None:
        """Time after the last scan [ns UTC]."""
        return max((d.end for d in self.devices.values()), default=None)


def log_info(path: Path) -> LogInfo:
    """Count what is in a log, as far as it can be read.

    Raises
    ------
    LogError
        If it cannot be read or is not a log.
    """
    state = inspect_log(path)
    devices: dict[str, DeviceInfo] = {}
    ends: dict[str, int] = {}
    events: Counter[str] = Counter()
    try:
        for item in read_log(path):
            if isinstance(item, Block):
                info = devices.setdefault(item.device, _first(item))
                info.add(item, ends.get(item.device, item.first_index))
                ends[item.device] = item.end_index
            else:
                events[item.topic] += 1
    except LogError:
        if state.whole:
            raise  # else damaged amid: what came before is counted
    attachments = {name: len(text) for name, text in _attachments(path).items()}
    return LogInfo(state=state, size=path.stat().st_size, attachments=attachments, devices=devices, events=dict(events))


def _attachments(path: Path) -> dict[str, str]:
    try:
        return read_attachments(path)
    except LogError:
        return {}  # the damage comes before the first message


def _first(block: Block) -> DeviceInfo:
    start = _time(block, block.first_index)
    return DeviceInfo(rate=block.rate, n_axes=block.counts.shape[1], scale=block.scale, start=start)


def _time(block: Block, index: int) -> int:
    """Return the time of a scan by the block's own pair [ns UTC]."""
    return block.pair_time + round((index - block.pair_index) / block.rate * 1e9)

"""Numbers of scans, gaps and events in a log."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq.errors import LogError
from daq.log.mcap_log import read_attachments, read_log
from daq.log.parts import AnyLog, files_of
from daq.log.repair import LogState, inspect_log
from daq.types import Block, Flag, Item


@dataclass(kw_only=True)
class DeviceInfo:
    """Contents of a log from one device."""

    rate: float  #: nominal scans per second [Hz]
    n_axes: int
    scale: float  #: m/s2 per count
    start: int  #: time of the first scan [ns UTC]
    end: int = 0  #: after the last scan [ns UTC]
    n_scans: int = 0
    missing: int = 0  #: scans between the first and the last that are not there
    gaps: int = 0
    restarts: int = 0  #: times that the device was taken back
    temperatures: list[float] = field(default_factory=list)  #: temperature of each block [degC], if known

    def add(self, block: Block, end_index: int) -> None:
        """Count a block; `end_index` is where the one before ended."""
        self.n_scans += block.n_scans
        self.end = block.time_of(block.end_index)
        lost = block.first_index - end_index
        self.missing += max(lost, 0)
        self.gaps += lost > 0
        self.restarts += bool(block.flags & Flag.RESTARTED)
        if np.isfinite(block.temperature):
            self.temperatures.append(block.temperature)


@dataclass(frozen=True, eq=False, kw_only=True)
class LogInfo:
    """Contents of a log."""

    state: LogState
    size: int  #: size of its files [bytes]
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


def log_info(log: AnyLog) -> LogInfo:
    """Count the readable content of a log: of one file, or of all files of a run.

    Raises
    ------
    LogError
        If it cannot be read or is not a log.
    """
    states = []
    devices: dict[str, DeviceInfo] = {}
    ends: dict[str, int] = {}
    events: Counter[str] = Counter()
    for path in files_of(log):
        states.append(inspect_log(path))
        for item in _readable(path, states[-1]):
            if isinstance(item, Block):
                info = devices.setdefault(item.device, _first(item))
                info.add(item, ends.get(item.device, item.first_index))
                ends[item.device] = item.end_index
            else:
                events[item.topic] += 1
    return LogInfo(
        state=sum(states[1:], states[0]),
        size=sum(path.stat().st_size for path in files_of(log)),
        attachments={name: len(text) for name, text in _attachments(files_of(log)[0]).items()},
        devices=devices,
        events=dict(events),
    )


def _readable(path: Path, state: LogState) -> Iterator[Item]:
    """Yield the readable content of a file; of a damaged one the part before the damage."""
    try:
        yield from read_log(path)
    except LogError:
        if state.whole:
            raise


def _attachments(path: Path) -> dict[str, str]:
    try:
        return read_attachments(path)
    except LogError:
        return {}  # the damage comes before the first message


def _first(block: Block) -> DeviceInfo:
    start = block.time_of(block.first_index)
    return DeviceInfo(rate=block.rate, n_axes=block.counts.shape[1], scale=block.scale, start=start)

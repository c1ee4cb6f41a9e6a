"""A log as messages for stock viewers, one per scan with its own time."""

from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from mcap.writer import CompressionType, Writer

from daq.errors import LogError, writing
from daq.log.format.preview import VIEW
from daq.log.format.ros_messages import ENCODING, encode_scans, message_kind, schema
from daq.log.mcap_log import read_attachments, read_log
from daq.log.parts import AnyLog
from daq.timing.scan_clocks import ScanClock, ScanClocks
from daq.types import Block, IndexArray

_AHEAD_SECONDS = 2.0  # of a device's data that its clock has seen before a scan gets its time
NO_DELAYS: Mapping[str, float] = MappingProxyType({})


class _Waiting:
    """Blocks of one device until the arrivals just after them have been seen."""

    def __init__(self, late: int) -> None:
        self._late = late
        self._blocks: deque[tuple[Block, ScanClock]] = deque()
        self._last = 0  # time of the last scan handed on [ns UTC]

    def add(self, block: Block, clock: ScanClock) -> Iterator[tuple[Block, IndexArray]]:
        """Add a block; yield the blocks whose times are known now."""
        ahead = round(_AHEAD_SECONDS * block.rate)
        while self._blocks and (
            self._blocks[0][1] is not clock or block.end_index - self._blocks[0][0].end_index >= ahead
        ):
            yield self._timed(*self._blocks.popleft())
        self._blocks.append((block, clock))

    def rest(self) -> Iterator[tuple[Block, IndexArray]]:
        """Yield the remaining blocks at the end."""
        while self._blocks:
            yield self._timed(*self._blocks.popleft())

    def _timed(self, block: Block, clock: ScanClock) -> tuple[Block, IndexArray]:
        """Return a block and the times of its scans (n_scans,), which never go back."""
        times = clock.times(np.arange(block.first_index, block.end_index)) - self._late
        times = np.maximum(times, self._last + 1 + np.arange(block.n_scans))
        self._last = int(times[-1])
        return block, times


def timed_blocks(log: AnyLog, late: Mapping[str, float] = NO_DELAYS) -> Iterator[tuple[Block, IndexArray]]:
    """Yield the blocks of a log with the times of their scans [ns UTC], of each device in order.

    Parameters
    ----------
    log : its path, or all files of a run
    late : device -> delay of its scans, which is removed [s]
    """
    clocks, waiting = ScanClocks(), dict[str, _Waiting]()
    for item in read_log(log):
        if isinstance(item, Block) and item.n_scans:
            device = waiting.setdefault(item.device, _Waiting(round(late.get(item.device, 0.0) * 1e9)))
            yield from device.add(item, clocks.add(item))
    for device in waiting.values():
        yield from device.rest()


def expand_log(log: AnyLog, path: Path, late: Mapping[str, float] = NO_DELAYS) -> dict[str, int]:
    """Write a log's signals at full rate to a new MCAP file of ROS 2 messages, on /view/DEVICE.

    The archive keeps many scans in one message, which is small; viewers plot one point per message. Attachments are
    copied.

    Parameters
    ----------
    log : its path, or all files of a run
    path : of the new file
    late : device -> delay of its scans, which is removed [s]

    Returns
    -------
    dict
        Device -> number of scans.

    Raises
    ------
    LogError
        If the log cannot be read or has no scan, or the file exists or cannot be written.
    """
    attached = read_attachments(log)
    blocks = timed_blocks(log, late)
    first = next(blocks, None)
    if first is None:
        raise LogError(str(log), "holds no scan to expand")
    with writing(path, LogError), path.open("xb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="modalwatch")
        for name, text in attached.items():
            writer.add_attachment(int(first[1][0]), int(first[1][0]), name, "text/plain", text.encode())
        counts = _Messages(writer)
        counts.write(*first)
        for block, times in blocks:
            counts.write(block, times)
        writer.finish()  # type: ignore[no-untyped-call]
    return counts.written


class _Messages:
    """Writes scans as messages."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.written: dict[str, int] = {}

    def write(self, block: Block, times: IndexArray) -> None:
        if block.device not in self._channels:
            kind = message_kind(block.counts.shape[1])
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(*schema(kind))
            topic = VIEW + block.device
            self._channels[block.device] = self._writer.register_channel(topic, ENCODING, self._schemas[kind])
            self.written[block.device] = 0
        channel = self._channels[block.device]
        messages = encode_scans(block.device, times, np.asarray(block.counts * block.scale, float))
        for sequence, (time, data) in enumerate(zip(times.tolist(), messages, strict=True), self.written[block.device]):
            self._writer.add_message(channel, log_time=time, publish_time=time, data=data, sequence=sequence)
        self.written[block.device] += block.n_scans

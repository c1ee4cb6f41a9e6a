"""Recorded logs played as devices, in real time or at any speed."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np

from daq.drivers.base import LogAddress, Scans
from daq.errors import DeviceLost, DriverError, LogError
from daq.log.mcap_log import read_log
from daq.log.naming import as_logs
from daq.log.parts import AnyLog
from daq.log.recordings import HOW_TO_PLACE, read_channel_map
from daq.types import Block, DeviceIdentity, Flag

_WAIT_SECONDS = 0.1
_PIECE_SECONDS = 0.02  # wall time of the data of one read [s], as from a port
_LATEST_SECONDS = 2.0  # of wall time to a device's first scan
_STARTING_SECONDS = 60.0  # of a log in which its devices begin one after the other
_BACK_SECONDS = 0.2  # of wall time to the next scan, from which on a device that was lost would not answer


class ReplayedDevice:
    """Driver of one device of a log.

    Counters and arrival times are those of the log: gaps are the same to the scan, and devices that are played from
    the same log at the same speed keep their times to one another. Where the device was lost it is lost again; where
    the log ends it is lost for good.

    Parameters
    ----------
    address : log and device
    rate : scans per second, which must be that of the log [Hz]

    Raises
    ------
    ValueError
        If rate or speed is not positive.
    """

    scale = float("nan")  #: [m/s2 per count], known once the log is open
    modulus = 1 << 31

    def __init__(self, address: LogAddress, rate: float) -> None:
        for name, value in (("rate", rate), ("speed", address.speed)):
            if not value > 0:
                raise ValueError(f"{name} of {address}: expected a positive number, found {value:g}")
        self._address, self._rate = address, rate
        self._playback: _Playback | None = None  # from the first opening on: a device that was lost is not restarted
        self._blocks: Iterator[Block] = iter(())
        self._next: Block | None = None
        self._open = False

    def open(self) -> DeviceIdentity:
        """Start the log with its first device; for further devices continue at its position."""
        try:
            block = self._start()
        except (LogError, ValueError) as error:
            raise DriverError(str(self._address), f"cannot be played: {error}") from error
        self._open, self.scale = True, block.scale
        details = {"log": self._address.path.name}
        return DeviceIdentity(product="replay", serial=self._address.device, details=details)

    def _start(self) -> Block:
        """Return the block that comes next, which must be near."""
        first = self._playback is None
        playback = self._playback = self._playback or self._begin()
        if self._next is None:
            raise ValueError("the log has ended")
        silent = playback.seconds_to(_end(self._next))
        if silent > (_LATEST_SECONDS if first else _BACK_SECONDS):
            raise ValueError(f"the device is silent for another {silent:.1f} s")
        if not first:
            time.sleep(max(0.0, silent))  # it is back when it sends
        return self._next

    def _begin(self) -> "_Playback":
        """Join the playback of the log, and find this device in it."""
        playback = join_playback(self._address)
        n = max(1, round(_PIECE_SECONDS * self._rate * self._address.speed))
        self._blocks = (b for b in _pieces(playback.log, self._address.device, n) if _end(b) >= playback.start)
        self._next = next(self._blocks, None)
        if self._next is None:
            hint = f": {HOW_TO_PLACE}" if read_channel_map(playback.log) else ""
            raise ValueError(f"the log has no scan of this device; there are {', '.join(_devices(playback.log))}{hint}")
        if self._next.rate != self._rate:
            raise ValueError(f"rate: expected {self._rate:g} Hz, found {self._next.rate:g}")
        return playback

    def read(self) -> Scans:
        """Return the scans that are due; none if none is within 0.1 s.

        Raises
        ------
        DeviceLost
            If the log has ended, or is damaged.
        """
        if not self._open or self._playback is None:
            raise DeviceLost(str(self._address), "is not open")
        block = self._next
        if block is None:
            raise DeviceLost(str(self._address), "the log ends here")
        wait = self._playback.seconds_to(_end(block))
        time.sleep(max(0.0, min(wait, _WAIT_SECONDS)))
        if wait > _WAIT_SECONDS:
            return Scans(np.empty((0, block.counts.shape[1]), np.int32), np.empty(0, np.int32), float("nan"), 0)
        try:
            self._next = next(self._blocks, None)
        except LogError as error:
            raise DeviceLost(str(self._address), str(error)) from error
        return self._scans(block, self._playback)

    def _scans(self, block: Block, playback: "_Playback") -> Scans:
        index = np.arange(block.first_index, block.end_index)
        return Scans(
            counts=block.counts,
            counter=index if block.clock else (index % self.modulus).astype(np.int32),
            temperature=block.temperature,
            bad_bytes=int(bool(block.flags & Flag.BAD_FRAMES)),  # the log has not kept how many
            age=-round(playback.seconds_to(_end(block)) * 1e9),
            clock=block.clock,
        )

    def close(self) -> None:
        """Stop reading; the log continues."""
        self._open = False


class _Playback:
    """A log that is being played, from where all its devices have begun: one time for all of them."""

    def __init__(self, log: AnyLog, speed: float) -> None:
        self.log, self._speed = log, speed
        self.start = _start_of(log)  #: [ns UTC]
        self._begun = time.perf_counter_ns()

    def seconds_to(self, when: int) -> float:
        """Return how long it takes of wall time until the log is at a time [ns UTC]; negative if it was."""
        return (when - self.start) / self._speed * 1e-9 - (time.perf_counter_ns() - self._begun) * 1e-9


_PLAYING: "WeakValueDictionary[tuple[Path, float], _Playback]" = WeakValueDictionary()  # as long as a driver has it
_LOCK = threading.Lock()


def join_playback(address: LogAddress) -> _Playback:
    """Return the playback of a log at a speed, begun now unless some device of it is being played.

    Raises
    ------
    LogError
        If it cannot be read.
    ValueError
        If a folder holds more than one log, or the log has no scans.
    """
    key = address.path.resolve(), address.speed
    with _LOCK:
        playback = _PLAYING.get(key)
        if playback is None:
            logs = as_logs([address.path])
            if len(logs) > 1:
                raise ValueError(f"the folder holds {len(logs)} logs: name one of them")
            playback = _PLAYING[key] = _Playback(logs[0], address.speed)
        return playback


def _pieces(log: AnyLog, device: str, n: int) -> Iterator[Block]:
    """Yield the blocks of a device, cut into pieces of at most n scans."""
    for item in read_log(log):
        if isinstance(item, Block) and item.device == device:
            for at in range(0, item.n_scans, n):
                flags = Flag.NONE if at else item.flags
                yield replace(item, first_index=item.first_index + at, counts=item.counts[at : at + n], flags=flags)


def _start_of(log: AnyLog) -> int:
    """Return when the last of the devices that send within the first minute began [ns UTC]."""
    begun: dict[str, int] = {}
    for block in (item for item in read_log(log) if isinstance(item, Block)):
        begin = _end(block) - round(block.n_scans / block.rate * 1e9)
        if begun and begin > min(begun.values()) + _STARTING_SECONDS * 1e9:
            break
        begun.setdefault(block.device, begin)
    if not begun:
        raise ValueError("the log has no scans")
    return max(begun.values())


def _devices(log: AnyLog) -> list[str]:
    return sorted({item.device for item in read_log(log) if isinstance(item, Block)})


def _end(block: Block) -> int:
    """Return when a block's last scan had arrived, by its pair [ns UTC]."""
    return block.arrival_time + round((block.end_index - 1 - block.arrival_index) / block.rate * 1e9)

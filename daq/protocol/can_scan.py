"""Scans that a sensor sends in one or several CAN frames, tied by a counter: both directions side by side."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq.protocol.can_signals import CanSignal
from daq.protocol.frames import NO_FRAMES, NUMBER, CanFrames, concatenate
from daq.types import FloatArray, IndexArray, IntArray

LONGEST_COUNTER = 24  #: bits that are looked at of a longer one
_KEPT = 4096  # frames remembered while no scan becomes complete
MIN_COUNT, LARGEST_COUNT = -(1 << 31), (1 << 31) - 1


@dataclass(frozen=True, kw_only=True)
class ScanMessage:
    """One of the frames of a scan."""

    name: str
    identifier: int  #: identifier with the bit EXTENDED
    size: int  #: bytes of data


@dataclass(frozen=True, kw_only=True)
class ScanLayout:
    """Layout of a scan on the bus.

    Signals are given with the place of their message in `messages`.
    """

    messages: tuple[ScanMessage, ...]  #: messages in the order of transmission
    axes: tuple[tuple[int, CanSignal], ...]  #: x, y, z of the device, as many as it has
    counters: tuple[tuple[int, CanSignal], ...]  #: counters of one message or of more
    modulus: int  #: counter values before the counter wraps
    scale: float  #: m/s2 per count
    unit: float  #: m/s2 a unit of the axes
    temperature: tuple[ScanMessage, CanSignal] | None = None  #: [degC], of any message, in the scan or not

    @property
    def identifiers(self) -> npt.NDArray[np.uint32]:
        """Identifiers of the scan's messages."""
        return np.array([message.identifier for message in self.messages], np.uint32)

    @property
    def all_identifiers(self) -> frozenset[int]:
        """Identifiers of all messages that are the sensor's."""
        other = {self.temperature[0].identifier} if self.temperature else set()
        return frozenset({message.identifier for message in self.messages} | other)

    def counts(self, data: npt.NDArray[np.uint8]) -> tuple[IntArray, npt.NDArray[np.bool_]]:
        """Return counts (n, n_axes) of scans' data (n, n_messages, 8), and which of them are numbers that fit (n,)."""
        values = np.stack([signal.physical(data[:, place]) for place, signal in self.axes], axis=1)
        counts = np.rint(values * (self.unit / self.scale))
        good = np.all((counts >= MIN_COUNT) & (counts <= LARGEST_COUNT), axis=1)  # not a number is not either
        return np.where(good[:, None], counts, 0).astype(np.int32), np.asarray(good)


def encode_scans(layout: ScanLayout, counts: IntArray, first_count: int) -> CanFrames:
    """Return the frames of scans (n, n_axes) numbered from `first_count` on, one scan after another.

    A value that a signal cannot hold becomes the nearest it can.
    """
    n, m = len(counts), len(layout.messages)
    data = np.zeros((n, m, 8), np.uint8)
    for (place, signal), column in zip(layout.axes, counts.T, strict=True):
        values = column * (layout.scale / layout.unit)
        raw = (np.clip(values, *signal.limits) - signal.offset) / signal.factor
        _write(data, place, signal, raw if signal.is_float else np.rint(raw).astype(np.int64))
    number = (first_count + np.arange(n)) % layout.modulus
    for place, signal in layout.counters:
        _write(data, place, signal, number)
    sizes = np.array([message.size for message in layout.messages], np.uint8)
    return CanFrames(np.tile(layout.identifiers, n), np.tile(sizes, n), data.reshape(n * m, 8))


def _write(data: npt.NDArray[np.uint8], place: int, signal: CanSignal, raw: FloatArray | npt.NDArray[np.int64]) -> None:
    own = np.ascontiguousarray(data[:, place])
    signal.put(own, raw)
    data[:, place] = own


@dataclass(frozen=True, eq=False)
class DecodedScans:
    """Scans in the order of the bus."""

    counts: IntArray  #: (n, n_axes) [-]
    counter: IntArray  #: (n,) [-]
    arrived: IndexArray  #: (n,) when the last frame of each had arrived, by the clock of the frames


class ScanDecoder:
    """Scans out of one sensor's frames, of which any may be lost or come twice.

    A scan consists of consecutive messages of the layout. This alone would combine halves of two scans if all frames
    between them are lost. Messages with a counter must therefore agree. For each message without one, the number of
    messages must equal the increment of the counter: since the last counter if it is sent before the counter, up to the
    next one if it is sent after. Then none is missing. A lost frame costs its scan; a completely lost scan costs the
    adjacent ones; halves of two scans are never combined. A frame that repeats the previous one bit by bit is dropped:
    a sender repeats frames that it considers not received (ISO 11898-1: the last bit of a frame ends it for receivers
    only).

    If a message without a counter is sent before the one with it, the first scan is dropped: its parts cannot be
    verified. If one is sent after it, a scan is complete with the next counter.

    Parameters
    ----------
    layout : layout of a scan
    """

    def __init__(self, layout: ScanLayout) -> None:
        self._layout = layout
        self._sizes = np.array([message.size for message in layout.messages], np.uint8)
        (self._at, self._counter), *self._others = sorted(layout.counters, key=lambda counter: counter[0])
        counted = {place for place, _ in layout.counters}
        uncounted = [place for place in range(len(layout.messages)) if place not in counted]
        self._before = [place for place in uncounted if place < self._at]
        self._after = [place for place in uncounted if place > self._at]
        self._rest, self._stamps = NO_FRAMES, np.zeros(0, np.intp)
        self._decided = 0  # counters at the start of the rest that are done with: none or one
        self.bad_frames = 0  #: frames of a wrong length, without a value, or without the others of their scan, so far
        self.temperature = float("nan")  #: the last that came [degC]

    def feed(self, frames: CanFrames, arrived: IndexArray) -> DecodedScans:
        """Take the next frames (n), and when each arrived (n,); return the scans that are complete."""
        self._warm(frames)
        joined, stamps = self._joined(frames, arrived)
        place = _places(self._layout, joined.ids)
        counters = np.flatnonzero(place == self._at)
        end = self._n_decidable(counters, len(joined))
        if end <= self._decided:
            self._wait(joined, stamps)
            return DecodedScans(np.empty((0, len(self._layout.axes)), np.int32), _NONE.astype(np.int32), _NONE)
        begin, number = self._whole(joined, place, counters, end)
        counts, good = self._layout.counts(joined.data[begin[:, None] + np.arange(len(self._layout.messages))])
        counted_from = int(counters[max(0, self._decided - 1)])
        inside = int(np.count_nonzero(good & (begin + self._at > counted_from)))
        self.bad_frames += int(counters[end - 1]) - counted_from - len(self._layout.messages) * inside
        self._decided, start = 1, int(counters[end - 1])
        self._rest, self._stamps = joined[start:], stamps[start:]
        done = begin[good] + len(self._layout.messages) - 1
        return DecodedScans(counts[good], number[good].astype(np.int32), stamps[done])

    def _warm(self, frames: CanFrames) -> None:
        """Store the temperature, if frames contain it."""
        if self._layout.temperature is None:
            return
        message, signal = self._layout.temperature
        own = frames[(frames.ids == message.identifier) & (frames.dlc == message.size)]
        if len(own):
            self.temperature = float(signal.physical(own.data[-1:])[0])

    def _joined(self, frames: CanFrames, arrived: IndexArray) -> tuple[CanFrames, IndexArray]:
        """Return the rest with the new frames, those of the right length that do not repeat the one before."""
        place = _places(self._layout, frames.ids)
        sound = (place >= 0) & (frames.dlc == self._sizes[place])
        self.bad_frames += int(np.count_nonzero((place >= 0) & ~sound))
        joined = concatenate([self._rest, frames[sound]])
        stamps = np.concatenate([self._stamps, arrived[sound]])
        same = (joined.ids[1:] == joined.ids[:-1]) & (joined.data[1:] == joined.data[:-1]).all(axis=1)
        if not same.any():
            return joined, stamps
        fresh = np.append(True, ~same)
        return joined[fresh], stamps[fresh]

    def _n_decidable(self, counters: IndexArray, n_frames: int) -> int:
        """Return the number of counters for which all frames that decide about their scan are present."""
        if not len(counters):
            return 0
        left = n_frames - int(counters[-1])
        complete = not self._after and left >= len(self._layout.messages) - self._at
        return len(counters) - (not complete)

    def _whole(
        self, joined: CanFrames, place: IndexArray, counters: IndexArray, end: int
    ) -> tuple[IndexArray, IndexArray]:
        """Return where the scans that are whole begin, and their numbers, of counters not decided before `end`."""
        m, k = len(self._layout.messages), np.arange(self._decided, end)
        number = self._number(self._counter, joined.data[counters])
        step = np.diff(number) % self._layout.modulus
        begin = counters[k] - self._at
        good = (begin >= 0) & (begin + m <= len(joined)) & (number[k] < self._layout.modulus)
        good[k > 0] &= step[k[k > 0] - 1] > 0  # a constant counter is not valid
        begin = np.where(good, begin, 0)
        for q in range(m):
            good &= place[np.minimum(begin + q, len(joined) - 1)] == q
        for q, signal in self._others:
            good &= self._number(signal, joined.data[np.minimum(begin + q, len(joined) - 1)]) == number[k]
        for q in self._before:
            good &= np.append(False, _as_many(place == q, counters, step))[k]
        for q in self._after:
            good &= _as_many(place == q, counters, step)[k]
        return begin[good], number[k][good]

    def _number(self, signal: CanSignal, data: npt.NDArray[np.uint8]) -> IndexArray:
        mask = np.uint64((1 << LONGEST_COUNTER) - 1)
        return (signal.bits(data) & mask).astype(np.intp)

    def _wait(self, joined: CanFrames, stamps: IndexArray) -> None:
        """Remember frames until a scan becomes complete, but not for ever."""
        if len(joined) > _KEPT:
            self.bad_frames += len(joined) - _KEPT
            self._decided = 0
        self._rest, self._stamps = joined[-_KEPT:], stamps[-_KEPT:]


_NONE: IndexArray = np.zeros(0, np.intp)


def _places(layout: ScanLayout, ids: npt.NDArray[np.uint32]) -> IndexArray:
    """Return the place in a scan of each frame's message (n,), -1 for those of others."""
    place = np.full(len(ids), -1, np.intp)
    for k, identifier in enumerate(layout.identifiers):
        place[ids == identifier] = k
    return place


def _as_many(sent: npt.NDArray[np.bool_], counters: IndexArray, step: IndexArray) -> npt.NDArray[np.bool_]:
    """Return whether as many frames of a message lie between two counters as they increase (n_counters - 1,)."""
    return np.asarray(np.diff(np.cumsum(sent)[counters]) == step)


def what_is_missing(layout: ScanLayout, frames: CanFrames) -> str:
    """Return the reason why received frames form no scan."""
    for message in layout.messages:
        own = frames[frames.ids == message.identifier]
        name = f"{message.name} ({message.identifier & NUMBER:#x})"
        if not len(own):
            return f"no frame of {name} came"
        if not (own.dlc == message.size).any():
            return f"{name}: expected {message.size} bytes, found {own.dlc[0]}"
    order = ", ".join(message.name for message in layout.messages)
    return f"frames arrive, but form no scan: the counter does not change, or they are not sent as {order}"

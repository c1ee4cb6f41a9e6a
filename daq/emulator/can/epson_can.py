"""An Epson M-A552AC1x on an emulated CAN bus."""

import math
import time

import numpy as np

from daq.emulator.can.canopen_server import Entry, Place, SdoServer
from daq.emulator.can.sync import SyncProducer
from daq.emulator.serving import NO_FAULTS, NO_SYNCS, FaultyLine, Frame, LineFaults, SampleSource, Syncs
from daq.protocol import epson_can as epson
from daq.protocol.epson import temperature_raw
from daq.protocol.epson_filters import TAPS, group_delay
from daq.protocol.frames import CanFrames
from daq.timing.host_clock import HostClock

_INITIALISING, _OPERATIONAL, _PRE_OPERATIONAL, _STOPPED = 0, 5, 127, 4
_START, _STOP, _ENTER_PRE_OPERATIONAL, _RESET = 1, 2, 128, (129, 130)
_NMT, _EMERGENCY, _SDO_REQUEST, _SDO_ANSWER, _HEARTBEAT = 0x000, 0x080, 0x600, 0x580, 0x700


class EmulatedEpsonCan:
    """One node: boots, answers NMT and SDO, sends heartbeats if configured, and scans while operational.

    Parameters
    ----------
    source : measured signal
    clock : simulated clock
    node : its id
    serial_number : 32 bits
    clock_error : of its own oscillator, 1e-6 = 1 ppm fast
    product : its name; more than four letters take several frames
    temperature : [degC]; None: not available
    apply_seconds : wall time without reply after the command to apply the settings; about 1 s in hardware
    faults : intervals in which its frames are lost, repeated or cut, or it is dead; and the start of its counter
    """

    bytes_a_scan = 40  #: size of SLCAN lines: one of 8 bytes, one of 6

    def __init__(
        self,
        source: SampleSource,
        clock: HostClock,
        *,
        node: int,
        serial_number: int,
        clock_error: float = 0.0,
        product: str = "A552",
        temperature: float | None = 21.0,
        apply_seconds: float = 0.05,
        faults: LineFaults = NO_FAULTS,
    ) -> None:
        self.node, self.line = node, FaultyLine(faults)
        self._source, self._clock, self._clock_error = source, clock, clock_error
        self._apply_seconds, self._deaf_until = apply_seconds, 0.0
        self._reset_objects = _objects(node, serial_number, product)
        if temperature is not None:
            self._reset_objects[epson.TEMPERATURE] = _temperature(temperature)
        self._objects = SdoServer(dict(self._reset_objects), self._written)
        self._state = _PRE_OPERATIONAL
        self._hung = False
        self._unsent: list[Frame] = []  # that it sends by itself, next time
        self.sampling_since: int | None = None  #: time of the first scan [ns UTC], None while it is not sampling
        self._first_started: int | None = None
        self._sampled = 0  # scans that the last `scans` has returned
        self._producer = SyncProducer(clock, clock_error)
        self._train, self._train_first = 0, 0  # SYNC of sampling: number since the start, and the first one received
        self._due = 0
        self._rate = 1000.0
        #: [s of wall time], in which the host waits for it, also while an accelerated world stops
        self._next_beat: float | None = None
        self.sent = 0  #: scans handed to the adapter
        self.dropped = 0  #: scans that found it full or closed

    @property
    def synced(self) -> bool:
        """True if it samples on SYNC."""
        return self._objects[epson.TRANSMISSION] == epson.BY_SYNC

    @property
    def _delay(self) -> float:
        """Delay of a scan by the device's filter [s]."""
        return group_delay(self._objects[epson.FILTER])

    def receive(self, can_id: int, data: bytes) -> list[Frame]:
        """Take a frame from the bus; return those that answer it."""
        if self._hung or self._dead:
            return []
        if can_id == _NMT and len(data) == 2 and data[1] in (0, self.node):
            return self._command(data[0])
        if can_id == _SDO_REQUEST + self.node and time.monotonic() >= self._deaf_until and self._state != _STOPPED:
            answer = self._objects.answer(data)
            return [] if answer is None else [(_SDO_ANSWER + self.node, answer)]
        return []

    def _command(self, command: int) -> list[Frame]:
        if command == _START and self._state != _OPERATIONAL:
            self._state, self._due, self._train, self._train_first = _OPERATIONAL, 0, 0, 0
            if not self.synced:
                self.sampling_since = self._clock.now()
                self._source.start(self.sampling_since, self._rate * (1 + self._clock_error))
        elif command in (_STOP, _ENTER_PRE_OPERATIONAL, *_RESET):
            self._state = _STOPPED if command == _STOP else _PRE_OPERATIONAL
            self.sampling_since = None
        return [(_HEARTBEAT + self.node, bytes([_INITIALISING]))] if command in _RESET else []

    def warm_to(self, temperature: float) -> None:
        """Change the temperature [degC]."""
        self._reset_objects[epson.TEMPERATURE] = _temperature(temperature)
        self._objects.set(epson.TEMPERATURE, temperature_raw(temperature) % 2**32)

    def power_cycle(self) -> None:
        """Interrupt the power: the node boots with its default settings and sends its boot message."""
        self._stand_still()
        self._hung, self._state = False, _PRE_OPERATIONAL
        self._objects = SdoServer(dict(self._reset_objects), self._written)
        self._unsent = [(_HEARTBEAT + self.node, bytes([_INITIALISING]))]

    def hang(self) -> None:
        """Stop responding until the power is interrupted."""
        self._stand_still()
        self._hung = True

    def _stand_still(self) -> None:
        self.sampling_since = self._next_beat = None
        self._producer.stop()

    def fail(self, code: int, register: int = 0x01) -> None:
        """Send an emergency (CiA 301, section 7.2.7), and continue."""
        self._unsent.append((_EMERGENCY + self.node, code.to_bytes(2, "little") + bytes([register]) + bytes(5)))

    def _written(self, place: Place) -> None:
        if place == epson.APPLY:
            self._rate = 1000.0 / self._objects[epson.PERIOD]
            self._objects.set(epson.APPLY, epson.APPLIED)
            self._deaf_until = time.monotonic() + self._apply_seconds
        elif place == epson.SYNC_COB:
            produces = self._objects[epson.SYNC_COB] & epson.SYNC_PRODUCER
            self._producer.start(self._objects[epson.SYNC_PERIOD]) if produces else self._producer.stop()
        elif place == epson.HEARTBEAT:
            self._next_beat = time.monotonic() if self._objects[epson.HEARTBEAT] else None

    def beats(self) -> list[Frame]:
        """Return unprompted frames: the heartbeat if it is due, emergencies."""
        if self._dead:
            return []
        waiting, self._unsent = self._unsent, []
        now = time.monotonic()
        if self._next_beat is None or now < self._next_beat:
            return waiting
        self._next_beat = now + self._objects[epson.HEARTBEAT] / 1000
        return [*waiting, (_HEARTBEAT + self.node, bytes([self._state]))]

    def syncs(self) -> Syncs:
        """Return the SYNC frames that it has to send by now."""
        return self._producer.due()

    def scans(self, room: int, syncs: Syncs = NO_SYNCS) -> CanFrames:
        """Return the process data that are due, of as many scans as there is room for; the others are dropped."""
        n = self._n_received(syncs) if self.synced else self._n_due()
        first = self._due
        counts = self._source.read(first - self._train_first, n)[:room] if n else np.empty((0, 3), np.int32)
        self._due += n
        self.dropped += n - len(counts)
        self.sent += len(counts)
        self._sampled = len(counts)
        self._first_started = self._first_started or self.sampling_since
        frames = epson.encode_scans(self.node, counts, self.line.counter + first)
        on = [not self._objects[place] & epson.COB_OFF for place in (epson.TPDO1_COB, epson.TPDO2_COB)]
        return frames if all(on) else frames[np.tile(on, len(counts))]

    def disturbed(self, frames: CanFrames) -> CanFrames:
        """Return the frames of a bus that arrive: of the frames just returned by `scans`, some may be lost."""
        own = np.flatnonzero(np.isin(frames.ids, (epson.TPDO1 + self.node, epson.TPDO2 + self.node)))
        if not self._sampled or len(own) != 2 * self._sampled:
            return frames
        times, pairs = np.ones(len(frames), np.intp), own.reshape(-1, 2)
        first = self._scans_until(self.sampling_since) + self._due - self._sampled
        for start, stop, what in self.line.runs(first, self._sampled, self._rate):
            if what is not None:
                times[pairs[start:stop]] = {"repeated": (2, 2), "cut": (1, 0)}.get(what, (0, 0))
        return frames[np.repeat(np.arange(len(frames)), times)]

    def _scans_until(self, time: int | None) -> int:
        """Return how many scans there could have been since it first sampled."""
        if self._first_started is None or time is None:
            return 0
        return round(1e-9 * (time - self._first_started) * self._rate)

    @property
    def _dead(self) -> bool:
        return self.line.happening(self._scans_until(self._clock.now()), self._rate) == "silent"

    def _n_due(self) -> int:
        """Return how many scans its own timer has made due."""
        if self.sampling_since is None:
            return 0
        elapsed = (self._clock.now() - self.sampling_since) * 1e-9 - self._delay
        return max(0, math.floor(elapsed * self._rate * (1 + self._clock_error)) + 1 - self._due)

    def _n_received(self, syncs: Syncs) -> int:
        """Return the number of scans due by SYNC frames, one each; the source gets the time of the first."""
        if not syncs.n or self._state != _OPERATIONAL or self._hung:
            return 0
        if syncs.since != self._train:
            self._train, self._train_first = syncs.since, self._due
            self.sampling_since = syncs.since + round((syncs.first / syncs.rate - self._delay) * 1e9)
            self._source.start(self.sampling_since, syncs.rate)
        return syncs.n


def _temperature(celsius: float) -> Entry:
    return Entry(temperature_raw(celsius).to_bytes(4, "little", signed=True))


def _objects(node: int, serial_number: int, product: str) -> dict[Place, Entry]:
    """Return the objects of a device after reset."""

    def number(value: int, size: int, *allowed: int) -> Entry:
        kept = {entry.to_bytes(size, "little") for entry in allowed}
        return Entry(value.to_bytes(size, "little"), kept.__contains__)

    def any_number(value: int, size: int) -> Entry:
        return Entry(value.to_bytes(size, "little"), lambda _: True)

    return {
        epson.DEVICE_NAME: Entry(product.encode("ascii")),
        epson.HARDWARE: Entry(b"AC10"),
        epson.SOFTWARE: Entry(b"1.00"),
        epson.SERIAL: Entry(serial_number.to_bytes(4, "little")),
        epson.SYNC_COB: number(epson.SYNC, 4, epson.SYNC, epson.SYNC_PRODUCER | epson.SYNC),
        epson.SYNC_PERIOD: any_number(0, 4),
        epson.HEARTBEAT: any_number(0, 2),
        epson.TPDO1_COB: any_number(epson.COB_NO_RTR | epson.TPDO1 + node, 4),
        epson.TPDO2_COB: any_number(epson.COB_NO_RTR | epson.TPDO2 + node, 4),
        epson.TRANSMISSION: number(epson.BY_SYNC, 1, epson.BY_SYNC, epson.BY_TIMER),
        epson.PERIOD: number(2, 4, *epson.RATES.values()),
        epson.FILTER: number(9, 1, *TAPS),
        epson.APPLY: number(epson.APPLIED, 1, epson.APPLY_NOW),
    }

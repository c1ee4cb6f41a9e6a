"""Driver of sensors on a CAN bus that send unprompted, described by a DBC file."""

import time
from collections.abc import Sequence

import numpy as np

from daq.drivers.base import DbcAddress, Scans, positive_rate
from daq.drivers.can.bus import Chunk
from daq.drivers.can.dbc_file import read_layout
from daq.drivers.can.hub import GATHER_SECONDS, Member, join_bus, leave_bus
from daq.errors import DeviceLost, DriverError
from daq.protocol.can_scan import DecodedScans, ScanDecoder, what_is_missing
from daq.protocol.frames import NO_FRAMES, NUMBER, concatenate
from daq.types import DeviceIdentity

_READ_SECONDS = 0.1
_MIN_SECONDS, _SCANS = 1.0, 10  # of silence until a device counts as absent: a second, or so many scans


class CanDbc:
    """Driver of one sensor that sends unprompted, at the rate of the settings.

    Parameters
    ----------
    address : bus, and signals in the DBC file
    rate : scans per second [Hz]

    Raises
    ------
    ValueError
        If the rate is not positive.
    DbcError
        If the file cannot be used.
    """

    def __init__(self, address: DbcAddress, rate: float) -> None:
        self._address, self._layout = address, read_layout(address.sensor)
        self.scale, self.modulus = self._layout.scale, self._layout.modulus
        self._patience = max(_MIN_SECONDS, _SCANS / positive_rate(rate, address))
        self._member: Member | None = None
        self._decoder = ScanDecoder(self._layout)

    def open(self) -> DeviceIdentity:
        """Join the bus and wait for a scan; such a sensor cannot be identified."""
        self._member = join_bus(self._address, self._layout.all_identifiers)
        self._decoder = ScanDecoder(self._layout)
        try:
            self._wait_for_scan(self._member)
        except DriverError:
            self.close()
            raise
        frames = [f"{message.name} {message.identifier & NUMBER:#x}" for message in self._layout.messages]
        return DeviceIdentity(product=self._address.sensor.file.stem, details={"messages": ", ".join(frames)})

    def _wait_for_scan(self, member: Member) -> None:
        received = [NO_FRAMES]
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            chunks = member.take(_READ_SECONDS)
            received += [chunk.frames for chunk in chunks]
            if len(self._decoded(chunks).counts):
                return
        why = what_is_missing(self._layout, concatenate(received))
        raise DriverError(str(self._address), f"no scan within {self._patience:g} s: {why}")

    def _decoded(self, chunks: Sequence[Chunk]) -> DecodedScans:
        frames = concatenate([NO_FRAMES, *(chunk.frames for chunk in chunks)])
        return self._decoder.feed(frames, np.repeat([c.arrived for c in chunks], [len(c.frames) for c in chunks]))

    def read(self) -> Scans:
        """Return the scans that have become complete; none if nothing came within 0.1 s."""
        if self._member is None:
            raise DeviceLost(str(self._address), "is not open")
        self._member.gather(GATHER_SECONDS)
        before = self._decoder.bad_frames
        scans = self._decoded(self._member.take(_READ_SECONDS))
        return Scans(
            counts=scans.counts,
            counter=scans.counter,
            temperature=self._decoder.temperature,
            bad_bytes=8 * (self._decoder.bad_frames - before),
            age=time.perf_counter_ns() - int(scans.arrived[-1]) if len(scans.arrived) else 0,
        )

    def close(self) -> None:
        """Leave the bus; the sensor continues to send."""
        member, self._member = self._member, None
        if member is not None:
            leave_bus(member)

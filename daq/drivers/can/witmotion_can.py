"""WitMotion WT901 on a CAN bus: low grade, because it has no counter."""

import time

import numpy as np

from daq.drivers.base import CanAddress, Scans, known_rate
from daq.drivers.can.bus import bus_reason
from daq.drivers.can.hub import Member, join_bus, leave_bus
from daq.errors import DeviceLost, DriverError
from daq.protocol import witmotion as wit
from daq.protocol.can_library import can
from daq.protocol.frames import concatenate
from daq.types import DeviceIdentity

_READ_SECONDS = 0.1
_COMMAND_SECONDS = 0.01
_SETTLE_SECONDS = 0.15  # after a setting
_ANSWER_SECONDS = 1.0  # at ten scans per second ten of them


class WitmotionCan:
    """Driver of one device, configured to send accelerations only.

    Parameters
    ----------
    address : bus, and as `node` the identifier that the device has there, 50h as it is sold
    rate : scans per second, one of 10, 20, 50, 100, 200 [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate, or is to sample on SYNC.
    """

    scale = wit.SCALE
    modulus = 1 << 16

    def __init__(self, address: CanAddress, rate: float) -> None:
        if address.sync:
            raise ValueError(f"sync of {address}: a WT901 samples by its own clock, found {address.sync!r}")
        self._address, self._rate = address, known_rate(rate, wit.RATES, address)
        self.delay = wit.filter_delay(self._rate)  #: group delay of the filter [s]
        self._member: Member | None = None
        self._number = 0  # of the next scan

    def open(self) -> DeviceIdentity:
        """Join the bus, set content, rate and filter, and wait for a scan; the device cannot be identified."""
        self._member = member = join_bus(self._address, frozenset({self._address.node}))
        try:
            for command in wit.settings(self._rate):
                member.hub.network.send_message(self._address.node, command)
                time.sleep(_COMMAND_SECONDS)
            time.sleep(_SETTLE_SECONDS)
            self._wait_for_scan(member)
        except (can.CanError, OSError, ValueError) as error:
            self.close()
            raise DriverError(str(self._address), f"no WT901 answers: {bus_reason(error)}") from error
        return DeviceIdentity(product="WT901")

    def _wait_for_scan(self, member: Member) -> None:
        """Discard data sent before the settings, and wait for later data."""
        member.take(0.0)
        end = time.monotonic() + _ANSWER_SECONDS
        while time.monotonic() < end:
            if any(len(wit.decode_frames(chunk.frames)[0]) for chunk in member.take(_READ_SECONDS)):
                return
        raise ValueError(f"no accelerations within {_ANSWER_SECONDS:g} s")

    def read(self) -> Scans:
        """Return the scans that have arrived; none if nothing came within 0.1 s."""
        if self._member is None:
            raise DeviceLost(str(self._address), "is not open")
        chunks = self._member.take(_READ_SECONDS)
        if not chunks:
            return Scans(np.empty((0, 3), np.int32), np.empty(0, np.int32), float("nan"), 0)
        counts, wrong = wit.decode_frames(concatenate([chunk.frames for chunk in chunks]))
        number = self._number + np.arange(len(counts))
        self._number += len(counts)
        return Scans(
            counts=counts,
            counter=(number % self.modulus).astype(np.int32),
            temperature=float("nan"),  # its frames have no room for it
            bad_bytes=wit.FRAME_SIZE * wrong,
            age=time.perf_counter_ns() - chunks[-1].arrived,
        )

    def close(self) -> None:
        """Leave the bus; the device continues to send."""
        member, self._member = self._member, None
        if member is not None:
            leave_bus(member)

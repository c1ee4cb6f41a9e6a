"""Datagrams of a Raspberry Shake (`DATACAST`): both directions side by side.

    {'ENZ', 1582315130.292, 3803600, 3803601, 3803597}       channel, time of the first sample [s UTC], counts

A datagram has the samples of one channel, 25 at 100 Hz. A scan needs those of the three channels of the accelerometer.

References
----------
Raspberry Shake, manual: Data producer UDP port output; technical specifications of the RS4D.
"""

import re
from dataclasses import dataclass

import numpy as np

from daq.types import FloatArray, IntArray

CHANNELS = ("ENE", "ENN", "ENZ")  #: accelerations to the east, to the north and upwards: x, y, z
RATE = 100  #: samples per second [Hz]
SAMPLES = 25  #: samples per datagram
SCALE = 1 / 3.845e5  #: m/s2 per count of a RS4D from version 6 on, within 10 %

_PACKET = re.compile(
    rb"\{[ ]?'([A-Z][A-Z0-9]{2})'[ ]?,[ ]?(\d{1,10}(?:\.\d{1,9})?)((?:[ ]?,[ ]?[+-]?\d{1,10}){1,2000})[ ]?\}"
)
_LARGEST = 2**31 - 1
_LONGEST = 65_536
_WAITING = 8  # incomplete sets of datagrams that are kept


@dataclass(frozen=True, eq=False)
class ShakeScans:
    """Complete scans in the order of the datagrams."""

    counts: IntArray  #: (n, 3) of `CHANNELS` [-]
    time: FloatArray  #: (n,) [s UTC]


def encode_packet(channel: str, time: float, counts: IntArray) -> bytes:
    """Return the datagram of counts (n,) of one channel from a time on [s UTC]."""
    return f"{{'{channel}', {time:.3f}, {', '.join(map(str, counts.tolist()))}}}".encode()


class ShakeDecoder:
    """Scans out of datagrams that may be lost, repeated, or from channels that are no accelerations."""

    def __init__(self) -> None:
        self._rest = b""
        self._sets: list[tuple[float, dict[str, IntArray], int]] = []  # time, counts by channel, bytes
        self.bad_bytes = 0  #: bytes outside complete sets, so far
        self.channels: set[str] = set()  #: all that were received

    def feed(self, data: bytes) -> ShakeScans:
        """Take the next datagrams and return the scans that are complete."""
        stream, end = self._rest + data, 0
        counts, times = [np.empty((0, 3), np.int32)], [np.empty(0)]
        for found in _PACKET.finditer(stream):
            self.bad_bytes += found.start() - end
            end = found.end()
            if complete := self._take(found):
                time, scan = complete
                counts.append(scan)
                times.append(time + np.arange(len(scan)) / RATE)
        self._rest = stream[end:]
        if len(self._rest) > _LONGEST:
            self.bad_bytes += len(self._rest)
            self._rest = b""
        return ShakeScans(np.concatenate(counts), np.concatenate(times))

    def _take(self, found: re.Match[bytes]) -> tuple[float, IntArray] | None:
        """Take a datagram; return time and counts (n, 3) of the set that it completes."""
        channel, time, size = found[1].decode(), float(found[2]), len(found[0])
        self.channels.add(channel)
        if channel not in CHANNELS:
            return None
        values = np.array([int(number) for number in found[3].split(b",")[1:]])
        if np.abs(values).max() > _LARGEST:
            self.bad_bytes += size
            return None
        place = next((k for k, (start, *_) in enumerate(self._sets) if abs(start - time) < 0.5 / RATE), None)
        if place is None:
            self._sets.append((time, {channel: values.astype(np.int32)}, size))
            if len(self._sets) > _WAITING:
                self.bad_bytes += self._sets.pop(0)[2]
            return None
        start, parts, before = self._sets[place]
        parts[channel] = values.astype(np.int32)
        self._sets[place] = start, parts, before + size
        if len(parts) < len(CHANNELS):
            return None
        del self._sets[place]
        if len({len(part) for part in parts.values()}) > 1:
            self.bad_bytes += before + size
            return None
        return start, np.stack([parts[name] for name in CHANNELS], axis=1)

"""Wire format of WitMotion's WT901 and its kin: packets and commands, both directions side by side.

On a serial line a packet is 11 bytes: 55 | type | four words i16, little-endian | the low byte of the sum of all
before. Type 51 carries three accelerations, 16 g at 2^15, and the temperature in 0.01 degC; 50 to 5F are the others. On
a CAN bus it is a frame of the first 8 of these, from and to the identifier of the device. Scans have no number.

References
----------
WitMotion, WT901 datasheet v20-0702, sections 5.1 and 5.2.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq.protocol.frames import CanFrames
from daq.protocol.overlap import without_overlap
from daq.types import IntArray

PACKET_SIZE, FRAME_SIZE = 11, 8  #: bytes on a serial line, on a CAN bus
SCALE = 16 * 9.80665 / 2**15  #: m/s2 per count
HEADER, FIRST_TYPE, ACCELERATION = 0x55, 0x50, 0x51
N_TYPES = 16
CONTENT, RATE, BANDWIDTH = 0x02, 0x03, 0x1F  #: registers
ONLY_ACCELERATION = 1 << ACCELERATION - FIRST_TYPE  #: value of CONTENT: a bit a type
UNLOCK = bytes([0xFF, 0xAA, 0x69, 0x88, 0xB5])  #: before registers can be written
NODE, BITRATE = 0x50, 250_000  #: identifier and bit rate of a new device on a CAN bus
#: scans per second -> (RATE, BANDWIDTH: a filter that ends below half of it; the lowest is of 5 Hz)
RATES = {200: (0x0B, 2), 100: (0x09, 3), 50: (0x08, 4), 20: (0x07, 6), 10: (0x06, 6)}
#: BANDWIDTH -> delay of that filter [s], that of the chip inside (InvenSense MPU-9250, register map, ACCEL_CONFIG2)
DELAY = {1: 1.88e-3, 2: 2.88e-3, 3: 4.88e-3, 4: 8.87e-3, 5: 16.83e-3, 6: 32.48e-3}
COMMAND_SIZE = 5

_PACKET = np.dtype([("head", "u1"), ("type", "u1"), ("word", "<i2", 4), ("sum", "u1")])


def write_register(address: int, value: int) -> bytes:
    """Return the command that writes a register."""
    return bytes([0xFF, 0xAA, address, value & 0xFF, value >> 8])


def settings(rate: int) -> tuple[bytes, ...]:
    """Return the commands that make a device send accelerations only, at one of `RATES` [Hz]; each needs a moment."""
    code, bandwidth = RATES[rate]
    values = (CONTENT, ONLY_ACCELERATION), (BANDWIDTH, bandwidth), (RATE, code)
    return tuple(command for value in values for command in (UNLOCK, write_register(*value)))


def filter_delay(rate: int) -> float:
    """Return how long after the motion a scan is at one of `RATES` [s]."""
    return DELAY[RATES[rate][1]]


def encode_packets(kind: int, words: npt.NDArray[np.int16]) -> bytes:
    """Return packets of one type that carry words (n, 4)."""
    packets = np.zeros(len(words), _PACKET)
    packets["head"], packets["type"], packets["word"] = HEADER, kind, words
    raw = packets.view(np.uint8).reshape(-1, PACKET_SIZE)
    packets["sum"] = raw[:, :-1].sum(1, dtype=np.uint8)
    return packets.tobytes()


@dataclass(frozen=True, eq=False)
class WitScans:
    """Intact scans in the order of the wire."""

    counts: IntArray  #: (n, 3) [-]
    number: npt.NDArray[np.int64]  #: (n,) estimated from the length of damaged data
    temperature: npt.NDArray[np.int16]  #: (n,) [0.01 degC]


class WitDecoder:
    """Scans out of a byte stream that may begin anywhere and be damaged anywhere.

    A packet is 11 bytes with header, type and right sum; overlapping candidates are taken from the left. Scans are
    numbered by the bytes that went by: damaged bytes count as the packets that would fill them, bytes that never came
    cannot be known of.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._number = 0.0  # of the next scan
        self._types: frozenset[int] = frozenset()  # seen so far: so many packets make a scan
        self.bad_bytes = 0  #: bytes that belonged to no intact packet, so far

    def feed(self, data: bytes) -> WitScans:
        """Take the next bytes and return the scans that are complete."""
        stream = np.frombuffer(self._rest + data, np.uint8)
        starts = _packet_starts(stream)
        end = int(starts[-1]) + PACKET_SIZE if len(starts) else 0
        keep = max(end, len(stream) - (PACKET_SIZE - 1))  # a packet may still begin in the last ten bytes
        raw = stream[starts[:, None] + np.arange(PACKET_SIZE)]
        packets = np.ascontiguousarray(raw).view(_PACKET)[:, 0]
        number = self._numbers(packets["type"], starts, keep)
        self._rest = stream[keep:].tobytes()
        scans = packets[packets["type"] == ACCELERATION]
        return WitScans(scans["word"][:, :3].astype(np.int32), number, scans["word"][:, 3].astype(np.int16))

    def _numbers(self, types: npt.NDArray[np.uint8], starts: npt.NDArray[np.intp], keep: int) -> npt.NDArray[np.int64]:
        """Return the numbers of the scans among packets (n,) of which the first `keep` bytes are done with."""
        self._types |= frozenset(types.tolist())
        is_scan = types == ACCELERATION
        lost = (np.diff(starts, prepend=-PACKET_SIZE) - PACKET_SIZE) / (PACKET_SIZE * max(1, len(self._types)))
        number = np.rint(self._number + np.cumsum(is_scan) - is_scan + np.cumsum(lost)).astype(np.int64)
        damaged = keep - PACKET_SIZE * len(starts)
        self.bad_bytes += damaged
        self._number += int(is_scan.sum()) + damaged / (PACKET_SIZE * max(1, len(self._types)))
        return np.asarray(number[is_scan])


def encode_frames(node: int, kind: int, words: npt.NDArray[np.int16]) -> CanFrames:
    """Return CAN frames of one type that carry the first three of words (n, 4)."""
    packets = np.frombuffer(encode_packets(kind, words), np.uint8).reshape(-1, PACKET_SIZE)
    n = len(packets)
    return CanFrames(np.full(n, node, np.uint32), np.full(n, FRAME_SIZE, np.uint8), packets[:, :FRAME_SIZE].copy())


def decode_frames(frames: CanFrames) -> tuple[IntArray, int]:
    """Return counts (n, 3) of the scans among a device's frames, and how many frames are no packets at all."""
    packets = (frames.dlc == FRAME_SIZE) & (frames.data[:, 0] == HEADER) & (frames.data[:, 1] - FIRST_TYPE < N_TYPES)
    scans = packets & (frames.data[:, 1] == ACCELERATION)
    words = np.ascontiguousarray(frames.data[scans, 2:]).view("<i2")
    return words.astype(np.int32), int(np.count_nonzero(~packets))


def _packet_starts(stream: npt.NDArray[np.uint8]) -> npt.NDArray[np.intp]:
    """Return where intact packets begin, none overlapping another."""
    n = len(stream) - PACKET_SIZE + 1
    if n <= 0:
        return np.empty(0, np.intp)
    candidate = np.flatnonzero((stream[:n] == HEADER) & (stream[1 : n + 1] - FIRST_TYPE < N_TYPES))
    raw = stream[candidate[:, None] + np.arange(PACKET_SIZE)]
    good = candidate[raw[:, :-1].sum(1, dtype=np.uint8) == raw[:, -1]]
    return without_overlap(good, PACKET_SIZE)

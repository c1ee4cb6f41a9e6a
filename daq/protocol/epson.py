"""Wire format of the Epson M-A352 accelerometer (UART): registers and burst frames, both directions side by side.

A burst frame is 24 bytes, big-endian: 80 | ND u16 | TEMP i32 | X Y Z i32 | COUNT u16 | CHKSM u16 | 0D, where CHKSM is
the 16-bit sum of the words between header and checksum.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq.protocol.overlap import without_overlap
from daq.types import FloatArray, IntArray

FRAME_SIZE = 24
EPSON_SCALE = 9.80665 / 2**24  #: m/s2 per count
HEADER, DELIMITER = 0x80, 0x0D

WINDOW, MODE_CTRL, SMPL_CTRL, FILTER_CTRL, UART_CTRL = 0x7E, 0x03, 0x05, 0x06, 0x08
BURST_CTRL_LOW, BURST_CTRL_HIGH = 0x0C, 0x0D
ID, PRODUCT, VERSION, SERIAL = 0x4C, range(0x6A, 0x72, 2), 0x72, range(0x74, 0x7C, 2)
IDENTITY = 0x5345  # 'SE'
MODE_SAMPLING, MODE_CONFIG = 0x01, 0x02
BURST_ALL = 0xC703  #: ND, temperature, three axes, count, checksum
FILTER_BUSY = 1 << 5
UART_AUTO = 1
RATES = {1000: 2, 500: 3, 200: 4, 100: 5, 50: 6}  #: scans per second -> SMPL_CTRL

Bytes = npt.NDArray[np.uint8]
_FRAME = np.dtype(
    [
        ("head", "u1"),
        ("nd", ">u2"),
        ("temperature", ">i4"),
        ("xyz", ">i4", 3),
        ("count", ">u2"),
        ("sum", ">u2"),
        ("tail", "u1"),
    ]
)
_PLACES = np.array([0, *[256, 1] * 10, 0, 0, 0], np.float32)  #: weight of each byte of a frame in its checksum


def write_register(address: int, value: int) -> bytes:
    """Return the command that writes one byte."""
    return bytes([address | 0x80, value, DELIMITER])


def read_register(address: int) -> bytes:
    """Return the command that reads a 16-bit register."""
    return bytes([address, 0, DELIMITER])


def register_reply(address: int, value: int) -> bytes:
    """Return the reply to `read_register`."""
    return bytes([address, value >> 8 & 0xFF, value & 0xFF, DELIMITER])


def parse_reply(reply: bytes, address: int) -> int:
    """Return the value of a register from its answer.

    Raises
    ------
    ValueError
        If the answer is not one to this register.
    """
    if len(reply) != 4 or reply[0] != address or reply[3] != DELIMITER:
        raise ValueError(
            f"answer of register {address:#04x}: expected 4 bytes {address:02x} .. .. 0d, found {reply.hex(' ')!r}"
        )
    return reply[1] << 8 | reply[2]


def temperature_raw(celsius: float) -> int:
    """Return the TEMP field of a temperature [degC]."""
    return round((34.987 - celsius) / 0.0037918)


def temperature_celsius(raw: npt.NDArray[np.int32] | int) -> FloatArray:
    """Return temperatures [degC] from TEMP fields: T = -0.0037918 n + 34.987."""
    return np.asarray(-0.0037918 * np.asarray(raw, float) + 34.987)


def encode_frames(counts: IntArray, first_count: int, temperature: int) -> bytes:
    """Return burst frames of scans (n, 3) numbered from `first_count` on."""
    frames = np.zeros(len(counts), _FRAME)
    frames["head"], frames["tail"] = HEADER, DELIMITER
    frames["nd"] = 0xF000  # all three axes and the temperature are new
    frames["temperature"] = temperature
    frames["xyz"] = counts
    frames["count"] = (first_count + np.arange(len(counts))) & 0xFFFF
    raw = frames.view(np.uint8).reshape(-1, FRAME_SIZE)
    frames["sum"] = _sums(raw)
    return frames.tobytes()


def _sums(raw: Bytes) -> npt.NDArray[np.uint16]:
    """Return the 16-bit sums of the words between header and checksum of frames (n, 24).

    A product with a vector is the fastest way to sum rows, and exact: less than 2^20 of the 2^24 of a float32.
    """
    return (raw.astype(np.float32) @ _PLACES).astype(np.uint32).astype(np.uint16)


@dataclass(frozen=True, eq=False)
class Frames:
    """Intact frames in the order of the wire."""

    counts: IntArray  #: (n, 3) [-]
    counter: npt.NDArray[np.uint16]  #: (n,) [-]
    temperature: IntArray  #: (n,) raw


class BurstDecoder:
    """Frames out of a byte stream that may begin anywhere and be damaged anywhere.

    Every intact frame is found: a frame is 24 bytes with header, delimiter and right checksum; overlapping candidates
    (a frame seen inside two others' bytes) are taken from the left.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.bad_bytes = 0  #: bytes that belonged to no intact frame, so far

    def feed(self, data: bytes) -> Frames:
        """Take the next bytes and return the frames that are complete."""
        stream = np.frombuffer(self._rest + data, np.uint8)
        raw, end = _whole_frames(stream)
        keep = max(end, len(stream) - (FRAME_SIZE - 1))  # a frame may still begin in the last 23 bytes
        self.bad_bytes += keep - raw.size
        self._rest = stream[keep:].tobytes()
        frames = raw.view(_FRAME)[:, 0]
        return Frames(
            frames["xyz"].astype(np.int32), frames["count"].astype(np.uint16), frames["temperature"].astype(np.int32)
        )


def _whole_frames(stream: Bytes) -> tuple[Bytes, int]:
    """Return intact frames (n, 24), none overlapping another, and where the last one ends."""
    n = len(stream) // FRAME_SIZE
    raw = stream[: n * FRAME_SIZE].reshape(n, FRAME_SIZE)
    if _intact(raw).all():  # one behind the other from the first byte on: nothing to search
        return raw, n * FRAME_SIZE
    last = len(stream) - FRAME_SIZE
    candidate = np.flatnonzero((stream[: last + 1] == HEADER) & (stream[FRAME_SIZE - 1 :] == DELIMITER))
    raw = stream[candidate[:, None] + np.arange(FRAME_SIZE)]
    starts = without_overlap(candidate[_intact(raw)], FRAME_SIZE)
    return stream[starts[:, None] + np.arange(FRAME_SIZE)], int(starts[-1]) + FRAME_SIZE if len(starts) else 0


def _intact(raw: Bytes) -> npt.NDArray[np.bool_]:
    """Return for rows (n, 24) whether header, delimiter and checksum are right."""
    stated = raw[:, 21].astype(np.uint16) << 8 | raw[:, 22]
    return np.asarray((raw[:, 0] == HEADER) & (raw[:, -1] == DELIMITER) & (_sums(raw) == stated))

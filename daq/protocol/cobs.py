"""Frames on a serial line: stuffed so that no byte in them is zero, ended by a zero, guarded by a CRC; by the block.

Consistent overhead byte stuffing (COBS): a leading byte gives the distance to the first zero, and each zero is replaced
by the distance to the next one, with the end of the frame as the last. A zero on the line is therefore always the end
of a frame, and a receiver is synchronized again at the next zero. Frames here are shorter than 254 bytes, where
stuffing adds exactly one byte; all of one block have the same length.

References
----------
S. Cheshire, M. Baker, Consistent overhead byte stuffing, IEEE/ACM Transactions on Networking 7 (1999) 159-172.
"""

from binascii import crc_hqx
from functools import lru_cache

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]

LONGEST = 253  #: bytes of a frame before stuffing, its CRC included
CRC_SIZE = 2
_CRC_START = 0xFFFF


def seal(content: Bytes) -> bytes:
    """Return the transmitted bytes of contents (n, m) without CRC: CRC appended, stuffed, each ended by a zero."""
    n, m = content.shape
    whole = np.empty((n, m + CRC_SIZE), np.uint8)
    whole[:, :m] = content
    whole[:, m:] = crc16(content).astype("<u2")[:, None].view(np.uint8)
    line = np.zeros((n, m + CRC_SIZE + 2), np.uint8)
    line[:, :-1] = stuffed(whole)
    return line.tobytes()


def unseal(segments: Bytes) -> tuple[Bytes, npt.NDArray[np.bool_]]:
    """Return contents (n, m) without CRC of frames (n, m + 3), and which of them (n,) are intact."""
    whole, good = unstuffed(segments)
    content, stated = whole[:, :-CRC_SIZE], np.ascontiguousarray(whole[:, -CRC_SIZE:]).view("<u2")[:, 0]
    return content, np.asarray(good & (crc16(content) == stated))


def stuffed(frames: Bytes) -> Bytes:
    """Return frames (n, m) as (n, m + 1) bytes of which none is zero.

    Raises
    ------
    ValueError
        If they are longer than `LONGEST`.
    """
    n, m = frames.shape
    if m > LONGEST:
        raise ValueError(f"frame: expected at most {LONGEST} bytes, found {m}")
    line = np.zeros((n, m + 2), np.uint8)  # as if a zero preceded and followed
    line[:, 1:-1] = frames
    place = np.where(line == 0, np.arange(m + 2), m + 1)
    following = np.minimum.accumulate(place[:, :0:-1], axis=1)[:, ::-1]  # where the next zero is, seen from each byte
    return np.asarray(np.where(line[:, :-1] == 0, following - np.arange(m + 1), line[:, :-1]), np.uint8)


def unstuffed(segments: Bytes) -> tuple[Bytes, npt.NDArray[np.bool_]]:
    """Return frames (n, m) from (n, m + 1) bytes without a zero, and which of them (n,) end where they should."""
    n, width = segments.shape
    flat = np.zeros(n * (width + 1) + 255, np.uint8)  # room for the last one's code to point beyond its end
    rows = flat[:-255].reshape(n, width + 1)
    rows[:, :-1] = segments
    at = begin = np.arange(0, n * (width + 1), width + 1)
    codes = [at]
    while np.count_nonzero(code := flat.take(at)):  # of one that is at an end it is the zero behind
        at = at + code
        codes.append(at)
    good = at - begin == width
    if not good.all():
        codes = [places[good] for places in codes]
    flat[np.concatenate(codes)] = 0
    return rows[:, 1:-1], good


def crc16(content: Bytes) -> npt.NDArray[np.uint16]:
    """Return CRC-16/CCITT (polynomial 0x1021, start 0xFFFF, most significant bit first) of contents (n, m).

    The CRC is linear over bits: the sum of the contributions of all bytes at their positions.
    """
    table, places, start = _crc_table(content.shape[1])
    return np.asarray(np.bitwise_xor.reduce(table.take(content.T + places), axis=0) ^ start, np.uint16)


@lru_cache(maxsize=16)
def _crc_table(m: int) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.intp], np.uint16]:
    """Return the contribution of each byte value at each position (m * 256,), offsets (m, 1), and the CRC of zeros."""
    table = [[crc_hqx(bytes([value]) + bytes(m - 1 - place), 0) for value in range(256)] for place in range(m)]
    places = 256 * np.arange(m)[:, None]
    return np.array(table, np.uint16).reshape(m * 256), places, np.uint16(crc_hqx(bytes(m), _CRC_START))

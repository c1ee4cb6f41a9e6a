"""Epson M-A552AC1x accelerometer (CANopen): objects, and scans in two process data frames, both ways side by side.

TPDO1 (0x180 + node) carries Ax Ay, TPDO2 (0x280 + node) Az and the sample counter; little-endian, 2^-24 g a count.
"""

import numpy as np
import numpy.typing as npt

from daq.protocol.frames import NO_FRAMES, CanFrames, concatenate
from daq.types import IndexArray, IntArray

SCALE = 9.80665 / 2**24  #: m/s2 per count
MODULUS = 1 << 16  #: values of the sample counter
TPDO1, TPDO2 = 0x180, 0x280  #: plus the node's id
TPDO1_SIZE, TPDO2_SIZE = 8, 6

SYNC = 0x080  #: identifier of the frame on which nodes sample
SYNC_COB = 0x1005, 0  #: the same, with the bit SYNC_PRODUCER
SYNC_PRODUCER = 1 << 30
SYNC_PERIOD = 0x1006, 0  #: us
HEARTBEAT = 0x1017, 0  #: ms, 0 = none
DEVICE_NAME, HARDWARE, SOFTWARE = (0x1008, 0), (0x1009, 0), (0x100A, 0)
SERIAL = 0x1018, 4
TPDO1_COB, TPDO2_COB = (0x1800, 1), (0x1801, 1)  #: id of the frame, with the bits below
COB_OFF, COB_NO_RTR = 1 << 31, 1 << 30
TRANSMISSION = 0x1800, 2  #: entry of TPDO1; the others follow it
BY_SYNC, BY_TIMER = 1, 0xFE
PERIOD = 0x2001, 0  #: ms
APPLY = 0x2005, 0
APPLY_NOW, APPLIED = 0x11, 0x10
FILTER = 0x61A1, 1
TEMPERATURE = 0x9130, 4  #: counts as the M-A352's; three subindices before it are the accelerations
RATES = {1000: 1, 500: 2, 200: 5, 100: 10, 50: 20}  #: scans per second -> ms
_KEPT = 4096  # frames remembered while no TPDO2 comes


def encode_scans(node: int, counts: IntArray, first_count: int) -> CanFrames:
    """Return the frames of scans (n, 3) numbered from `first_count` on: TPDO1, TPDO2, TPDO1, ..."""
    n = len(counts)
    words = np.zeros((n, 2, 2), "<i4")
    words[:, 0], words[:, 1, 0] = counts[:, :2], counts[:, 2]
    data = words.view(np.uint8).reshape(n, 2, 8)
    data[:, 1, 4:6] = ((first_count + np.arange(n)) % MODULUS).astype("<u2").view(np.uint8).reshape(n, 2)
    return CanFrames(
        np.tile(np.array([TPDO1 + node, TPDO2 + node], np.uint32), n),
        np.tile(np.array([TPDO1_SIZE, TPDO2_SIZE], np.uint8), n),
        data.reshape(2 * n, 8),
    )


class ScanDecoder:
    """Scans out of one node's frames, of which any may be lost.

    Only TPDO2 has a number. A TPDO1 before it belongs to the same scan only if, since the last TPDO2, the number of
    TPDO1 equals the increment of the counter. A lost frame thus costs its own scan; a completely lost scan also costs
    the next one; halves of two scans are never combined. A repeated frame (ISO 11898-1: the sender detected an error in
    the last bit) counts once.

    Parameters
    ----------
    node : its id
    """

    def __init__(self, node: int) -> None:
        self._ids = TPDO1 + node, TPDO2 + node
        self._rest, self._rest_syncs = NO_FRAMES, np.empty(0, np.intp)
        self.bad_frames = 0  #: frames that are part of no scan, so far

    def feed(self, frames: CanFrames) -> tuple[IntArray, IntArray]:
        """Take the next frames; return counts (n, 3) and counter (n,) of the scans that are complete.

        The first scan is never among them, because its halves cannot be verified.
        """
        return self.feed_synced(frames, np.zeros(len(frames), np.intp))[:2]

    def feed_synced(self, frames: CanFrames, syncs: IndexArray) -> tuple[IntArray, IntArray, IndexArray]:
        """Take frames and, of each, how many SYNC came before it (n,); return that of the scans' TPDO1 as well."""
        first = (frames.ids == self._ids[0]) & (frames.dlc == TPDO1_SIZE)
        second = (frames.ids == self._ids[1]) & (frames.dlc == TPDO2_SIZE)
        joined = concatenate([self._rest, frames[first | second]])
        syncs = np.concatenate([self._rest_syncs, syncs[first | second]])
        same = (joined.ids[1:] == joined.ids[:-1]) & (joined.data[1:] == joined.data[:-1]).all(1)
        once = np.append(np.ones(min(1, len(joined)), bool), ~same)
        joined, syncs = joined[once], syncs[once]
        ends = np.flatnonzero(joined.ids == self._ids[1])
        keep = max(0, len(joined) - _KEPT) if not len(ends) else int(ends[-1])
        self._rest, self._rest_syncs = joined[keep:], syncs[keep:]
        if not len(ends):
            return np.empty((0, 3), np.int32), np.empty(0, np.int32), np.empty(0, np.intp)
        counter = joined.data[ends, 4:6].copy().view("<u2")[:, 0].astype(np.int32)
        halves = np.diff(ends) - 1
        whole = np.flatnonzero((halves > 0) & (halves == np.diff(counter) % MODULUS)) + 1
        self.bad_frames += int(ends[-1] - ends[0]) - 2 * len(whole)
        return _counts(joined.data, ends[whole]), counter[whole], syncs[ends[whole] - 1]


def _counts(data: npt.NDArray[np.uint8], ends: npt.NDArray[np.intp]) -> IntArray:
    """Return counts (n, 3) of scans with TPDO2 at `ends`."""
    pairs = np.concatenate([data[ends - 1], data[ends, :4]], axis=1)
    return np.ascontiguousarray(pairs).view("<i4").astype(np.int32)

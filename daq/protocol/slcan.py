r"""SLCAN (Lawicel, CANable): CAN frames as lines of text on a serial port, both directions side by side.

A line ends with CR, or with BEL if the adapter refuses a command. `tiiil` with up to 16 hex digits is a frame of 11
bits, `Tiiiiiiiil..` one of 29 bits; `r` and `R` are remote frames without data. There is no checksum: a line is valid
if its kind, length and digits agree; a line that lost or gained a byte is dropped alone. Replies of the adapter to
commands (`z`, `Z`, `V1013`, `N0042`, `F00`, empty lines) are neither frames nor damage. CAN FD and time stamps are not
supported.
"""

import numpy as np
import numpy.typing as npt

from daq.protocol.frames import EXTENDED, NUMBER, REMOTE, CanFrames

END, REFUSED = 0x0D, 0x07  # CR, BEL
OPEN, CLOSE, NO_STAMPS = b"O\r", b"C\r", b"Z0\r"
#: bit/s -> command that sets it
BITRATES = {
    10_000: b"S0\r",
    20_000: b"S1\r",
    50_000: b"S2\r",
    100_000: b"S3\r",
    125_000: b"S4\r",
    250_000: b"S5\r",
    500_000: b"S6\r",
    800_000: b"S7\r",
    1_000_000: b"S8\r",
}
_LONGEST = 26  # T, 8 digits, length, 16 digits
_KINDS = np.frombuffer(b"trTR", np.uint8)
_ANSWERS = np.frombuffer(b"zZVNF", np.uint8)
_DIGITS = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_SHIFTS = np.arange(28, -4, -4).astype(np.uint32)
_VALUE = np.full(256, 255, np.uint8)  # of a hex digit; 255: is none
_VALUE[_DIGITS] = np.arange(16)
_VALUE[np.frombuffer(b"abcdef", np.uint8)] = np.arange(10, 16)

# constants of every read, made once because reads are small and many
_FIRST, _PADDING = np.zeros(1, np.intp), np.zeros(_LONGEST, np.uint8)
_COLUMNS, _DATA_COLUMNS = np.arange(_LONGEST), np.arange(16)
_WEIGHTS = (16 ** np.arange(8)[::-1]).astype(np.uint32)

Bytes = npt.NDArray[np.uint8]


def encode(frames: CanFrames) -> bytes:
    """Return the lines that carry frames."""
    n = len(frames)
    extended, remote = (frames.ids & EXTENDED) != 0, (frames.ids & REMOTE) != 0
    text, used = np.empty((n, _LONGEST + 1), np.uint8), np.ones((n, _LONGEST + 1), bool)
    text[:, 0] = _KINDS[2 * extended + remote]
    text[:, 1:9] = _DIGITS[(frames.ids & NUMBER)[:, None] >> _SHIFTS & 15]
    used[:, 1:6] = extended[:, None]
    text[:, 9] = _DIGITS[frames.dlc]
    text[:, 10:26:2], text[:, 11:26:2] = _DIGITS[frames.data >> 4], _DIGITS[frames.data & 15]
    used[:, 10:26] = np.arange(16) < np.where(remote, 0, 2 * frames.dlc)[:, None]
    text[:, 26] = END
    return text[used].tobytes()


class SlcanDecoder:
    """Frames out of a byte stream that may begin anywhere and be damaged anywhere; cut into chunks as it may be."""

    def __init__(self) -> None:
        self._rest = b""
        self.bad_lines = 0  #: neither a frame nor an answer, so far

    def feed(self, data: bytes) -> CanFrames:
        """Take the next bytes and return the frames that are complete."""
        stream = np.frombuffer(self._rest + data, np.uint8)
        ends = np.flatnonzero((stream == END) | (stream == REFUSED))
        starts = np.concatenate([_FIRST, ends + 1])
        # of a line without end, the part that shows its kind, and that it is too long, is kept
        self._rest = stream[starts[-1] : starts[-1] + _LONGEST + 1].tobytes()
        length = ends - starts[:-1]
        lines = np.flatnonzero(length > 0)
        return self._frames(stream, starts[lines], length[lines])

    def _frames(self, stream: Bytes, starts: npt.NDArray[np.intp], length: npt.NDArray[np.intp]) -> CanFrames:
        padded = np.concatenate([stream, _PADDING])
        text = padded[starts[:, None] + _COLUMNS]
        kind = text[:, 0]
        ids, dlc = np.zeros(len(text), np.uint32), np.zeros(len(text), np.uint8)
        data, good = np.zeros((len(text), 8), np.uint8), np.zeros(len(text), bool)
        for n_digits, (plain, remote) in ((3, _KINDS[:2]), (8, _KINDS[2:])):
            rows = np.flatnonzero((kind == plain) | (kind == remote))
            if len(rows):
                found = _parse(_VALUE[text[rows, 1:]], kind[rows] == remote, length[rows], n_digits)
                ids[rows], dlc[rows], data[rows], good[rows] = found
        if good.all():
            return CanFrames(ids, dlc, data)
        self.bad_lines += int(np.count_nonzero(~np.isin(kind[~good], _ANSWERS)))
        return CanFrames(ids[good], dlc[good], data[good])


def _parse(
    value: Bytes, remote: npt.NDArray[np.bool_], length: npt.NDArray[np.intp], n_digits: int
) -> tuple[npt.NDArray[np.uint32], Bytes, Bytes, npt.NDArray[np.bool_]]:
    """Return ids, lengths, data, and validity of lines (n, 25) given as values of their digits."""
    size = value[:, n_digits]
    n_data = np.where(remote, 0, 2 * size.astype(np.intp))
    used = n_data[:, None] > _DATA_COLUMNS
    digits = value[:, n_digits + 1 : n_digits + 17]
    good = (size <= 8) & (length == 2 + n_digits + n_data) & (value[:, :n_digits] < 16).all(1)
    good &= ((digits < 16) | ~used).all(1)
    digits = np.where(used, digits, 0).astype(np.uint8)
    ids = np.asarray(value[:, :n_digits] @ _WEIGHTS[-n_digits:], np.uint32)
    good &= ids <= (0x7FF if n_digits == 3 else NUMBER)
    ids |= np.where(remote, REMOTE, 0).astype(np.uint32) | np.uint32(0 if n_digits == 3 else EXTENDED)
    return ids, size, np.asarray(digits[:, ::2] << 4 | digits[:, 1::2], np.uint8), np.asarray(good)

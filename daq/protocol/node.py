"""Wire format of home-built nodes (`modalwatch-node`): frames of both directions side by side.

A frame is stuffed by COBS, ended by a zero and guarded by CRC-16/CCITT (`daq.protocol.cobs`); little-endian, packed:

    scan   01 | counter u32 | device's clock u32 [us] | X Y Z i32 [counts] | temperature i16 [0.01 degC]
    hello  02 | version u8 | product 12 | serial 12 (ASCII) | axes u8 | scale f32 [m/s2 per count] | rate u32 [mHz]
    who    81                the host asks for a hello
    start  82 | rate u32 [mHz]   the host asks for scans; a node that has another rate says so in its hello
    stop   83

docs/howto/rig/node.md has the node's side.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from daq.protocol import cobs
from daq.types import IntArray

VERSION = 1
SCAN, HELLO, WHO, START, STOP = 0x01, 0x02, 0x81, 0x82, 0x83
NO_TEMPERATURE = -(1 << 15)  #: temperature of a node without a sensor
_SCAN = np.dtype([("type", "u1"), ("counter", "<u4"), ("time", "<u4"), ("xyz", "<i4", 3), ("temperature", "<i2")])
_HELLO = np.dtype(
    [
        ("type", "u1"),
        ("version", "u1"),
        ("product", "S12"),
        ("serial", "S12"),
        ("axes", "u1"),
        ("scale", "<f4"),
        ("rate", "<u4"),
    ]
)
_COMMAND = np.dtype([("type", "u1"), ("rate", "<u4")])
_STUFFING = cobs.CRC_SIZE + 1
SCAN_SIZE = _SCAN.itemsize + _STUFFING + 1  #: bytes on the line, the zero included
_FROM_THE_START = np.zeros(1, np.intp)
_LONGEST = _HELLO.itemsize + _STUFFING


@dataclass(frozen=True, kw_only=True)
class Hello:
    """Identity of a node."""

    product: str  #: product, at most 12 characters of ASCII
    serial: str  #: serial number, at most 12 characters of ASCII
    axes: tuple[int, ...]  #: measured axes, of 0, 1, 2; the others are zero in every scan
    scale: float  #: m/s2 per count
    rate: float  #: scans per second [Hz]
    version: int = VERSION  #: version of this protocol


@dataclass(frozen=True, eq=False)
class NodeScans:
    """Intact scans in the order of the wire."""

    counts: IntArray  #: (n, 3) [-]
    counter: npt.NDArray[np.uint32]  #: (n,) [-]
    time: npt.NDArray[np.uint32]  #: (n,) of the device's clock [us]
    temperature: npt.NDArray[np.int16]  #: (n,) [0.01 degC], or NO_TEMPERATURE

    def __getitem__(self, which: npt.NDArray[np.bool_] | slice) -> "NodeScans":
        """Return some of the scans."""
        return NodeScans(self.counts[which], self.counter[which], self.time[which], self.temperature[which])


NO_SCANS = NodeScans(np.empty((0, 3), np.int32), np.empty(0, np.uint32), np.empty(0, np.uint32), np.empty(0, np.int16))


def joined(before: NodeScans, after: NodeScans) -> NodeScans:
    """Return scans, one after another."""
    names = ("counts", "counter", "time", "temperature")
    return NodeScans(*(np.concatenate([getattr(before, name), getattr(after, name)]) for name in names))


def encode_scans(scans: NodeScans) -> bytes:
    """Return the frames of scans."""
    frames = np.zeros(len(scans.counts), _SCAN)
    frames["type"], frames["xyz"] = SCAN, scans.counts
    frames["counter"], frames["time"], frames["temperature"] = scans.counter, scans.time, scans.temperature
    return cobs.seal(frames.view(np.uint8).reshape(-1, _SCAN.itemsize))


def encode_hello(hello: Hello) -> bytes:
    """Return the hello frame of a node."""
    frame = np.zeros(1, _HELLO)
    axes, rate = sum(1 << axis for axis in hello.axes), round(1000 * hello.rate)
    frame[0] = (HELLO, hello.version, hello.product.encode(), hello.serial.encode(), axes, hello.scale, rate)
    return cobs.seal(frame.view(np.uint8).reshape(1, -1))


def encode_command(command: int, rate: float | None = None) -> bytes:
    """Return the frame of WHO, STOP, or START with a rate [Hz]."""
    if rate is None:
        return cobs.seal(np.array([[command]], np.uint8))
    return cobs.seal(np.array([(command, round(1000 * rate))], _COMMAND).view(np.uint8).reshape(1, -1))


class NodeDecoder:
    """Decoder of a node's messages from a byte stream that may begin anywhere and be damaged anywhere."""

    def __init__(self) -> None:
        self._rest = b""
        self.bad_bytes = 0  #: bytes outside intact frames, so far
        self.hello: Hello | None = None  #: the last one, if any

    def feed(self, data: bytes) -> NodeScans:
        """Take the next bytes and return the scans that are complete."""
        stream = np.frombuffer(self._rest + data, np.uint8)
        ends = np.flatnonzero(stream == 0)
        starts = np.concatenate([_FROM_THE_START, ends + 1])
        length = ends - starts[:-1]
        keep = max(int(starts[-1]), len(stream) - _LONGEST - 1)  # sufficient to detect that a frame is too long
        self._rest = stream[keep:].tobytes()
        self.bad_bytes += keep - int(np.count_nonzero(length == 0))  # zeros alone are not counted
        hellos = self._intact(stream, starts[:-1][length == _HELLO.itemsize + _STUFFING], _HELLO, HELLO)
        scans = self._intact(stream, starts[:-1][length == _SCAN.itemsize + _STUFFING], _SCAN, SCAN)
        if len(hellos):
            self.hello = _hello(hellos[-1])
        return NodeScans(
            scans["xyz"].astype(np.int32),
            scans["counter"].astype(np.uint32),
            scans["time"].astype(np.uint32),
            scans["temperature"].astype(np.int16),
        )

    def _intact(
        self, stream: cobs.Bytes, begin: npt.NDArray[np.intp], layout: np.dtype[np.void], kind: int
    ) -> npt.NDArray[np.void]:
        """Return the intact frames of one type among those that are as long as it."""
        if not len(begin):
            return np.empty(0, layout)
        size = layout.itemsize + _STUFFING
        if begin[-1] - begin[0] == (len(begin) - 1) * (size + 1):  # one behind the other: nothing to gather
            segments = stream[begin[0] : begin[-1] + size + 1].reshape(-1, size + 1)[:, :-1]
        else:
            segments = stream.take(begin[:, None] + np.arange(size))
        content, good = cobs.unseal(segments)
        good &= content[:, 0] == kind
        found = np.ascontiguousarray(content if good.all() else content[good])
        self.bad_bytes -= len(found) * (size + 1)
        return found.view(layout)[:, 0]


def _hello(row: np.void) -> Hello:
    return Hello(
        product=bytes(row["product"]).decode("ascii", "replace"),
        serial=bytes(row["serial"]).decode("ascii", "replace"),
        axes=tuple(axis for axis in range(3) if int(row["axes"]) >> axis & 1),
        scale=float(row["scale"]),
        rate=int(row["rate"]) / 1000,
        version=int(row["version"]),
    )


class CommandDecoder:
    """Decoder of a host's commands, in their order; commands are few."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[tuple[int, float]]:
        """Take the next bytes; return (command, rate [Hz], 0 unless it is START) of those that are complete."""
        *whole, rest = (self._rest + data).split(b"\0")
        self._rest = rest[-_LONGEST:]
        found = []
        for segment in whole:
            if _STUFFING < len(segment) <= _LONGEST:
                content, good = cobs.unseal(np.frombuffer(segment, np.uint8)[None])
                if good[0]:
                    found.append(_command(content[0]))
        return found


def _command(content: cobs.Bytes) -> tuple[int, float]:
    """Return a command and its rate; one that is shorter than it should be has none."""
    if len(content) == _COMMAND.itemsize:
        return int(content[0]), int(content.view(_COMMAND)[0]["rate"]) / 1000
    return int(content[0]), 0.0

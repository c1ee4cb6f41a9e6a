"""A home-built node on a serial line: docs/howto/rig/node.md is its side of the protocol."""

import time

import numpy as np
import numpy.typing as npt

from daq.drivers.base import Found, PortAnswer, Scans, positive_rate
from daq.drivers.serial.base import PORT_ERRORS, SerialDriver, SerialPort
from daq.errors import DeviceLost, DriverError, system_reason
from daq.protocol import node
from daq.types import DeviceIdentity

BAUD = 460800  #: nodes that are USB devices themselves do not care
_HELLO_SECONDS = 1.5  # interval of the hello of a node that does not receive commands, with a margin [s]
_AGAIN_SECONDS = 0.4
_SCANS_SECONDS = 1.0
_RATE_TOLERANCE = 1e-3  # tolerance of the rate reported by a node
_CLOCK_TOLERANCE = 0.05  # of time passed: oscillators inside accelerometers are some percent off
_CLOCK_SLACK = 2000  # us: delay of the time stamp of a busy controller
_NEIGHBOURS = 10e6  # us: scans further apart are no witness for one another


class ModalwatchNode(SerialDriver[node.NodeDecoder, SerialPort]):
    """Driver of one node.

    Parameters
    ----------
    port : path of the serial port
    rate : scans per second [Hz]

    Raises
    ------
    ValueError
        If the rate is not positive.
    """

    product = "node"
    scale = float("nan")  #: [m/s2 per count], reported by the node when it is opened
    modulus = 1 << 31  #: the lower 31 bits of the counter, which an int32 holds

    def __init__(self, port: str, rate: float) -> None:
        super().__init__(port)
        self._rate = positive_rate(rate, port)
        self._decoder = node.NodeDecoder()
        self._validator = FrameValidator(rate)

    def _connect(self) -> SerialPort:
        return SerialPort(self._path, BAUD)

    def _start(self, port: SerialPort) -> DeviceIdentity:
        """Request scans; check protocol version, scale, rate and clock of the node."""
        self._decoder, self._validator = node.NodeDecoder(), FrameValidator(self._rate)
        port.discard_input()
        port.write(b"\0" + node.encode_command(node.START, self._rate))  # the zero ends an unfinished frame
        hello = self._wait_for_hello(port)
        if hello.version != node.VERSION:
            raise ValueError(f"protocol: expected version {node.VERSION}, found {hello.version}")
        if not 0 < hello.scale < np.inf or not hello.axes:
            raise ValueError(f"hello: expected a scale and an axis, found {hello}")
        if abs(hello.rate / self._rate - 1) > _RATE_TOLERANCE:
            raise ValueError(f"rate: expected {self._rate:g} Hz, found {hello.rate:g}")
        self._check_clock(port)
        self.scale = hello.scale
        details = {"axes": list(hello.axes), "scale": hello.scale}
        return DeviceIdentity(product=hello.product, serial=hello.serial, details=details)

    def identify(self) -> node.Hello:
        """Identify the node and free the port; a sampling node continues."""
        try:
            port = SerialPort(self._path, BAUD)
            try:
                port.write(b"\0" + node.encode_command(node.WHO))
                return self._wait_for_hello(port)
            finally:
                port.close()
        except (*PORT_ERRORS, ValueError) as error:
            raise DriverError(self._path, f"no node answers: {system_reason(error)}") from error

    def _wait_for_hello(self, port: SerialPort) -> node.Hello:
        """Wait for the hello; repeat the request, because output at power-on may have damaged the first reply."""
        asked = time.monotonic()
        end = asked + _HELLO_SECONDS
        while self._decoder.hello is None:
            now = time.monotonic()
            if now > end:
                raise ValueError(f"no hello within {_HELLO_SECONDS:g} s")
            if now > asked + _AGAIN_SECONDS:
                asked = now
                port.write(b"\0" + node.encode_command(node.WHO))
            self._decoder.feed(port.read())
        return self._decoder.hello

    def _check_clock(self, port: SerialPort) -> None:
        """Check the rate by the node's own clock, on which the check of scans depends."""
        scans = node.NO_SCANS
        end = time.monotonic() + _SCANS_SECONDS + 8 / self._rate
        while len(scans.counter) < 5:
            if time.monotonic() > end:
                raise ValueError("identifies itself, but sends no scans")
            scans = node.joined(scans, self._decoder.feed(port.read()))
        step, us = np.diff(scans.counter).astype(float), np.diff(scans.time).astype(float)
        found = 1e6 * float(np.median(step / np.maximum(us, 1.0)))
        if abs(found / self._rate - 1) > _CLOCK_TOLERANCE:
            raise ValueError(f"rate: expected {self._rate:g} Hz, found {found:.4g} by the node's own clock")
        self._validator.evaluate(scans)

    def _decode(self, data: bytes) -> Scans:
        found, refused = self._validator.evaluate(self._decoder.feed(data))
        if self._validator.restarted:
            raise DeviceLost(self._path, "the node has started anew")
        known = found.temperature[found.temperature != node.NO_TEMPERATURE]
        return Scans(
            counts=found.counts,
            counter=(found.counter % self.modulus).astype(np.int32),
            temperature=float(known.mean()) / 100 if len(known) else float("nan"),
            bad_bytes=refused * node.SCAN_SIZE,
        )

    def _stop(self, port: SerialPort) -> None:
        port.write(node.encode_command(node.STOP))


def search(path: str, _: int) -> PortAnswer | None:
    """Search for a node at a port."""
    try:
        hello = ModalwatchNode(path, 1.0).identify()
    except DriverError:
        return None
    identity = DeviceIdentity(product=hello.product, serial=hello.serial)
    found = Found(driver="modalwatch-node", place=path, identity=identity, rate=hello.rate, axes=hello.axes)
    return PortAnswer(who=f"{hello.product} {hello.serial}", devices=(found,))


class FrameValidator:
    """Distinguishes scans from damaged frames with a valid CRC (one in 2^16).

    Counter and clock of a node increase together. A scan is valid if it agrees with the previous or the next one. The
    last scan of a read that does not agree with the previous one is kept until the next read.

    Parameters
    ----------
    rate : scans per second [Hz]
    """

    def __init__(self, rate: float) -> None:
        self._period = 1e6 / rate
        self._last, self._waiting = node.NO_SCANS, node.NO_SCANS  # one scan at most each
        self.restarted = False  #: counter and clock of scans that agree have gone back

    def evaluate(self, scans: node.NodeScans) -> tuple[node.NodeScans, int]:
        """Evaluate the next scans; return the valid ones, and the number of refused ones."""
        known = len(self._last.counter)
        if known and not len(self._waiting.counter) and self._goes_on(scans):  # as nearly always
            self._last, self.restarted = scans[-1:], False
            return scans, 0
        joined = node.joined(
            node.joined(self._last, self._waiting) if len(self._waiting.counter) else self._last, scans
        )
        if len(joined.counter) < 2:
            self._waiting = joined[known:]
            return node.NO_SCANS, 0
        agrees = self._agree(joined)
        good = np.append(agrees, False) | np.append(False, agrees)
        good[:known] = True
        self._waiting = joined[-1:] if not good[-1] else node.NO_SCANS
        new = joined if good.all() else joined[good]
        # a later one that has both lower counter and earlier time than its neighbour
        back = (np.diff(values).view(np.int32) < 0 for values in (new.counter, new.time))
        self.restarted = bool(np.logical_and(*back).any())
        self._last = new[-1:]
        return new[known:], int(np.count_nonzero(~good)) - len(self._waiting.counter)

    def _goes_on(self, scans: node.NodeScans) -> bool:
        """Return whether scans continue the last one without a gap, by the node's clock too."""
        counter, time = (
            np.concatenate([getattr(part, name) for part in (self._last, scans)]) for name in ("counter", "time")
        )
        if len(counter) < 2 or np.count_nonzero(counter[1:] - counter[:-1] != 1):
            return False
        us = (time[1:] - time[:-1]).view(np.int32)
        slack = _CLOCK_SLACK + _CLOCK_TOLERANCE * self._period
        return bool(us.min() > self._period - slack and us.max() < self._period + slack)

    def _agree(self, scans: node.NodeScans) -> npt.NDArray[np.bool_]:
        """Return for each pair of neighbours (n - 1,), not far apart, whether counter and clock agree."""
        step, us = np.diff(scans.counter).view(np.int32), np.diff(scans.time).view(np.int32)
        expected = step * self._period
        off = np.abs(us - expected)
        return np.asarray((step > 0) & (expected < _NEIGHBOURS) & (off < _CLOCK_SLACK + _CLOCK_TOLERANCE * expected))

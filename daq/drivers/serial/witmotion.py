"""WitMotion WT901 on a serial line: low grade, because it has no counter."""

import time

import numpy as np

from daq.drivers.base import Found, PortAnswer, Scans, known_rate
from daq.drivers.serial.base import PORT_ERRORS, SerialDriver, SerialPort
from daq.errors import DeviceLost
from daq.protocol import witmotion as wit
from daq.types import DeviceIdentity

BAUDS = (115_200, 9600, 230_400, 460_800, 921_600, 57_600)  #: a device keeps the rate it was set to
_LISTEN_SECONDS = 0.35  # at each of them: at ten scans per second three packets
_COMMAND_SECONDS = 0.01
_SETTLE_SECONDS = 0.15  # after a setting
_ENOUGH = 2  # packets that make a baud rate the right one
_BITS_A_BYTE = 10


class Witmotion(SerialDriver[wit.WitDecoder, SerialPort]):
    """Driver of one device, configured to send accelerations only.

    Parameters
    ----------
    port : path of the serial port
    rate : one of 10, 20, 50, 100, 200 scans per second [Hz]

    Raises
    ------
    ValueError
        If the device has no such rate.
    """

    product = "WT901"
    scale = wit.SCALE

    def __init__(self, port: str, rate: float) -> None:
        super().__init__(port)
        self._rate = known_rate(rate, wit.RATES, port)
        self.delay = wit.filter_delay(self._rate)  #: group delay of the filter [s]
        self._decoder, self._baud = wit.WitDecoder(), 0

    def _connect(self) -> SerialPort:
        port, self._baud = listen(self._path)
        return port

    def _start(self, port: SerialPort) -> DeviceIdentity:
        most = self._baud // (_BITS_A_BYTE * wit.PACKET_SIZE)
        if self._rate > most:
            raise ValueError(f"rate: expected at most {most} Hz at {self._baud} bit/s, found {self._rate}")
        for command in wit.settings(self._rate):
            port.write(command)
            time.sleep(_COMMAND_SECONDS)
        time.sleep(_SETTLE_SECONDS)
        port.discard_input()
        self._decoder = wit.WitDecoder()
        return DeviceIdentity(product=self.product, details={"baud": self._baud})

    def _decode(self, data: bytes) -> Scans:
        found = self._decoder.feed(data)
        return Scans(
            counts=found.counts,
            counter=(found.number % self.modulus).astype(np.int32),
            temperature=float(found.temperature.mean()) / 100 if len(found.temperature) else float("nan"),
            bad_bytes=0,
        )


def listen(path: str) -> tuple[SerialPort, int]:
    """Return the open port of a device, and the baud rate at which its packets are intact.

    Raises
    ------
    OSError
        If the port cannot be opened.
    ValueError
        If no packet is received at any rate.
    """
    for baud in BAUDS:
        port, decoder = SerialPort(path, baud), wit.WitDecoder()
        port.discard_input()
        n, end = 0, time.monotonic() + _LISTEN_SECONDS
        while time.monotonic() < end and n < _ENOUGH:
            n += len(decoder.feed(port.read()).counts)
        if n >= _ENOUGH:
            return port, baud
        port.close()
    raise ValueError(f"no accelerations at {', '.join(map(str, BAUDS))} bit/s")


def search(path: str, _: int) -> PortAnswer | None:
    """Listen for a device at a port without sending."""
    try:
        port, baud = listen(path)
    except (*PORT_ERRORS, DeviceLost, ValueError):
        return None
    port.close()
    identity = DeviceIdentity(product="WT901", details={"baud": baud})
    rate = max(rate for rate in wit.RATES if rate <= baud // (_BITS_A_BYTE * wit.PACKET_SIZE))
    found = Found(driver="witmotion", place=path, identity=identity, rate=float(rate))
    return PortAnswer(who=f"WT901 at {baud} bit/s", devices=(found,))

"""A Raspberry Shake 4D that sends its accelerations as datagrams."""

import time

import numpy as np

from daq.drivers.base import Found, PortAnswer, Scans, known_rate
from daq.drivers.network.ports import UdpPort, network_address
from daq.drivers.serial.base import SerialDriver
from daq.errors import DeviceLost, DriverError
from daq.protocol import raspberry_shake as shake
from daq.timing.resampling import StampCount
from daq.types import DeviceIdentity

_WAIT_SECONDS = 3.0  # for a complete set of datagrams, of which there are 4 per second
_NEAR = 10 * shake.RATE  # scans after which stamps are not followed
_LEAP = 10 * shake.RATE  # scans that cannot be missing: a device that is silent for less is lost


class RaspberryShake(SerialDriver[shake.ShakeDecoder, UdpPort]):
    """Driver of one device, whose datagrams are sent to a port of this machine.

    Parameters
    ----------
    port : `udp://:PORT`, or `udp://HOST:PORT` with an address of this machine
    rate : 100 scans per second [Hz]

    Raises
    ------
    ValueError
        If it is another rate, or no such port.
    """

    product = "Raspberry Shake"
    scale = shake.SCALE
    modulus = 1 << 31

    def __init__(self, port: str, rate: float) -> None:
        super().__init__(port)
        known_rate(rate, (shake.RATE,), port)
        address = network_address(port)
        if address is None or address.kind != "udp":
            raise ValueError(f"port: expected udp://:PORT, found {port!r}")
        self._address = address
        self._decoder, self._numbers = shake.ShakeDecoder(), StampCount(shake.RATE, most=_NEAR)
        self._last = 0  # number of the last scan

    def _connect(self) -> UdpPort:
        return UdpPort(self._address)

    def _start(self, port: UdpPort) -> DeviceIdentity:
        """Wait for accelerations."""
        self._decoder, self._numbers, self._last = shake.ShakeDecoder(), StampCount(shake.RATE, most=_NEAR), 0
        end = time.monotonic() + _WAIT_SECONDS
        while not len(scans := self._decoder.feed(port.read()).time):
            if time.monotonic() > end:
                found = ", ".join(sorted(self._decoder.channels)) or "none"
                wanted = ", ".join(shake.CHANNELS)
                raise ValueError(f"channels: expected {wanted} within {_WAIT_SECONDS:g} s, found {found}")
        self._last = int(self._numbers.numbers(scans)[-1])
        return DeviceIdentity(product=self.product)

    def _decode(self, data: bytes) -> Scans:
        found = self._decoder.feed(data)
        number = self._numbers.numbers(found.time)
        latest = np.maximum.accumulate(np.append(self._last, number))
        if np.any((number < latest[:-1] - shake.RATE) | (number > latest[:-1] + _LEAP)):
            raise DeviceLost(self._path, "the clock of the Raspberry Shake was set")
        in_order = number > latest[:-1]  # datagrams may arrive twice or late
        self._last = int(latest[-1])
        return Scans(
            counts=found.counts[in_order],
            counter=(number[in_order] % self.modulus).astype(np.int32),
            temperature=float("nan"),
            bad_bytes=0,
        )


def search(path: str, _: int) -> PortAnswer | None:
    """Listen for a device at a port of this machine."""
    try:
        driver = RaspberryShake(path, shake.RATE)
        identity = driver.open()
    except (DriverError, ValueError):
        return None
    driver.close()
    found = Found(driver="raspberry-shake", place=path, identity=identity, rate=float(shake.RATE))
    return PortAnswer(who="Raspberry Shake", devices=(found,))

"""Interface of a driver: one kind of device, the result of one read, and checks of its rate."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from daq.drivers.addresses import CanPlace
from daq.types import DeviceIdentity, IndexArray, IntArray


@dataclass(frozen=True, eq=False)
class Scans:
    """Result of one read."""

    counts: IntArray  #: (n, n_axes) [-]
    #: (n,) as the device counts, wrapping; as `clock` counts, for good, if it has one [-]
    counter: IntArray | IndexArray
    temperature: float  #: [degC]
    bad_bytes: int  #: dropped while these were read
    age: int = 0  #: time since the bytes were received [ns of wall time]
    clock: str = ""  #: common clock of the counter, if other devices sample by it too; a new name after a restart
    warning: str = ""  #: warning of the device, or about a device that still sends


class Driver(Protocol):
    """Interface of one kind of device, with hardware access only.

    One that filters has `delay` as well: how long after the motion a scan is that its filter lets through [s].
    """

    scale: float  #: m/s2 a count; known once it is open
    modulus: int  #: counter values before the counter wraps

    def open(self) -> DeviceIdentity:
        """Configure the device and start it; return its identity.

        Raises
        ------
        DriverError
            If it does not respond as its protocol requires.
        """
        ...

    def read(self) -> Scans:
        """Wait for scans, at most a short time.

        Raises
        ------
        DeviceLost
            If the port is gone.
        """
        ...

    def close(self) -> None:
        """Stop the device if it still listens, and free the port."""
        ...


def known_rate(rate: float, known: Collection[int], place: str | CanPlace) -> int:
    """Return a rate that a device at a place has [Hz].

    Raises
    ------
    ValueError
        If it has no such rate.
    """
    if rate not in known:
        raise ValueError(f"rate of {place}: expected one of {sorted(known)} Hz, found {rate:g}")
    return int(rate)


def positive_rate(rate: float, place: str | CanPlace) -> float:
    """Return a rate of a device at a place that has any [Hz].

    Raises
    ------
    ValueError
        If it is not positive.
    """
    if not rate > 0:
        raise ValueError(f"rate of {place}: expected a positive number of Hz, found {rate:g}")
    return rate

"""Interface of a driver: address of a device, the result of one read, and checks of its rate."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from daq.protocol.text_line import LineFormat
from daq.types import DeviceIdentity, IndexArray, IntArray

OURS = "slcan"  #: this name means the bus of `daq.drivers.can.bus`; any other one is opened by python-can


@dataclass(frozen=True, kw_only=True)
class CanPlace:
    """A bus that python-can, or for "slcan" this package, can open."""

    interface: str  #: "slcan", "socketcan", "socketcand", "virtual", ...
    channel: str  #: name in the notation of the interface: a serial port, can0, ...
    bitrate: int = 1_000_000  #: [bit/s]

    @property
    def bus(self) -> tuple[str, str]:
        """Properties that devices on one bus have in common."""
        return self.interface, self.channel


@dataclass(frozen=True, kw_only=True)
class CanAddress(CanPlace):
    """A CANopen node on a bus."""

    node: int  #: CANopen id, 1 to 127
    sync: Literal["producer", "consumer"] | None = None  #: samples on the bus's SYNC, which one node produces, or timed

    def __post_init__(self) -> None:
        """Refuse an id that no node can have, and a part in SYNC that there is not."""
        if not 1 <= self.node <= 127:
            raise ValueError(f"node: expected 1 to 127, found {self.node}")
        if self.sync not in (None, "producer", "consumer"):
            raise ValueError(f"sync: expected producer or consumer, found {self.sync!r}")

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel} node {self.node}"


@dataclass(frozen=True, kw_only=True)
class DbcSensor:
    """Signals of a sensor in a DBC file; each SIGNAL, or MESSAGE.SIGNAL where several messages have one."""

    file: Path
    signals: tuple[str, ...]  #: signals of the device axes x, y, z; at least the first
    counter: str  #: counts scans; if several of the messages have one of that name, each is looked at
    scale: float | None = None  #: Acceleration per unit of the signals [m/s2]. Default: from the unit in the DBC file.
    temperature: str | None = None  #: [degC]
    order: tuple[str, ...] = ()  #: messages in the order of transmission. Default: by ascending identifier

    def __post_init__(self) -> None:
        """Refuse invalid values."""
        if not 1 <= len(self.signals) <= 3:
            raise ValueError(f"signals: expected those of x, of x and y, or of x, y and z, found {len(self.signals)}")
        if self.scale is not None and not self.scale > 0:
            raise ValueError(f"scale: expected a positive number of m/s2 a unit, found {self.scale:g}")


@dataclass(frozen=True, kw_only=True)
class DbcAddress(CanPlace):
    """A sensor on a bus that a DBC file describes."""

    sensor: DbcSensor

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel} {self.sensor.signals[0]}"


@dataclass(frozen=True, kw_only=True)
class TextAddress:
    """A sensor that sends lines of text."""

    port: str  #: serial port, or tcp://HOST:PORT, udp://:PORT
    form: LineFormat
    baud: int = 115_200  #: of a serial port [bit/s]

    def __str__(self) -> str:
        return self.port


@dataclass(frozen=True, kw_only=True)
class DaqmxAddress:
    """Analog inputs of a data acquisition device of National Instruments."""

    inputs: tuple[str, ...]  #: physical channels of the axes x, y, z; at least the first: cDAQ1Mod1/ai0
    sensitivity: tuple[float, ...]  #: of each sensor [mV/g]
    range_g: float  #: largest acceleration [g]
    excitation: float = 4.0  #: constant current of IEPE sensors [mA]; 0: none

    def __str__(self) -> str:
        return ", ".join(self.inputs)


@dataclass(frozen=True, kw_only=True)
class Found:
    """A device that answered the search."""

    driver: str
    place: str | CanAddress | TextAddress
    identity: DeviceIdentity
    rate: float = 1000.0  #: scans per second that it can [Hz]
    axes: tuple[int, ...] = (0, 1, 2)  #: measured axes


@dataclass(frozen=True, kw_only=True)
class PortAnswer:
    """Result of the search at a port."""

    who: str  #: description for people
    devices: tuple[Found, ...]  #: devices found; empty behind an adapter whose bus is silent


@dataclass(frozen=True, kw_only=True)
class LogAddress:
    """A device in a log."""

    path: Path  #: log, or folder with the files of one run
    device: str  #: its name in the log
    speed: float = 1.0  #: seconds of data per second of wall time

    def __str__(self) -> str:
        return f"{self.path} device {self.device}"


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

    A driver of a device that filters also has `delay`, the group delay of the filter [s].
    """

    scale: float  #: m/s2 per count; known once it is open
    modulus: int  #: counter values before the counter wraps

    def open(self) -> DeviceIdentity:
        """Configure the device and start it; return its identity.

        Raises
        ------
        DriverError
            If it does not respond as its protocol requires.
        """

    def read(self) -> Scans:
        """Wait for scans, at most a short time.

        Raises
        ------
        DeviceLost
            If the port is gone.
        """

    def close(self) -> None:
        """Stop the device if it still listens, and free the port."""


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

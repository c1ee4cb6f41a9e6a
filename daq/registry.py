"""Drivers by name; nothing is imported until asked for."""

from importlib import import_module
from importlib.metadata import entry_points

from daq.can_address import OURS, CanAddress
from daq.drivers.base import Driver

#: name -> (where it is, what its devices are connected to)
_DRIVERS: dict[str, tuple[str, type]] = {
    "epson-can": ("daq.drivers.epson_can:EpsonCan", CanAddress),
    "epson-uart": ("daq.drivers.epson_uart:EpsonUart", str),
}
_GROUP = "modalwatch.drivers"


def driver_names() -> tuple[str, ...]:
    """Return the names of all drivers, installed plug-ins included."""
    return tuple(sorted({*_DRIVERS, *entry_points(group=_GROUP).names}))


def can_interfaces() -> tuple[str, ...]:
    """Return the names of all kinds of CAN interfaces; what each of them needs may not be installed."""
    return tuple(sorted({OURS, *import_module("can.interfaces").BACKENDS}))


def make_driver(name: str, place: str | CanAddress, rate: float) -> Driver:
    """Return an unopened driver.

    Parameters
    ----------
    name : of the driver
    place : path of a serial port, or node on a CAN bus
    rate : scans a second [Hz]

    Raises
    ------
    ValueError
        If there is no such driver, its devices are not found at such a place, or it has no such rate.
    """
    if name in _DRIVERS:
        path, kind = _DRIVERS[name]
        if not isinstance(place, kind):
            expected, found = ("can", "port") if kind is CanAddress else ("port", "can")
            raise ValueError(f"driver {name}: expected `{expected}`, found `{found}`: {place}")
        module, _, attribute = path.partition(":")
        make = getattr(import_module(module), attribute)
    elif name in entry_points(group=_GROUP).names:
        make = entry_points(group=_GROUP)[name].load()
    else:
        raise ValueError(f"driver: expected one of {', '.join(driver_names())}, found {name!r}")
    driver: Driver = make(place, rate)
    return driver

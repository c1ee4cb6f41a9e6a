"""Drivers by name; nothing is imported until asked for."""

from importlib import import_module
from importlib.metadata import entry_points

from daq.drivers.base import Driver

_DRIVERS = {"epson-uart": "daq.drivers.epson_uart:EpsonUart"}
_GROUP = "modalwatch.drivers"


def driver_names() -> tuple[str, ...]:
    """Return the names of all drivers, installed plug-ins included."""
    return tuple(sorted({*_DRIVERS, *entry_points(group=_GROUP).names}))


def make_driver(name: str, port: str, rate: float) -> Driver:
    """Return an unopened driver.

    Raises
    ------
    ValueError
        If there is no such driver, or it has no such rate.
    """
    if name in _DRIVERS:
        module, _, attribute = _DRIVERS[name].partition(":")
        found = getattr(import_module(module), attribute)
    elif name in entry_points(group=_GROUP).names:
        found = entry_points(group=_GROUP)[name].load()
    else:
        raise ValueError(f"driver: expected one of {', '.join(driver_names())}, found {name!r}")
    driver: Driver = found(port, rate)
    return driver

"""Drivers by name; a driver is imported when it is used."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from daq.drivers.base import OURS, CanAddress, CanPlace, DaqmxAddress, DbcAddress, Driver, LogAddress, TextAddress

Place = str | CanPlace | TextAddress | LogAddress | DaqmxAddress  #: location: a port, a bus, a log, analog inputs
#: name of each kind of location in the settings
_SETTINGS: dict[type, str] = {
    str: "port",
    TextAddress: "port` and `text",
    CanAddress: "can",
    DbcAddress: "can` and `dbc",
    LogAddress: "log",
    DaqmxAddress: "daqmx",
}


@dataclass(frozen=True)
class DriverKind:
    """A row of the table of drivers."""

    places: Mapping[type, str]  #: location type -> module:class of the driver, made of (place, rate)
    low_grade: str = ""  #: why its data are not to be relied on, if so


_UNNUMBERED = "scans have no number: those that a port loses shift all that follow, unseen"
_DRIVERS = {
    "can-dbc": DriverKind({DbcAddress: "daq.drivers.can.dbc_sensor:CanDbc"}),
    "epson-can": DriverKind({CanAddress: "daq.drivers.can.epson_can:EpsonCan"}),
    "epson-uart": DriverKind({str: "daq.drivers.serial.epson_uart:EpsonUart"}),
    "modalwatch-node": DriverKind({str: "daq.drivers.serial.node:ModalwatchNode"}),
    "nidaqmx": DriverKind({DaqmxAddress: "daq.drivers.ni_daqmx:NiDaqmx"}),
    "raspberry-shake": DriverKind({str: "daq.drivers.network.raspberry_shake:RaspberryShake"}),
    "replay": DriverKind({LogAddress: "daq.drivers.replay:ReplayedDevice"}),
    "serial-text": DriverKind({TextAddress: "daq.drivers.serial.text_lines:TextLines"}),
    "witmotion": DriverKind(
        {str: "daq.drivers.serial.witmotion:Witmotion", CanAddress: "daq.drivers.can.witmotion_can:WitmotionCan"},
        low_grade=_UNNUMBERED,
    ),
}
_GROUP = "modalwatch.drivers"  # of entry points: drivers of others


def driver_names() -> tuple[str, ...]:
    """Return the names of all drivers, installed plug-ins included."""
    return tuple(sorted({*_DRIVERS, *entry_points(group=_GROUP).names}))


def low_grade(name: str, place: Place | None = None) -> str:
    """Return the reason why the data of a driver's devices are unreliable for modes; empty if they are reliable.

    Parameters
    ----------
    name : of the driver
    place : of the device, whose lines may have no number. Default: that of any device of the driver
    """
    if isinstance(place, TextAddress) and not place.form.numbered:
        return _UNNUMBERED
    return _DRIVERS[name].low_grade if name in _DRIVERS else ""


def can_interfaces() -> tuple[str, ...]:
    """Return the names of all kinds of CAN interfaces; their dependencies may not be installed."""
    import_module("daq.protocol.can_library")
    return tuple(sorted({OURS, *import_module("can.interfaces").BACKENDS}))


def make_driver(name: str, place: Place, rate: float) -> Driver:
    """Return an unopened driver.

    Parameters
    ----------
    name : of the driver; one of ours is never replaced by a plug-in
    place : path of a serial port, with or without a format of lines, node on a CAN bus, sensor on one that a DBC file
        describes, or device in a log
    rate : scans per second [Hz]

    Raises
    ------
    ValueError
        If there is no such driver, its devices are not found at such a place, or it has no such rate; or if a plug-in
        cannot be loaded or is no driver.
    DbcError
        If a DBC file cannot be used.
    """
    if name in _DRIVERS:
        make = _own(name, place)
    elif name in entry_points(group=_GROUP).names:
        make = _plugged_in(entry_points(group=_GROUP)[name])
    else:
        raise ValueError(f"driver: expected one of {', '.join(driver_names())}, found {name!r}")
    driver: Driver = make(place, rate)
    return driver


def _own(name: str, place: Place) -> Any:  # noqa: ANN401 - a class of any driver
    places = _DRIVERS[name].places
    if type(place) not in places:
        expected = " or ".join(f"`{_SETTINGS[kind]}`" for kind in places)
        raise ValueError(f"driver {name}: expected {expected}, found `{_SETTINGS[type(place)]}`: {place}")
    module, _, attribute = places[type(place)].partition(":")
    return getattr(import_module(module), attribute)


def _plugged_in(entry: EntryPoint) -> Any:  # noqa: ANN401 - a class of any driver
    """Return the class of an entry point; `Driver` lists its required members."""
    try:
        found = entry.load()
    except (ImportError, AttributeError) as error:
        raise ValueError(f"driver {entry.name}: {entry.value} cannot be loaded: {error}") from error
    lacking = [what for what in ("open", "read", "close") if not callable(getattr(found, what, None))]
    if lacking:
        raise ValueError(f"driver {entry.name}: {entry.value} is no driver: it has no {', '.join(lacking)}")
    return found

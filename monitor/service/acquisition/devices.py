"""Devices of a site, one thread each; single devices can be replaced."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from daq import DeviceReader, Driver, DriverError, HostClock, Item, LogAddress, ScaledClock, SystemClock, make_driver
from monitor.errors import StartError
from monitor.settings import DeviceSettings, Settings

Drivers = Mapping[str, tuple[DeviceSettings, Driver]]  #: device -> its settings and its unopened driver


def site_clock(settings: Settings) -> HostClock:
    """Return the clock by which a site's data are timed.

    Raises
    ------
    StartError
        If its shared file cannot be read: the rig is over.
    """
    scale = settings.clock
    if scale is None:
        return SystemClock()
    now = time.time_ns()
    wall = now if scale.origin_wall is None else scale.origin_wall
    origin = now if scale.origin is None else scale.origin
    clock = ScaledClock(speed=scale.speed, origin_wall=wall, origin=origin, shared=scale.shared)
    try:
        clock.now()
    except OSError as error:
        raise StartError(f"clock.shared: {error.filename}: {error.strerror}; is the rig over?") from error
    return clock


def device_driver(device: DeviceSettings, speed: float) -> Driver:
    """Return the unopened driver of a device.

    Parameters
    ----------
    device : its settings
    speed : seconds of data a second, for logs that are played

    Raises
    ------
    ValueError
        If there is no driver of that name, or it has no such place or rate.
    """
    place = device.place
    if isinstance(place, LogAddress):
        place = replace(place, speed=speed)
    return make_driver(device.driver, place, device.rate)


def site_drivers(devices: Iterable[DeviceSettings], speed: float) -> Drivers:
    """Return the unopened drivers of devices, in the order in which they are to be opened.

    Raises
    ------
    StartError
        Naming the device whose driver has no such place or rate.
    """
    drivers = {}
    for device in sorted(devices, key=lambda device: device.waits_for_sync):
        try:
            drivers[device.name] = device, device_driver(device, speed)
        except ValueError as error:
            raise StartError(f"device {device.name}: {error}") from error
    return drivers


class Devices:
    """Readers of the devices.

    Parameters
    ----------
    clock : of the data
    sink : takes blocks and events, from the threads
    """

    def __init__(self, clock: HostClock, sink: Callable[[Item], None]) -> None:
        self._clock, self._sink = clock, sink
        self._readers: dict[str, DeviceReader] = {}

    @property
    def bad_bytes(self) -> dict[str, int]:
        """Device -> bytes that no whole frame held, since it was opened first."""
        return {name: reader.bad_bytes for name, reader in self._readers.items()}

    def start(self, drivers: Drivers, *, missing_is_lost: bool = False) -> None:
        """Open devices and start their threads.

        Parameters
        ----------
        drivers : of the devices
        missing_is_lost : whether one that does not answer counts as lost, and is waited for, as long as others do:
            a watch that has begun is not to end with one of its devices

        Raises
        ------
        StartError
            If one does not answer, or none does: all that were started are stopped.
        """
        silent = {}
        for name, (device, driver) in drivers.items():
            reader = DeviceReader(name, driver, device.rate, self._clock, self._sink, delay=device.delay)
            try:
                reader.connect()
            except DriverError as error:
                silent[name] = error
                reader.lose(error)
                if not missing_is_lost or len(silent) == len(drivers):
                    self.stop()
                    raise StartError("; ".join(f"device {n}: {why}" for n, why in silent.items())) from error
            self._readers[name] = reader
            reader.start()

    def stop(self, names: Iterable[str] | None = None) -> dict[str, DeviceReader]:
        """Stop devices. Default: all; received data are passed on. Return their readers."""
        stopped = {name: self._readers.pop(name) for name in tuple(self._readers if names is None else names)}
        for reader in stopped.values():
            reader.stop()
        for reader in stopped.values():
            reader.join()
        return stopped

    def resume(self, drivers: Drivers, before: Mapping[str, DeviceReader]) -> None:
        """Restart devices while others continue; one that does not answer counts as lost.

        Parameters
        ----------
        drivers : of the devices
        before : stopped readers, whose indices are continued
        """
        for name, (device, driver) in drivers.items():
            reader = DeviceReader(
                name, driver, device.rate, self._clock, self._sink, delay=device.delay, after=before.get(name)
            )
            try:
                reader.connect()
            except DriverError as error:
                reader.lose(error)
            self._readers[name] = reader
            reader.start()

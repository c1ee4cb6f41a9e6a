"""Short test of a device: identity and sampling rate."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from daq import DeviceIdentity, Driver, DriverError, FloatArray
from monitor.service.acquisition.devices import device_driver
from monitor.settings import DeviceSettings, Settings

_SECONDS = 1.0  # of wall time that each device is listened to
_SETTLE = 0.2  # s at first: data that had accumulated in the port do not show the rate
_RATE_TOLERANCE = 0.1  # of the rate seen: reads come in bursts, on a busy machine of some 50 ms


@dataclass(frozen=True, eq=False, kw_only=True)
class Probe:
    """Observations of a device."""

    identity: DeviceIdentity
    rate: float  #: scans per second of data [Hz]
    lost: int  #: scans missing while it was listened to
    bad_bytes: int
    temperature: float  #: [degC], NaN if it has no sensor
    mean: FloatArray  #: (n_axes,) [m/s2]
    rms: FloatArray  #: (n_axes,) about the mean [m/s2]

    def rate_is(self, expected: float) -> bool:
        """Return whether the measured rate is the configured one."""
        return abs(self.rate / expected - 1) < _RATE_TOLERANCE


def probe_devices(settings: Settings) -> dict[str, Probe | str]:
    """Query all devices of a site at once; a string is the reason of a failure."""
    speed = settings.clock.speed if settings.clock else 1.0

    drivers: dict[str, Driver] = {}

    def open_one(device: DeviceSettings) -> DeviceIdentity | str:
        try:
            drivers[device.name] = driver = device_driver(device, speed)
            return driver.open()
        except (DriverError, ValueError) as error:
            return str(error)

    def look(device: DeviceSettings, identity: DeviceIdentity | str) -> Probe | str:
        try:
            return identity if isinstance(identity, str) else _look(drivers[device.name], identity, speed)
        except DriverError as error:
            return str(error)

    with ThreadPoolExecutor(len(settings.device)) as pool:  # open all, then look at all: one's SYNC may drive others
        try:
            identities = list(pool.map(open_one, settings.device))
            found = list(pool.map(look, settings.device, identities))
        finally:
            for driver in drivers.values():
                driver.close()
    return {device.name: what for device, what in zip(settings.device, found, strict=True)}


def probe(
    driver: Driver, *, speed: float = 1.0, seconds: float = _SECONDS, now: Callable[[], float] = time.monotonic
) -> Probe:
    """Open a device, listen for a moment and close it.

    Parameters
    ----------
    driver : not opened yet
    speed : seconds of data a second
    seconds : how long to listen [s of wall time]
    now : clock [s]

    Raises
    ------
    DriverError
        If it does not answer, or sends nothing.
    """
    identity = driver.open()
    try:
        return _look(driver, identity, speed, seconds, now)
    finally:
        driver.close()


def _look(
    driver: Driver,
    identity: DeviceIdentity,
    speed: float,
    seconds: float = _SECONDS,
    now: Callable[[], float] = time.monotonic,
) -> Probe:
    """Listen to a device that is open."""
    start = now()
    while now() - start < _SETTLE:
        driver.read()
    return _listen(driver, identity, speed, seconds, now)


def _listen(driver: Driver, identity: DeviceIdentity, speed: float, seconds: float, now: Callable[[], float]) -> Probe:
    """Measure from the arrival of scans to the last arrival: some devices send in bursts of a quarter of a second."""
    asked, first = now(), driver.read()
    while not len(first.counts) and now() - asked < seconds:
        first = driver.read()
    start = end = now()
    reads = []
    while now() - start < seconds:
        reads.append(driver.read())
        end = now() if len(reads[-1].counts) else end
    elapsed = end - start
    counts = np.concatenate([scans.counts for scans in reads]) * driver.scale
    if not len(counts):
        raise DriverError(identity.serial or "device", "answers, but sends no scans")
    counter = np.concatenate([first.counter[-1:], *(scans.counter for scans in reads)]).astype(np.int64)
    steps = np.diff(counter) % driver.modulus
    temperatures = [scans.temperature for scans in reads if np.isfinite(scans.temperature)]
    return Probe(
        identity=identity,
        rate=float(steps.sum()) / elapsed / speed,
        lost=int((steps - 1).sum()),
        bad_bytes=sum(scans.bad_bytes for scans in reads),
        temperature=float(np.mean(temperatures)) if temperatures else float("nan"),
        mean=counts.mean(axis=0),
        rms=counts.std(axis=0),
    )

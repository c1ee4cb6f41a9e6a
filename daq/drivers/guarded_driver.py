"""Work with a driver, whatever it raises: the one place that catches all, and no reader ends by it."""

from collections.abc import Callable
from typing import TypeVar

from daq.drivers.base import Driver
from daq.errors import DriverError
from daq.types import DeviceIdentity

T = TypeVar("T")


class DriverCrashedError(DriverError):
    """Error that no driver should raise: the device is lost, and must not be lost for good."""

    def __init__(self, device: str, error: Exception) -> None:
        super().__init__(device, str(error))
        self._error = error

    def __str__(self) -> str:
        return f"{type(self._error).__name__}: {self._error}"


def guarded(device: str, work: Callable[[], T]) -> T:
    """Return the result of an action of a driver; every exception becomes a loss of the device.

    Raises
    ------
    DriverError
        Whatever it raised.
    """
    try:
        return work()
    except DriverError:
        raise
    except Exception as error:
        raise DriverCrashedError(device, error) from error


def guarded_open(device: str, driver: Driver) -> DeviceIdentity:
    """Open a device; a driver by others may return anything.

    Raises
    ------
    DriverError
        Whatever it raised, or if it returns no identity.
    """
    identity: object = guarded(device, driver.open)
    if not isinstance(identity, DeviceIdentity):
        raise DriverError(device, f"its driver returns no DeviceIdentity: {identity!r:.80}")
    return identity

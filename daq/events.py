"""Events of devices, of the log and of background threads: one class for each topic."""

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self, dataclass_transform

from daq.types import DeviceIdentity, Event


@dataclass_transform(frozen_default=True, kw_only_default=True)
@dataclass(frozen=True, kw_only=True)
class EventPayload:
    """Fields of an event, a frozen dataclass; a subclass names its topic."""

    topic: ClassVar[str]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)

    def payload(self) -> dict[str, Any]:
        """Return the fields as JSON values; those that are None are left out."""
        values = ((entry.name.rstrip("_"), getattr(self, entry.name)) for entry in fields(self))
        return {name: value for name, value in values if value is not None}

    def event(self, time: int) -> Event:
        """Return the event at a time [ns UTC]."""
        return Event(topic=self.topic, time=time, payload=self.payload())

    @classmethod
    def read(cls, event: Event) -> Self:
        """Return the fields of an event with this topic; unknown ones are left out."""
        names = {entry.name.rstrip("_"): entry.name for entry in fields(cls)}
        return cls(**{names[name]: value for name, value in event.payload.items() if name in names})


class ReasonPayload(EventPayload):
    """Event with a reason as its only field."""

    why: str


class IdentityPayload(EventPayload):
    """Event of a device with its identity."""

    device: str
    identity: DeviceIdentity

    def payload(self) -> dict[str, Any]:
        """Return the fields as JSON values, with those of the identity among them."""
        rest = super().payload()
        del rest["device"], rest["identity"]
        return {"device": self.device, **self.identity.payload(), **rest}


class DeviceOpened(IdentityPayload):
    """A device samples from the start of a run."""

    topic = "/event/device_open"
    filter_delay: float | None = None  #: [s]


class DeviceFailed(EventPayload):
    """A device is lost."""

    topic = "/event/device_failed"
    device: str
    why: str | None = None


class DeviceRecovered(IdentityPayload):
    """A lost device samples again."""

    topic = "/event/device_recovered"


class WrongDevice(EventPayload):
    """Another device is at the address of a lost one."""

    topic = "/event/wrong_device"
    device: str
    expected: dict[str, Any]  #: identity
    found: dict[str, Any]


class DeviceWarning(EventPayload):
    """Warning of a device that still sends."""

    topic = "/event/device_warning"
    device: str
    what: str


class WrongRate(EventPayload):
    """A device samples at another rate than its settings state."""

    topic = "/event/wrong_rate"
    device: str
    expected: float  #: [Hz]
    found: float  #: [Hz]


class ScansMissing(EventPayload):
    """Scans of a device are missing."""

    topic = "/event/gap"
    device: str
    first_index: int = 0
    missing: int = 0  #: scans
    exact: bool = False  #: False if the device has restarted, and the number is an estimate by the clock


class LogFileLost(EventPayload):
    """Another program has moved, deleted or truncated the open log file."""

    topic = "/event/log_file_lost"
    file: str
    how: str
    to: str | None = None  #: new path of a moved file
    lost: dict[str, int] | None = None  #: lost scans of each device, and other items
    bytes: int | None = None
    from_: int | None = None  #: time of the first lost item [ns UTC]
    until: int | None = None  #: time of the last one [ns UTC]


class LogDeleted(EventPayload):
    """An expired log file is deleted."""

    topic = "/event/log_deleted"
    file: str
    bytes: int
    why: str


class DiskLow(EventPayload):
    """Free space is below its limit, and no file may be deleted."""

    topic = "/event/disk_low"
    free_gb: float


class DiskRecovered(DiskLow):
    """Free space is above its limit again."""

    topic = "/event/disk_recovered"


class RecordingFailed(ReasonPayload):
    """The log cannot be written."""

    topic = "/event/recording_failed"


class RecordingRecovered(EventPayload):
    """The log can be written again."""

    topic = "/event/recording_recovered"
    kept: int  #: items kept in memory meanwhile
    lost: dict[str, int]  #: scans of each device, and other items, that did not fit in memory


class ThreadFailed(EventPayload):
    """A background thread is restarted after an unforeseen exception."""

    topic = "/event/thread_failed"
    thread: str
    why: str


class ThreadRecovered(EventPayload):
    """A background thread has worked without a further exception."""

    topic = "/event/thread_recovered"
    thread: str
    failures: int  #: exceptions since the start

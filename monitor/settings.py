"""SITE.toml: what is connected where, and how it is watched. Every setting is spelled here and nowhere else."""

import difflib
import tomllib
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from daq import CanAddress, CanPlace, Channel, DbcAddress, DbcSensor, LogAddress, can_interfaces
from monitor.alarms import AlarmRules
from monitor.errors import SettingsError
from monitor.notice_text import NoticeKind, check_template

Positive = Annotated[float, Field(gt=0)]
AXES = ("x", "y", "z")


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


def _known_interface(interface: str) -> str:
    if interface not in (known := can_interfaces()):
        raise ValueError(f"expected one of {', '.join(known)}")
    return interface


class CanSettings(_Section):
    """Which CAN bus a device is on."""

    interface: Annotated[str, AfterValidator(_known_interface)]  #: "slcan", or any that python-can knows
    channel: str  #: serial port of the adapter, can0, ...
    node: Annotated[int, Field(ge=1, le=127)] | None = None  #: CANopen id; of a device without `dbc`
    bitrate: Annotated[int, Field(gt=0)] = 1_000_000  #: [bit/s]


class DbcSettings(_Section):
    """Which signals of a DBC file are a device's; each SIGNAL or MESSAGE.SIGNAL."""

    file: str  #: relative to the settings
    signals: dict[Literal["x", "y", "z"], str]  #: device axis -> signal
    counter: str  #: signal that counts scans
    scale: Positive | None = None  #: [m/s2 a unit of the signals], if the file does not state their unit
    temperature: str | None = None  #: signal [degC]
    order: tuple[str, ...] = ()  #: messages of a scan as they are sent; by rising identifier unless given

    @model_validator(mode="after")
    def _axes(self) -> Self:
        if set(self.signals) != set(AXES[: len(self.signals)]) or not self.signals:
            raise ValueError("signals: expected those of x, of x and y, or of x, y and z")
        return self

    @property
    def sensor(self) -> DbcSensor:
        """The sensor that is meant."""
        signals = tuple(signal for _, signal in sorted(self.signals.items()))
        rest = self.model_dump(include={"counter", "scale", "temperature", "order"})
        return DbcSensor(file=Path(self.file), signals=signals, **rest)


class LogSettings(_Section):
    """Where a recorded device is, to be played again."""

    file: str  #: the log, or the folder of its files
    device: str  #: its name in the log


class DeviceSettings(_Section):
    """One accelerometer."""

    name: str
    driver: str
    port: str | None = None  #: serial port; a device has this ...
    can: CanSettings | None = None  #: ... or this ...
    dbc: DbcSettings | None = None  #: what it sends there, if that is no CANopen node's
    log: LogSettings | None = None  #: ... or this, with the driver `replay`
    rate: Positive = 1000.0  #: [Hz]
    channels: dict[Literal["x", "y", "z"], str]  #: device axis -> sensor; the rest is logged, not analysed

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        found = [name for name in ("port", "can", "log") if getattr(self, name) is not None]
        if len(found) != 1:
            raise ValueError(f"expected one of `port`, `can` and `log`, found {' and '.join(found) or 'none'}")
        if self.dbc is not None and self.can is None:
            raise ValueError(f"expected `can` beside `dbc`, found `{found[0]}`")
        if self.can is not None and (self.can.node is None) == (self.dbc is None):
            raise ValueError(f"expected one of `can.node` and `dbc`, found {'none' if self.dbc is None else 'both'}")
        return self

    @model_validator(mode="after")
    def _axes_that_are_sent(self) -> Self:
        for axis in self.channels:
            if self.dbc is not None and axis not in self.dbc.signals:
                raise ValueError(f"channels: axis {axis} is none of `dbc.signals`, {', '.join(self.dbc.signals)}")
        return self

    @property
    def place(self) -> str | CanPlace | LogAddress:
        """Where it is connected."""
        if self.log is not None:
            return LogAddress(path=Path(self.log.file), device=self.log.device)
        if self.can is None:
            return self.port or ""
        bus = self.can.model_dump(exclude={"node"})
        if self.dbc is not None:
            return DbcAddress(**bus, sensor=self.dbc.sensor)
        return CanAddress(**bus, node=self.can.node or 0)


class RecorderSettings(_Section):
    """Where the log goes."""

    folder: str = "log"
    chunk_seconds: Annotated[float, Field(gt=0, le=0.5)] = 0.2  #: of wall time between writes to the file
    rotate_mb: Positive = 512.0  #: size at which a new file is begun [MB]
    rotate_minutes: Positive = 60.0  #: of data in a file at which a new one is begun
    keep_days: Positive | None = None  #: files that were written longer ago are deleted; all are kept unless given
    keep_gb: Positive | None = None  #: of all files that runs have recorded here; beyond it the oldest are deleted
    min_free_gb: Annotated[float, Field(ge=0)] = 1.0  #: room left on the disk: the oldest files are deleted for it


class AnalysisSettings(_Section):
    """How windows are cut and analysed."""

    window_seconds: Positive = 600.0
    overlap: Annotated[float, Field(ge=0, lt=1)] = 0.0  #: share of a window that the next one repeats
    band: tuple[float, float] | None = None  #: [Hz]; chosen from rate and window unless given
    baseline_windows: Annotated[int, Field(ge=5)] = 24  #: windows to learn from before watching


class AlarmSettings(_Section):
    """When to wake somebody."""

    false_alarms_per_year: Positive = 1.0
    hold_windows: Annotated[int, Field(ge=1)] = 2  #: windows in a row over the limit that raise it
    clear_windows: Annotated[int, Field(ge=1)] = 2  #: calm windows in a row that clear it
    clear_ratio: Annotated[float, Field(gt=0, le=1)] = 0.8  #: a window is calm under this share of the limit
    latch: bool = False  #: whether an alarm stands until it is acknowledged
    cooldown_minutes: Annotated[float, Field(ge=0)] = 60.0  #: raised again this soon, an alarm goes on
    flapping_changes: Annotated[int, Field(ge=3)] = 6  #: alarms raised and cleared within ...
    flapping_hours: Annotated[float, Field(ge=0)] = 24.0  #: ... this time, from which on nobody is woken by them

    @property
    def rules(self) -> AlarmRules:
        """The same for the state machine."""
        return AlarmRules(
            hold_windows=self.hold_windows,
            clear_windows=self.clear_windows,
            clear_ratio=self.clear_ratio,
            latch=self.latch,
            cooldown=round(self.cooldown_minutes * 60e9),
            flapping_changes=self.flapping_changes,
            flapping_span=round(self.flapping_hours * 3600e9),
        )


class HistorySettings(_Section):
    """Where what was found is kept for years."""

    url: str | None = None  #: postgresql://USER@HOST/NAME; a SQLite file in the state folder unless given


class NotifySettings(_Section):
    """Whom to tell, and of what: one of `webhook`, `command` and `mqtt`."""

    webhook: str | None = None  #: address that gets a POST of JSON
    command: Annotated[tuple[str, ...], Field(min_length=1)] | None = None  #: program and arguments; text on its input
    mqtt: str | None = None  #: mqtt://HOST:PORT/TOPIC
    headers: dict[str, str] = {}  #: of the webhook
    on: tuple[NoticeKind, ...] = ("alarm", "update", "recovery", "flapping", "trouble")
    template: str | None = None  #: jinja2 text; the program's own unless given
    per_hour: Annotated[int, Field(ge=1)] = 12  #: what comes beyond that is told together, later
    heartbeat_minutes: Positive | None = None  #: a sign of life, only while data flow
    timeout_seconds: Positive = 10.0

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [name for name in ("webhook", "command", "mqtt") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of `webhook`, `command` and `mqtt`, found {' and '.join(given) or 'none'}")
        return self

    @field_validator("template")
    @classmethod
    def _renders(cls, template: str | None) -> str | None:
        if template is not None:
            check_template(template)
        return template

    @field_validator("webhook", "mqtt")
    @classmethod
    def _address(cls, url: str | None, info: ValidationInfo) -> str | None:
        schemes = ("http", "https") if info.field_name == "webhook" else ("mqtt", "mqtts")
        if url is not None and (urlsplit(url).scheme not in schemes or not urlsplit(url).hostname):
            raise ValueError(f"expected {schemes[0]}://HOST/.. or {schemes[1]}://HOST/..")
        return url


def _address(host: str) -> str:
    ip_address(host)  # raises ValueError
    return host


class WebSettings(_Section):
    """Health, metrics and a status page; leave the section out for none."""

    bind: Annotated[str, AfterValidator(_address)] = "127.0.0.1"  #: beyond this machine looking takes the token too
    port: Annotated[int, Field(ge=1, le=65535)] = 8765
    token_file: str | None = None  #: web_token in the state folder unless given; drawn where there is none


class ViewerSettings(_Section):
    """The live view, served on 127.0.0.1; leave the section out for none."""

    port: Annotated[int, Field(ge=1, le=65534)] = 9876  #: of the results; the signals are served on the next one
    memory_mb: Annotated[int, Field(ge=16)] = 256  #: of results kept for viewers that come late; the oldest go first


class ClockSettings(_Section):
    """The time scale of an emulated rig or of logs that are played; leave it out for real devices."""

    speed: Positive = 1.0  #: seconds of data a second
    origin_wall: int | None = None  #: wall time [ns UTC] at which ...
    origin: int | None = None  #: ... data time was this [ns UTC]; now and now unless given


class Settings(_Section):
    """A whole SITE.toml."""

    structure: str
    state: str = "state"  #: folder for what outlives a run
    device: Annotated[tuple[DeviceSettings, ...], Field(min_length=1)]
    recorder: RecorderSettings = RecorderSettings()
    analysis: AnalysisSettings = AnalysisSettings()
    alarm: AlarmSettings = AlarmSettings()
    history: HistorySettings = HistorySettings()
    notify: tuple[NotifySettings, ...] = ()
    web: WebSettings | None = None
    viewer: ViewerSettings | None = None
    clock: ClockSettings | None = None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Analysed channels, in the order of the devices."""
        return tuple(
            Channel(name=name, device=device.name, axis=AXES.index(axis))
            for device in self.device
            for axis, name in device.channels.items()
        )

    @property
    def step_seconds(self) -> float:
        """From the start of a window to that of the next [s]."""
        return self.analysis.window_seconds * (1 - self.analysis.overlap)


def parse_settings(text: str, path: Path | str = "SITE.toml") -> Settings:
    """Read settings from TOML text.

    Raises
    ------
    SettingsError
        Naming the file, the key, what was found and, for a key nobody knows, the nearest right word.
    """
    try:
        settings = Settings.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(path, str(error)) from error
    except ValidationError as error:
        raise SettingsError(path, _explain(error)) from error
    names = [device.name for device in settings.device] + [channel.name for channel in settings.channels]
    for repeated in sorted({name for name in names if names.count(name) > 1}):
        raise SettingsError(path, f"device: the name {repeated!r} is given twice")
    places = [str(device.place) for device in settings.device]
    for repeated in sorted({place for place in places if places.count(place) > 1}):
        raise SettingsError(path, f"device: two are connected to {repeated}")
    rates: dict[tuple[str, str], int] = {}
    for address in (device.place for device in settings.device):
        if isinstance(address, CanPlace) and rates.setdefault(address.bus, address.bitrate) != address.bitrate:
            raise SettingsError(
                path, f"device: {address} is at {address.bitrate} bit/s, its bus at {rates[address.bus]}"
            )
    return settings


def load_settings(path: Path) -> Settings:
    """Read a settings file; errors as for `parse_settings`."""
    try:
        return _from_folder(parse_settings(path.read_text(encoding="utf-8"), path), path.parent)
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(path, f"cannot be read: {error}") from error


def _from_folder(settings: Settings, folder: Path) -> Settings:
    """Return settings whose DBC files and logs are found from anywhere."""

    def found(device: DeviceSettings) -> DeviceSettings:
        files = {"dbc": device.dbc, "log": device.log}
        return device.model_copy(
            update={
                name: section.model_copy(update={"file": str(folder / section.file)})
                for name, section in files.items()
                if section is not None
            }
        )

    return settings.model_copy(update={"device": tuple(found(device) for device in settings.device)})


def _explain(error: ValidationError) -> str:
    # a misspelt key is also a missing one: say the former
    first: Any = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        return f"{place}: {first['msg']}, found {first['input']!r:.80}"
    sections = (
        Settings,
        DeviceSettings,
        CanSettings,
        DbcSettings,
        LogSettings,
        RecorderSettings,
        AnalysisSettings,
        AlarmSettings,
        HistorySettings,
        NotifySettings,
        WebSettings,
        ViewerSettings,
        ClockSettings,
    )
    known = sorted({name for section in sections for name in section.model_fields})
    near = difflib.get_close_matches(str(first["loc"][-1]), known, 1)
    return f"{place}: no such setting" + (f", did you mean {near[0]!r}?" if near else "")

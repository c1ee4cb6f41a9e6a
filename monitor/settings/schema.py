"""A whole SITE.toml."""

from ipaddress import ip_address
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, SecretStr, field_validator, model_validator

from daq import Channel
from monitor.detection.alarm import AlarmRules
from monitor.results.sensor_geometry import SensorGeometry
from monitor.settings.device import AXES, DeviceSettings, SensorSettings
from monitor.settings.notify import HomeAssistantSettings, NotifySettings
from monitor.settings.redaction import revealed
from monitor.settings.section import Positive, Section, has_place

_BASELINE_WINDOWS = 24  # to begin with
_MAX_WINDOWS = 100_000  # two years of windows of 10 minutes
_HIGHEST = 0.48  # share of the rate up to which modes are identified (`oma.preparation.TOP`)


class RecorderSettings(Section):
    """Folder of the logs, and retention."""

    folder: str = "log"
    """Folder of the logs."""
    chunk_seconds: Annotated[float, Field(gt=0, le=0.5)] = 0.05
    """Maximum time before received data are written [s]. A kill loses this much and the last 0.2 s of blocks."""
    rotate_mb: Positive = 512.0
    """Size of a log file at which the next file begins [MB = 10^6 bytes]."""
    rotate_minutes: Positive = 60.0
    """Duration of a log file after which the next file begins [min]."""
    keep_days: Annotated[Positive | None, Field(examples=[365.0])] = None
    """Recording that is kept [d]. Pauses and clock changes count as at most a tenth of it. Default: all."""
    keep_gb: Annotated[Positive | None, Field(examples=[500.0])] = None
    """Total size of the recorded log files [GB]; beyond it the oldest are deleted. Default: no limit."""
    min_free_gb: Annotated[float, Field(ge=0)] = 1.0
    """Free disk space [GB]: the oldest log files are deleted for it, never the newest. 0: none."""
    view_rate: Annotated[float, Field(ge=0)] = 50.0
    """Rate of the preview of each device for rerun and Foxglove, in the same log [scans per second]. 0: none."""


class AnalysisSettings(Section):
    """Windows and their analysis."""

    window_seconds: Annotated[float, Field(ge=1, le=1e6)] = 600.0
    """Length of a window [s]."""
    overlap: Annotated[float, Field(ge=0, le=0.95)] = 0.0
    """Overlap of successive windows, as a share of the window."""
    band: Annotated[tuple[float, float] | None, Field(examples=[[5.0, 400.0]])] = None
    """Frequency band [low, high] of the modes [Hz]. Default: chosen from rate and window."""
    baseline_windows: Annotated[int | None, Field(ge=5, le=_MAX_WINDOWS, examples=[24])] = None
    """Number of baseline windows. Default: 24, extended automatically if the baseline is too short."""
    baseline_windows_max: Annotated[int, Field(ge=5, le=_MAX_WINDOWS)] = 144
    """Largest number of baseline windows; ignored with `baseline_windows`."""

    @property
    def first_windows(self) -> int:
        """Windows that are learned from at least."""
        return (
            min(_BASELINE_WINDOWS, self.baseline_windows_max)
            if self.baseline_windows is None
            else self.baseline_windows
        )

    @property
    def most_windows(self) -> int:
        """Windows that are learned from at most."""
        return self.baseline_windows_max if self.baseline_windows is None else self.baseline_windows


class AlarmSettings(Section):
    """Rules of the alarm."""

    false_alarms_per_year: Annotated[float, Field(gt=0, le=1000)] = 1.0
    """Expected false alarms per year of all detectors together; determines their limits."""
    hold_windows: Annotated[int, Field(ge=1, le=_MAX_WINDOWS)] = 2
    """Number of consecutive windows above the limit that raise the alarm."""
    clear_windows: Annotated[int, Field(ge=1, le=_MAX_WINDOWS)] = 2
    """Number of consecutive calm windows that clear the alarm."""
    clear_below: Annotated[float, Field(gt=0, le=1)] = 0.8
    """A window is calm if its novelty is below this share of the limit."""
    latched: bool = False
    """Whether an alarm stays active until it is acknowledged, even if the windows are calm."""
    cooldown_minutes: Annotated[float, Field(ge=0)] = 60.0
    """An alarm raised again within this time continues the previous alarm [min]."""
    flapping_changes: Annotated[int, Field(ge=3)] = 6
    """Number of alarms raised and cleared within `flapping_hours` from which on no notices are sent."""
    flapping_hours: Annotated[float, Field(ge=0, le=1e6)] = 24.0
    """See `flapping_changes` [h]."""
    trend: Literal["forgive", "report", "notify"] = "report"
    """Slow trends of the frequencies: `forgive`, `report` in log, status page and report, or `notify` as well."""
    self_test_days: Annotated[float, Field(ge=0)] = 7.0
    """Interval of the tests whether a simulated mass would raise the alarm [d]. 0: none."""
    self_test_percent: Positive = 2.0
    """Simulated mass of the self-test, relative to that of the structure [%]."""

    @property
    def rules(self) -> AlarmRules:
        """The same for the state machine."""
        same = self.model_dump(include={"hold_windows", "clear_windows", "clear_below", "latched", "flapping_changes"})
        cooldown, span = round(self.cooldown_minutes * 60e9), round(self.flapping_hours * 3600e9)
        return AlarmRules(cooldown=cooldown, flapping_span=span, **same)


class TemperatureSettings(Section):
    """Thermometer of the site, in addition to those of the devices. Leave the section out for none."""

    csv: Annotated[str | None, Field(examples=["weather.csv"])] = None
    """CSV file, one reading per line, relative to SITE.toml. Give exactly one of `csv`, `mqtt`."""
    mqtt: Annotated[SecretStr | None, Field(examples=["mqtt://broker.example.org/site/air"])] = None
    """`mqtt://HOST:PORT/TOPIC`, or `mqtts://` with TLS. Requires `modalwatch[fleet]`."""
    column: str = "temperature"
    """Column of the file, or field of the JSON object of the topic [degC]."""
    stale_minutes: Positive = 60.0
    """Age of the last reading after which the thermometers of the devices are used instead [min]."""

    if TYPE_CHECKING:  # plain strings become secrets

        def __init__(self, **values: Any) -> None: ...  # noqa: ANN401 - validated

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [name for name in ("csv", "mqtt") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of `csv` and `mqtt`, found {' and '.join(given) or 'none'}")
        return self

    @field_validator("mqtt")
    @classmethod
    def _topic(cls, url: SecretStr | None) -> SecretStr | None:
        if url is not None:
            address = revealed(url)
            if not has_place(address, ("mqtt", "mqtts")) or not urlsplit(address).path[1:]:
                raise ValueError("expected mqtt://HOST/TOPIC or mqtts://HOST/TOPIC")
        return url


class HistorySettings(Section):
    """Database of results over years."""

    url: Annotated[SecretStr | None, Field(examples=["postgresql://modalwatch@localhost/modalwatch"])] = None
    """`postgresql://USER@HOST/NAME`. Default: a SQLite file in the state folder."""
    site: Annotated[str | None, Field(min_length=1, max_length=200, examples=["bridge 7"])] = None
    """Name of the site in a database of many sites, unique there. Default: file name of the structure file."""
    keep_days: Annotated[float | None, Field(ge=15, le=1e5, examples=[30.0])] = None
    """Days of which single windows and modes are kept [d]; daily figures and alarms are all kept. Default: all."""
    keep_events: Annotated[int, Field(ge=1)] = 100_000
    """Number of events kept per kind, such as gaps."""

    @field_validator("url")
    @classmethod
    def _known(cls, url: SecretStr | None) -> SecretStr | None:
        scheme, colon, _ = revealed(url).partition(":")
        if url is not None and not (colon and scheme.partition("+")[0] in ("sqlite", "postgresql")):
            raise ValueError("expected postgresql://USER@HOST/NAME or sqlite:///FILE")
        return url


def listening_address(host: str) -> str:
    """Return an address that a server can be bound to.

    Raises
    ------
    ValueError
        If it is not such an address.
    """
    try:
        ip_address(host)
    except ValueError:
        raise ValueError("expected an address such as 127.0.0.1, ::1 or 0.0.0.0") from None
    return host


class WebSettings(Section):
    """Server of status page, health and metrics. Leave the section out for none."""

    bind: Annotated[str, AfterValidator(listening_address)] = "127.0.0.1"
    """Address of the server. Without a `[web]` section there is no server."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8765
    """Port of the server."""
    token_file: Annotated[str | None, Field(examples=["web_token"])] = None
    """File with the token, relative to SITE.toml. Default: `web_token` in the state folder."""
    url: Annotated[str | None, Field(max_length=1000, examples=["https://bridge7.example.org"])] = None
    """Address of the status page for other machines: the link of the site on the page of the fleet."""

    @field_validator("url")
    @classmethod
    def _page(cls, url: str | None) -> str | None:
        if url is not None and not has_place(url, ("http", "https")):
            raise ValueError("expected http://HOST or https://HOST")
        return url


class ViewerSettings(Section):
    """Live view, served on 127.0.0.1. Without the section there is none."""

    port: Annotated[int, Field(ge=1, le=65534)] = 9876
    """Port of the live results; signals use the next one. Without a `[viewer]` section there is no live view."""
    memory_mb: Annotated[int, Field(ge=4)] = 256
    """Memory for results shown to viewers that connect later [MB]. The oldest are dropped first."""


class ClockSettings(Section):
    """Time scale of an emulated rig or of replayed logs. Leave the section out for real devices."""

    speed: Positive = 1.0
    """Seconds of data per second, for an emulated rig or replayed logs. Leave `[clock]` out for real devices."""
    origin_wall: Annotated[int | None, Field(examples=[1_767_225_600_000_000_000])] = None
    """Wall time of an emulated rig [ns UTC] that corresponds to `origin`. Default: the start."""
    origin: Annotated[int | None, Field(examples=[1_767_225_600_000_000_000])] = None
    """Data time at `origin_wall` [ns UTC]. Default: the start."""
    shared: Annotated[str | None, Field(examples=["/tmp/rig/time"])] = None
    """File of an emulated rig with its time: rig and monitor wait together where one of them is held up."""


class Settings(Section):
    """Devices and their connections, and the settings of the monitor."""

    structure: Annotated[str | None, Field(examples=["t_structure.toml"])] = None
    """Structure file. Default: none; changes are stated as modes that moved, not explained."""
    state: str = "state"
    """Folder of the data that survive a restart."""
    lines: Annotated[
        tuple[Annotated[tuple[str, ...], Field(min_length=2)], ...],
        Field(examples=[[["beam_left_y", "beam_right_y"]]]),
    ] = ()
    """Channels of `[[sensor]]` whose positions a line joins in pictures. Default: nearest neighbours are joined."""
    device: Annotated[tuple[DeviceSettings, ...], Field(min_length=1, max_length=1000)]
    sensor: Annotated[tuple[SensorSettings, ...], Field(max_length=3000)] = ()
    recorder: RecorderSettings = RecorderSettings()
    analysis: AnalysisSettings = AnalysisSettings()
    alarm: AlarmSettings = AlarmSettings()
    temperature: TemperatureSettings | None = None
    history: HistorySettings = HistorySettings()
    notify: Annotated[tuple[NotifySettings, ...], Field(max_length=20)] = ()
    home_assistant: HomeAssistantSettings | None = None
    web: WebSettings | None = None
    viewer: ViewerSettings | None = None
    clock: ClockSettings | None = None

    @model_validator(mode="after")
    def _band_that_is_measured(self) -> Self:
        band, rate = self.analysis.band, min(device.rate for device in self.device)
        if band is not None and not 0 < band[0] < band[1] <= rate / 2:
            raise ValueError(
                f"analysis.band: expected 0 < low < high <= {rate / 2:g} Hz, half the slowest rate, found {list(band)}"
            )
        if band is not None and band[0] >= _HIGHEST * rate:
            limit = f"{_HIGHEST * rate:g} Hz, {_HIGHEST:g} of the slowest rate"
            raise ValueError(f"analysis.band: expected low < {limit}, found {band[0]:g}")
        return self

    @model_validator(mode="after")
    def _sensors_of_channels(self) -> Self:
        channels, placed = [channel.name for channel in self.channels], [sensor.channel for sensor in self.sensor]
        for k, name in enumerate(placed):
            if name not in channels:
                raise ValueError(f"sensor.{k}.channel: expected a channel of a device, found {name!r}")
            if name in placed[:k]:
                raise ValueError(f"sensor.{k}.channel: {name!r} has a position already")
        if placed and len({sensor.at for sensor in self.sensor}) < 2:
            raise ValueError(f"sensor: expected two positions or more, found {list(self.sensor[0].at)} only")
        for name in (name for line in self.lines for name in line):
            if name not in placed:
                raise ValueError(f"lines: expected channels of [[sensor]], found {name!r}")
        return self

    @model_validator(mode="after")
    def _ports_differ(self) -> Self:
        web, viewer = self.web, self.viewer
        if web and viewer and web.port in (viewer.port, viewer.port + 1):
            raise ValueError(f"web.port: the viewer serves on {viewer.port} and {viewer.port + 1}, found {web.port}")
        return self

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Analysed channels, in the order of the devices."""
        return tuple(
            Channel(name=name, device=device.name, axis=AXES.index(axis))
            for device in self.device
            for axis, name in device.channels.items()
        )

    @property
    def sensor_geometry(self) -> SensorGeometry | None:
        """Positions of the channels; None if none is given."""
        sensors = {sensor.channel: (sensor.at, sensor.direction) for sensor in self.sensor}
        return SensorGeometry(sensors=sensors, lines=self.lines) if sensors else None

    @property
    def device_of(self) -> dict[str, str]:
        """Device of each analysed channel, by their names."""
        return {channel.name: channel.device for channel in self.channels}

    @property
    def step_seconds(self) -> float:
        """From the start of a window to that of the next [s]."""
        return self.analysis.window_seconds * (1 - self.analysis.overlap)

    @property
    def learning_seconds(self) -> float:
        """Least duration of the baseline [s]."""
        return self.analysis.window_seconds + (self.analysis.first_windows - 1) * self.step_seconds

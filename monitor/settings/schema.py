"""A whole SITE.toml."""

from ipaddress import ip_address
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, SecretStr, field_validator, model_validator

from daq import Channel
from monitor.detection.alarm import AlarmRules
from monitor.settings.device import AXES, DeviceSettings
from monitor.settings.notify import NotifySettings
from monitor.settings.redaction import revealed
from monitor.settings.section import Positive, Section, has_place

_BASELINE_WINDOWS = 24  # to begin with
_MOST_WINDOWS = 100_000  # two years of windows of 10 minutes


class RecorderSettings(Section):
    """Place of the log, and the part of it that is kept."""

    folder: str = "log"
    """where logs go"""
    chunk_seconds: Annotated[float, Field(gt=0, le=0.5)] = 0.05
    """of wall time that what came may wait to be written: a kill loses at most that and the last 0.2 s of blocks"""
    rotate_mb: Positive = 512.0
    """size of a log file at which the next one is begun [MB = 10^6 bytes]"""
    rotate_minutes: Positive = 60.0
    """of data in a log file at which the next one is begun"""
    keep_days: Annotated[Positive | None, Field(examples=[365.0])] = None
    """of recording that are kept, a pause or a set clock counting as a tenth of them at most; all unless given"""
    keep_gb: Annotated[Positive | None, Field(examples=[500.0])] = None
    """of all log files that runs have recorded in the folder; beyond it the oldest are deleted"""
    min_free_gb: Annotated[float, Field(ge=0)] = 1.0
    """room left on the disk: the oldest log files are deleted for it, never the newest; 0 for none, until it is full"""
    view_rate: Annotated[float, Field(ge=0)] = 50.0
    """scans a second of each device that are written for stock viewers too (rerun, Foxglove) [Hz]; 0 for none"""


class AnalysisSettings(Section):
    """Windows and their analysis."""

    window_seconds: Annotated[float, Field(ge=1, le=1e6)] = 600.0
    """length of a window"""
    overlap: Annotated[float, Field(ge=0, le=0.95)] = 0.0
    """share of a window that the next one repeats"""
    band: Annotated[tuple[float, float] | None, Field(examples=[[5.0, 400.0]])] = None
    """[low, high] in Hz; chosen from rate and window unless given"""
    baseline_windows: Annotated[int | None, Field(ge=5, le=_MOST_WINDOWS, examples=[24])] = None
    """number of baseline windows; default: 24, extended automatically if the baseline is too short"""
    baseline_windows_max: Annotated[int, Field(ge=5, le=_MOST_WINDOWS)] = 144
    """at which learning ends in any case; ignored with `baseline_windows`"""

    @property
    def first_windows(self) -> int:
        """Windows that are learnt from at least."""
        return (
            min(_BASELINE_WINDOWS, self.baseline_windows_max)
            if self.baseline_windows is None
            else self.baseline_windows
        )

    @property
    def most_windows(self) -> int:
        """Windows that are learnt from at most."""
        return self.baseline_windows_max if self.baseline_windows is None else self.baseline_windows


class AlarmSettings(Section):
    """Rules of the alarm."""

    false_alarms_per_year: Annotated[float, Field(gt=0, le=1000)] = 1.0
    """that all detectors together may give; sets their limits"""
    hold_windows: Annotated[int, Field(ge=1, le=_MOST_WINDOWS)] = 2
    """windows in a row over the limit that raise the alarm"""
    clear_windows: Annotated[int, Field(ge=1, le=_MOST_WINDOWS)] = 2
    """calm windows in a row that clear it"""
    clear_ratio: Annotated[float, Field(gt=0, le=1)] = 0.8
    """a window is calm when its novelty is under this share of the limit"""
    latch: bool = False
    """whether an alarm stands until it is acknowledged, though the windows be calm"""
    cooldown_minutes: Annotated[float, Field(ge=0)] = 60.0
    """an alarm raised again within this time continues the previous alarm"""
    flapping_changes: Annotated[int, Field(ge=3)] = 6
    """alarms raised and cleared within `flapping_hours`, from which on they wake nobody"""
    flapping_hours: Annotated[float, Field(ge=0, le=1e6)] = 24.0
    """see `flapping_changes`"""
    trend: Literal["forgive", "report", "notify"] = "report"
    """slow trends of the frequencies: `forgive`, `report` in log, status and report, or `notify` people as well"""
    self_test_days: Annotated[float, Field(ge=0)] = 7.0
    """between tests whether a mass would raise the alarm; 0 for none"""
    self_test_percent: Positive = 2.0
    """that mass, of the structure's [%]"""

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


class TemperatureSettings(Section):
    """A thermometer beside those of the devices; leave the section out for none. It has `csv` or `mqtt`."""

    csv: Annotated[str | None, Field(examples=["weather.csv"])] = None
    """file that another program writes a line a reading to, relative to SITE.toml; has this or `mqtt` (service.md)"""
    mqtt: Annotated[SecretStr | None, Field(examples=["mqtt://broker.example.org/site/air"])] = None
    """`mqtt://HOST:PORT/TOPIC`, `mqtts://` with TLS; needs `modalwatch[fleet]`"""
    column: str = "temperature"
    """of the file, or of the JSON object that is said on the topic [degC]"""
    stale_minutes: Positive = 60.0
    """age of the last reading from which on the devices' own thermometers go on for it"""

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
    """`postgresql://USER@HOST/NAME`; a SQLite file in the state folder unless given"""
    keep_events: Annotated[int, Field(ge=1)] = 100_000
    """newest events of each kind that are kept, such as gaps; alarms, windows and modes all are"""

    @field_validator("url")
    @classmethod
    def _known(cls, url: SecretStr | None) -> SecretStr | None:
        scheme, colon, _ = revealed(url).partition(":")
        if url is not None and not (colon and scheme.partition("+")[0] in ("sqlite", "postgresql")):
            raise ValueError("expected postgresql://USER@HOST/NAME or sqlite:///FILE")
        return url


def _address(host: str) -> str:
    try:
        ip_address(host)
    except ValueError:
        raise ValueError("expected an address such as 127.0.0.1, ::1 or 0.0.0.0") from None
    return host


class WebSettings(Section):
    """Health, metrics and a status page; leave the section out for none."""

    bind: Annotated[str, AfterValidator(_address)] = "127.0.0.1"
    """address to serve on (service.md); without a `[web]` section nothing is served"""
    port: Annotated[int, Field(ge=1, le=65535)] = 8765
    """its port"""
    token_file: Annotated[str | None, Field(examples=["web_token"])] = None
    """file with the token, relative to SITE.toml; `web_token` in the state folder unless given"""


class ViewerSettings(Section):
    """The live view, served on 127.0.0.1; leave the section out for none."""

    port: Annotated[int, Field(ge=1, le=65534)] = 9876
    """of the live results; signals on the next one; without a `[viewer]` section nothing is served"""
    memory_mb: Annotated[int, Field(ge=4)] = 256
    """results kept for viewers that come late; the oldest go first"""


class ClockSettings(Section):
    """The time scale of an emulated rig or of logs that are played; leave it out for real devices."""

    speed: Positive = 1.0
    """of an emulated rig, or of logs that are played: seconds of data a second; leave `[clock]` out for real devices"""
    origin_wall: Annotated[int | None, Field(examples=[1_767_225_600_000_000_000])] = None
    """of an emulated rig: wall time [ns UTC] at which ..."""
    origin: Annotated[int | None, Field(examples=[1_767_225_600_000_000_000])] = None
    """... data time was this [ns UTC]; both are the start unless given"""


class Settings(Section):
    """Devices and their connections, and the settings of the monitor."""

    structure: Annotated[str, Field(examples=["t_structure.toml"])]
    """structure file"""
    state: str = "state"
    """folder for what outlives a run"""
    device: Annotated[tuple[DeviceSettings, ...], Field(min_length=1, max_length=1000)]
    recorder: RecorderSettings = RecorderSettings()
    analysis: AnalysisSettings = AnalysisSettings()
    alarm: AlarmSettings = AlarmSettings()
    temperature: TemperatureSettings | None = None
    history: HistorySettings = HistorySettings()
    notify: Annotated[tuple[NotifySettings, ...], Field(max_length=20)] = ()
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

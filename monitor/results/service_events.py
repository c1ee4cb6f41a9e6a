"""Events of the service: one class for each topic. Those of devices and of the log are in `daq.events`."""

from typing import Any

from daq.events import EventPayload, ReasonPayload


class Acknowledged(EventPayload):
    """A person has acknowledged the alarm."""

    topic = "/event/acknowledge"
    by: str = ""
    note: str = ""


class ChangeAccepted(EventPayload):
    """A person has accepted the change as the new reference."""

    topic = "/event/accept"
    by: str = ""
    cause: str = ""
    alarm: int | None = None  #: time at which the alarm was raised [ns UTC]; None for the active one

    def payload(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return super().payload() | {"alarm": self.alarm}


class AcceptanceUndone(EventPayload):
    """A person has undone the last acceptance."""

    topic = "/event/accept_undone"
    by: str = ""
    note: str = ""


class CommandRefused(EventPayload):
    """A file in the inbox is no command."""

    topic = "/event/refused"
    file: str
    why: str


class Stopped(EventPayload):
    """Last item of a run, or of its log and analysis if others follow."""

    topic = "/event/stopped"
    dropped: int | None = None  #: items that found the log's queue full
    why: str | None = None


class UncleanEnd(ReasonPayload):
    """An earlier run was killed; its log is repaired."""

    topic = "/event/unclean_end"


class Reloaded(EventPayload):
    """The run continues with other settings."""

    topic = "/event/reloaded"
    changed: str  #: restarted parts
    failed: str | None = None  #: parts that could not be restarted, and the reasons


class ReloadRefused(ReasonPayload):
    """New settings are invalid."""

    topic = "/event/reload_refused"


class ClockChanged(EventPayload):
    """The clock of the host was set."""

    topic = "/event/clock_changed"
    by_s: float  #: [s]


class AnalysisFailed(EventPayload):
    """The process of the analysis has died."""

    topic = "/event/analysis_failed"
    why: str
    again_in_s: float  #: time until it is started again [s]


class AnalysisLagging(EventPayload):
    """The analysis is restarted without its backlog."""

    topic = "/event/analysis_lagging"
    left_out_s: float  #: [s of data]


class InnovationsHigh(EventPayload):
    """Innovations about a mode are above the limit, after a minute in which none were; no alarm by itself."""

    topic = "/event/innovations_high"
    frequency: float  #: of the mode with the largest deviation [Hz]
    deviation: float  #: [-]


class WindowsLeftOut(ReasonPayload):
    """A window was left out because the analysis is behind."""

    topic = "/event/windows_left_out"


class AnalysisCaughtUp(EventPayload):
    """None of the last windows was left out."""

    topic = "/event/analysis_caught_up"
    left_out: int  #: windows


class BaselineReset(ReasonPayload):
    """The saved state cannot be used; a new baseline is learned."""

    topic = "/event/baseline_reset"


class DeviceReplaced(EventPayload):
    """Another device is at the address of the device of the run before."""

    topic = "/event/device_replaced"
    device: str
    before: dict[str, Any]  #: identity
    now: dict[str, Any]


class ChannelFailed(EventPayload):
    """Channels are without valid data."""

    topic = "/event/channel_failed"
    channels: str
    why: str


class ChannelRecovered(EventPayload):
    """Channels have valid data again."""

    topic = "/event/channel_recovered"
    channels: str


class TemperatureFailed(ReasonPayload):
    """The thermometer gives no valid readings."""

    topic = "/event/temperature_failed"


class TemperatureRecovered(EventPayload):
    """The thermometer gives valid readings again."""

    topic = "/event/temperature_recovered"


class HistoryFailed(ReasonPayload):
    """The history cannot be written."""

    topic = "/event/history_failed"


class HistoryRecovered(EventPayload):
    """The history can be written again."""

    topic = "/event/history_recovered"
    brought_in: int  #: entries that were kept on disk meanwhile


class HistoryRenewed(EventPayload):
    """A new SQLite file has begun."""

    topic = "/event/history_renewed"
    why: str
    set_aside: str | None = None  #: new name of the damaged file
    copied_to: str | None = None  #: name of the copy of a displaced file
    restored: bool | None = None  #: whether a displaced file is back at its place


class HistoryRestored(EventPayload):
    """Rows of an earlier SQLite file are in the present one."""

    topic = "/event/history_restored"
    rows: int
    of: str  #: name of the earlier file
    why: str | None = None  #: reason why it was not read to its end


class NoticeFailed(EventPayload):
    """A target of notices is not available."""

    topic = "/event/notice_failed"
    to: str
    why: str


class NoticeRecovered(EventPayload):
    """A target of notices is available again."""

    topic = "/event/notice_recovered"
    to: str


class HomeAssistantFailed(ReasonPayload):
    """The broker of Home Assistant is not available."""

    topic = "/event/home_assistant_failed"


class HomeAssistantRecovered(EventPayload):
    """The broker of Home Assistant is available again."""

    topic = "/event/home_assistant_recovered"


class ViewerFailed(ReasonPayload):
    """The live view has failed."""

    topic = "/event/viewer_failed"


class ViewerRecovered(EventPayload):
    """The live view works again."""

    topic = "/event/viewer_recovered"


class WebFailed(ReasonPayload):
    """The pages are not served."""

    topic = "/event/web_failed"


class WebRecovered(EventPayload):
    """The pages are served again."""

    topic = "/event/web_recovered"

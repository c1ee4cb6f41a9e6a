"""Results over years: a database of windows, modes, alarms and events, in addition to the complete logs.

The logs are the complete record; the database answers queries over long times, and can be made again from them.
"""

from monitor.outputs.history.engines import HistoryError, database_url
from monitor.outputs.history.fleet import FleetReader, FleetRow, LastAlarm
from monitor.outputs.history.queries import AlarmRow, DayRow, EventRow, Reader, Span, TrendPoint, WindowRow
from monitor.outputs.history.recorder import HistoryRecorder
from monitor.outputs.history.sites import STATE_SECONDS, SiteState, StateSchedule, Writer
from monitor.outputs.history.store import HistoryStore

__all__ = [
    "STATE_SECONDS",
    "AlarmRow",
    "DayRow",
    "EventRow",
    "FleetReader",
    "FleetRow",
    "HistoryError",
    "HistoryRecorder",
    "HistoryStore",
    "LastAlarm",
    "Reader",
    "SiteState",
    "Span",
    "StateSchedule",
    "TrendPoint",
    "WindowRow",
    "Writer",
    "database_url",
]

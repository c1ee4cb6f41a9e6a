"""Results over years: a database of windows, modes, alarms and events, in addition to the complete logs.

The logs are the complete record; the database answers queries over long times, and can be made again from them.
"""

from monitor.outputs.history.engines import HistoryError as HistoryError
from monitor.outputs.history.engines import database_url as database_url
from monitor.outputs.history.fleet import FleetReader as FleetReader
from monitor.outputs.history.fleet import FleetRow as FleetRow
from monitor.outputs.history.fleet import LastAlarm as LastAlarm
from monitor.outputs.history.queries import AlarmRow as AlarmRow
from monitor.outputs.history.queries import DayRow as DayRow
from monitor.outputs.history.queries import EventRow as EventRow
from monitor.outputs.history.queries import Reader as Reader
from monitor.outputs.history.queries import Span as Span
from monitor.outputs.history.queries import TrendPoint as TrendPoint
from monitor.outputs.history.queries import WindowRow as WindowRow
from monitor.outputs.history.recorder import HistoryRecorder as HistoryRecorder
from monitor.outputs.history.sites import STATE_SECONDS as STATE_SECONDS
from monitor.outputs.history.sites import SiteState as SiteState
from monitor.outputs.history.sites import StateSchedule as StateSchedule
from monitor.outputs.history.sites import Writer as Writer
from monitor.outputs.history.store import HistoryStore as HistoryStore

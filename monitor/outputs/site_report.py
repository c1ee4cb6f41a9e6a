"""Report of the present state of a site: a retained MQTT message, from its monitor to pages of many sites.

All times in it are ages at the time of writing: the clocks of two machines are not compared.
"""

import math
import time
from collections import deque
from dataclasses import asdict
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from daq import Event, Item
from monitor.outputs.history import SiteState
from monitor.results.windows import TOPIC_ALARM, TOPIC_WINDOW, AlarmResult, WindowResult, event_result
from monitor.text.causes import change_text

N_LEVELS = 40  #: windows whose novelty is reported
_MAX_BYTES = 1 << 16  # of a message

Line = Annotated[str, Field(max_length=2000)]
Seconds = Annotated[float, Field(le=1e10)]  # some centuries


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class ActiveAlarm(_Part):
    """The alarm that is active."""

    raised: int  #: [ns UTC]
    acknowledged: bool = False
    text: Line


class SiteReport(_Part):
    """Present state of a site."""

    site: Annotated[str, Field(min_length=1, max_length=200)]
    state: Annotated[str, Field(max_length=16)]  #: of the alarm, or learning
    lasts: Seconds  #: since it began, or since the start of the monitor [s]
    window: int | None = None  #: end of the last window by the clock of the monitor [ns UTC]
    window_age: Seconds | None  #: since the last window [s]; None if there was none
    overdue: bool  #: whether a window is overdue
    problems: Annotated[tuple[Line, ...], Field(max_length=100)] = ()
    url: Line = ""  #: address of the status page; empty if unknown
    alarm: ActiveAlarm | None = None
    levels: Annotated[tuple[float, ...], Field(max_length=N_LEVELS)] = ()  #: novelty over its limit, the last windows

    @property
    def content(self) -> tuple[object, ...]:
        """Part whose change is published at once; texts of problems may contain ages."""
        return self.state, self.window, self.overdue, len(self.problems), self.url, self.alarm


def parse_report(payload: bytes) -> SiteReport | None:
    """Return the report in a message; None if there is none."""
    if len(payload) > _MAX_BYTES:
        return None
    try:
        return SiteReport.model_validate_json(payload)
    except ValidationError:
        return None


class SiteReporter:
    """Makes reports from what is logged; `take` is for the log's thread."""

    def __init__(self) -> None:
        self._alarm: ActiveAlarm | None = None
        self._levels: deque[float] = deque(maxlen=N_LEVELS)
        self._state, self._since = "", 0.0  # state of the last report, and when it began, by time.monotonic [s]

    def take(self, item: Item) -> None:
        """Take a logged item."""
        if not isinstance(item, Event) or item.topic not in (TOPIC_ALARM, TOPIC_WINDOW):
            return
        result = event_result(item)
        if isinstance(result, WindowResult):
            if result.novelty and math.isfinite(result.novelty.level):
                self._levels.append(result.novelty.level)
            if self._alarm and result.diagnosis:
                self._alarm = self._alarm.model_copy(update={"text": change_text(result.diagnosis)[:2000]})
        elif isinstance(result, AlarmResult):
            self._alarm = self._after(result)

    def _after(self, change: AlarmResult) -> ActiveAlarm | None:
        if change.state != "alarm":
            return None
        known = self._alarm
        if known is None:
            return ActiveAlarm(raised=change.since or change.time, text=change.text[:2000])
        if change.kind == "acknowledged":
            return known.model_copy(update={"acknowledged": True})
        return known

    def report(self, site: str, state: SiteState) -> SiteReport:
        """Return the report of a state of a site with a name."""
        now = time.monotonic()
        if state.state != self._state:
            self._state, self._since = state.state, now
        known = asdict(state) | {"problems": tuple(problem[:2000] for problem in state.problems[:100])}
        lasts, levels = now - self._since, tuple(self._levels)
        return SiteReport(site=site[:200], lasts=lasts, alarm=self._alarm, levels=levels, **known)

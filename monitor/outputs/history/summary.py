"""Contents of a history within a span of time."""

from dataclasses import dataclass

from monitor.outputs.history import AlarmRow, DayRow, EventRow, HistoryError, Reader, Span, TrendPoint, WindowRow
from monitor.results.windows import TOPIC_SELF_TEST, AcceptedShift, ReferenceResult

_DAY = 86_400 * 10**9  # ns
_EVER = 2**62  # ns UTC
_ALL = 10**6  # windows: more than in a span shown by windows


@dataclass(frozen=True, kw_only=True)
class Windows:
    """Number of windows, and their highest novelty relative to the limit."""

    number: int
    judged: int
    over: int  #: the limit
    levels: list[tuple[int, float]]  #: time [ns UTC], novelty over its limit; by the day the highest


@dataclass(frozen=True, kw_only=True)
class Found:
    """Contents of a span."""

    span: Span
    newest: int  #: end of the newest window, which may be before the span [ns UTC]
    state: str
    days: list[DayRow]
    windows: Windows
    alarms: list[AlarmRow]
    accepted: list[AcceptedShift]  #: changes that are part of the reference of now
    trends: dict[int, list[TrendPoint]]
    events: list[EventRow]
    self_tests: list[EventRow]

    def accepted_at(self, change: AcceptedShift) -> int:
        """Return when a change was accepted [ns UTC]: when its alarm ended; else the end of its last window."""
        return next((a.cleared for a in self.alarms if a.raised == change.raised and a.cleared), change.time)


def look(reader: Reader, wanted: Span | None) -> Found:
    """Return the content of a span until now, of all time by default.

    Times in the future, by a clock that ran ahead or a rig that plays faster, are included.

    Raises
    ------
    HistoryError
        If no window has been analysed yet, or the database cannot be read.
    """
    whole = reader.span()
    if whole is None:
        raise HistoryError(reader.url, "no window has been analysed yet")
    span = whole
    if wanted is not None:
        span = Span(start=max(whole.start, wanted.start), end=max(whole.end, wanted.end))
    later = Span(start=span.start, end=_EVER)  # including events after the last window
    days = reader.days(span)
    return Found(
        span=span,
        newest=whole.end,
        state=reader.state(),
        days=days,
        windows=_of_days(days) if span.every == "day" else _of_windows(reader.windows(span, _ALL)),
        alarms=reader.alarms(span),
        accepted=_accepted(reader, later),
        trends={mode: [] for mode in reader.modes()} | reader.trends(span),
        events=reader.events(later),
        self_tests=reader.events(later, topic=TOPIC_SELF_TEST),
    )


def _accepted(reader: Reader, span: Span) -> list[AcceptedShift]:
    reference = reader.reference()
    changes = ReferenceResult.model_validate_json(reference).accepted if reference else []
    return [change for change in changes if span.start <= change.time <= span.end]


def _of_days(days: list[DayRow]) -> Windows:
    return Windows(
        number=sum(day.n for day in days),
        judged=sum(day.n_judged for day in days),
        over=sum(day.n_over for day in days),
        levels=[(day.day * _DAY + _DAY // 2, day.level) for day in days if day.level is not None],
    )


def _of_windows(windows: list[WindowRow]) -> Windows:
    judged = [(w.end, w.t2, w.limit) for w in windows if w.t2 is not None]
    return Windows(
        number=len(windows),
        judged=len(judged),
        over=sum(limit is not None and t2 > limit for _, t2, limit in judged),
        levels=[(end, t2 / limit) for end, t2, limit in judged if limit],
    )

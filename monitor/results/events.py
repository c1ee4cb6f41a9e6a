"""Results as events of the log, and back."""

from daq import Event
from monitor.results.windows import (
    TOPIC_ALARM,
    TOPIC_REFERENCE,
    TOPIC_SELF_TEST,
    TOPIC_WINDOW,
    AlarmResult,
    ReferenceResult,
    Result,
    SelfTestResult,
    WindowResult,
)

_TYPES: dict[str, type[Result]] = {
    TOPIC_WINDOW: WindowResult,
    TOPIC_REFERENCE: ReferenceResult,
    TOPIC_ALARM: AlarmResult,
    TOPIC_SELF_TEST: SelfTestResult,
}


def result_event(result: Result) -> Event:
    """Return a result as an event of the log."""
    time_ns = result.end if isinstance(result, WindowResult) else result.time
    topic = next(topic for topic, kind in _TYPES.items() if isinstance(result, kind))
    return Event(topic=topic, time=time_ns, payload=result.payload())


def is_result(event: Event) -> bool:
    """Return whether an event of the log is a result."""
    return event.topic in _TYPES


def event_result(event: Event) -> Result | None:
    """Return the result in an event of the log, None if there is none."""
    kind = _TYPES.get(event.topic)
    return kind.model_validate(event.payload) if kind else None

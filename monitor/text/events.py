"""Texts of events: the fields of their payload in order."""

from collections.abc import Mapping
from typing import Any

from monitor.text.quantities import utc

_TIMES = ("alarm",)  # fields that are times [ns UTC]


def event_name(topic: str) -> str:
    """Return the name of an event."""
    return topic.rpartition("/")[2].replace("_", " ")


def event_text(payload: Mapping[str, Any], *, without: str = "") -> str:
    """Return its payload as a text, without a field that is given elsewhere and without empty ones."""
    known = {name: value for name, value in payload.items() if name != without and value not in ("", None)}
    return ", ".join(f"{name.replace('_', ' ')} {_value(name, value)}" for name, value in known.items())


def _value(name: str, value: object) -> object:
    return utc(value) if name in _TIMES and isinstance(value, int) else value

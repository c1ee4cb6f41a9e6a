"""Texts of events: the fields of their payload in order."""

from collections.abc import Mapping
from typing import Any

from monitor.text.quantities import utc

_TIMES = ("alarm",)  # fields that are times [ns UTC]


def event_name(topic: str) -> str:
    """Return what happened."""
    return topic.rpartition("/")[2].replace("_", " ")


def event_said(payload: Mapping[str, Any], *, without: str = "") -> str:
    """Return what is known of it, but for a field that is said elsewhere; what is empty is left out."""
    known = {name: value for name, value in payload.items() if name != without and value not in ("", None)}
    return ", ".join(f"{name.replace('_', ' ')} {_value(name, value)}" for name, value in known.items())


def _value(name: str, value: object) -> object:
    return utc(value) if name in _TIMES and isinstance(value, int) else value

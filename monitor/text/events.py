"""Texts of events: as sentences, or the fields of their payload in order."""

from collections.abc import Mapping
from typing import Any

from monitor.text.quantities import utc

_SENTENCES = {
    "device_open": "device {device} has started",
    "device_failed": "device {device} is lost",
    "device_recovered": "device {device} samples again",
    "wrong_device": "another device is at the address of device {device}, which is lost",
    "device_warning": "warning of device {device}: {what}",
    "wrong_rate": "device {device} samples at {found:g} Hz, expected {expected:g} Hz",
    "gap": "missing scans of device {device}: {missing}",
    "log_file_lost": "another program has {how} the log file {file}",
    "log_deleted": "the log file {file} was deleted",
    "disk_low": "free space is below its limit: {free_gb:.3g} GB",
    "disk_recovered": "free space is above its limit again: {free_gb:.3g} GB",
    "recording_failed": "the log cannot be written",
    "recording_recovered": "the log is written again, with {kept} items that were kept in memory",
    "thread_failed": "the thread {thread} has failed and is restarted",
    "thread_recovered": "the thread {thread} works again",
    "acknowledge": "the alarm was acknowledged by {by}",
    "accept": "the change was accepted as {cause} by {by}",
    "accept_undone": "the last acceptance was undone by {by}",
    "refused": "the file {file} in the inbox is no command",
    "stopped": "the run has ended",
    "unclean_end": "the run before was killed, and its log is repaired",
    "reloaded": "other settings are in use: {changed}",
    "reload_refused": "the new settings are invalid",
    "clock_changed": "the clock of the host was set by {by_s:+.3g} s",
    "analysis_failed": "the analysis has failed and starts again in {again_in_s:.3g} s",
    "analysis_lagging": "the analysis is restarted, and {left_out_s:.0f} s of data are left out",
    "innovations_high": "signals deviate from the model near {frequency:.4g} Hz by {deviation:.1f} standard deviations",
    "windows_left_out": "windows are left out",
    "analysis_caught_up": "the analysis has caught up; {left_out} windows were left out",
    "baseline_reset": "a new baseline is learned",
    "device_replaced": "another device is at the address of device {device}",
    "channel_failed": "no valid data of the channels {channels}",
    "channel_recovered": "valid data of the channels {channels} again",
    "temperature_failed": "the thermometer gives no valid readings",
    "temperature_recovered": "the thermometer gives valid readings again",
    "history_failed": "the history cannot be written",
    "history_recovered": "the history is written again, with {brought_in} entries that were kept on disk",
    "history_renewed": "a new file of the history has begun",
    "history_restored": "{rows} rows of {of} are in the history again",
    "notice_failed": "notices to {to} fail",
    "notice_recovered": "notices to {to} arrive again",
    "home_assistant_failed": "the broker of Home Assistant is not available",
    "home_assistant_recovered": "the broker of Home Assistant is available again",
    "viewer_failed": "the live view has failed",
    "viewer_recovered": "the live view works again",
    "web_failed": "the pages are not served",
    "web_recovered": "the pages are served again",
}  # by the last part of the topic
_DETAILS = ("why", "note")  # fields that end a sentence, if they are given
_TIMES = ("alarm",)  # fields that are times [ns UTC]


def event_name(topic: str) -> str:
    """Return the name of an event."""
    return topic.rpartition("/")[2].replace("_", " ")


def event_text(payload: Mapping[str, Any]) -> str:
    """Return its payload as a text, without empty fields."""
    known = {name: value for name, value in payload.items() if value not in ("", None)}
    return ", ".join(f"{name.replace('_', ' ')} {field_value(name, value)}" for name, value in known.items())


def event_sentence(topic: str, payload: Mapping[str, Any]) -> str:
    """Return an event as a sentence; its name and fields if it is of another version or package."""
    pattern = _SENTENCES.get(topic.rpartition("/")[2], "")
    values = {**payload, "by": payload.get("by") or "a person", "cause": payload.get("cause") or "the new reference"}
    try:
        sentence = pattern.format_map(values)
    except (KeyError, ValueError):
        sentence = ""
    if not sentence:
        return f"{event_name(topic)} {event_text(payload)}".strip()
    details = [str(payload[name]) for name in _DETAILS if payload.get(name)]
    return ": ".join([sentence[0].upper() + sentence[1:], *details])


def field_value(name: str, value: object) -> object:
    """Return a field of an event; a time as text."""
    return utc(value) if name in _TIMES and isinstance(value, int) else value

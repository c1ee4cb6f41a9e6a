"""SITE.toml as it is attached to logs and shown in reports: what a replay needs, and nothing that may be a secret."""

import tomllib
from typing import Any

import tomlkit

from monitor.redaction import redacted_topic


def attachable(text: str) -> str:
    """Return settings without targets of notices, address of the history, login and topic of MQTT, and comments.

    A replay sends no notices and writes no history. Comments go because they may hold an earlier address. Text that is
    no TOML becomes empty. The function leaves its own result as it is.

    Parameters
    ----------
    text : of SITE.toml, with what overrides it; also as logs of earlier versions hold it
    """
    try:
        content = tomllib.loads(text)
    except ValueError:
        return ""
    content.pop("notify", None)
    _drop(content, "history", "url")
    temperature = content.get("temperature")
    if isinstance(temperature, dict) and "mqtt" in temperature:
        temperature["mqtt"] = redacted_topic(str(temperature["mqtt"]))
    return tomlkit.dumps(content)


def _drop(content: dict[str, Any], section: str, setting: str) -> None:
    """Drop a setting, and its section if nothing else is in it or it is no table."""
    table = content.get(section)
    if isinstance(table, dict):
        table.pop(setting, None)
    if not (isinstance(table, dict) and table):
        content.pop(section, None)

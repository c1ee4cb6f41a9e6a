"""Settings as attached to logs and shown in reports: what a replay needs, without secrets."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import tomlkit

from daq.bounded_text import parse_toml
from monitor.errors import SettingsError
from monitor.settings.reading import parse_settings
from monitor.settings.redaction import redacted_topic
from monitor.settings.schema import Settings

if TYPE_CHECKING:
    from updater import Structure


def parse_attached(text: str, path: Path | str = "SITE.toml") -> Settings:
    """Read settings for an analysis: targets of notices and states, and the history, are neither read nor checked.

    Settings attached to a log are not trusted: anyone may have written them, and templates in them are programs.

    Raises
    ------
    SettingsError
        As for `parse_settings`.
    """
    try:
        parse_toml(text)
    except ValueError as error:
        raise SettingsError(path, str(error)) from error
    return parse_settings(attachable(text), path)


def attached_structure(text: str, source: str = "structure.toml") -> "Structure | None":
    """Return the structure of the text that is attached to a log; None for an empty one: the site has none.

    Raises
    ------
    StructureError
        Naming the source, if it cannot be used.
    """
    if not text:
        return None
    from updater import parse_structure  # slow to import

    return parse_structure(text, source)


def has_settings(attached: Mapping[str, str]) -> bool:
    """Return whether the attachments of a log have settings, and the structure file if these name one."""
    if "structure.toml" in attached:
        return "site.toml" in attached
    try:
        return "site.toml" in attached and "structure" not in parse_toml(attached["site.toml"])
    except ValueError:
        return True  # reading them raises the error


def attachable(text: str) -> str:
    """Return settings without targets of notices and states, history's address, login and topic of MQTT, and comments.

    A replay sends no notices and writes no history. Comments go because they may hold an earlier address. Text that is
    no TOML becomes empty. The function leaves its own result as it is.

    Parameters
    ----------
    text : of SITE.toml, with overrides; also as in logs of earlier versions
    """
    try:
        content = parse_toml(text)
    except ValueError:
        return ""
    content.pop("notify", None)
    content.pop("home_assistant", None)
    table = content.get("history")
    if isinstance(table, dict):
        table.pop("url", None)
    if not (isinstance(table, dict) and table):
        content.pop("history", None)
    temperature = content.get("temperature")
    if isinstance(temperature, dict) and "mqtt" in temperature:
        temperature["mqtt"] = redacted_topic(str(temperature["mqtt"]))
    return tomlkit.dumps(content)

"""SITE.toml: schema, reading, overrides, template."""

from monitor.settings.attached import attachable, attached_structure, has_settings, parse_attached
from monitor.settings.device import AXES, DeviceSettings
from monitor.settings.notify import HomeAssistantSettings, NotifySettings
from monitor.settings.overrides import Override, overridden, overrides
from monitor.settings.reading import load_settings, nearest, parse_settings, read_settings
from monitor.settings.schema import AnalysisSettings, RecorderSettings, Settings, TemperatureSettings
from monitor.settings.template import EXAMPLE, annotated, json_schema

__all__ = [
    "AXES",
    "EXAMPLE",
    "AnalysisSettings",
    "DeviceSettings",
    "HomeAssistantSettings",
    "NotifySettings",
    "Override",
    "RecorderSettings",
    "Settings",
    "TemperatureSettings",
    "annotated",
    "attachable",
    "attached_structure",
    "has_settings",
    "json_schema",
    "load_settings",
    "nearest",
    "overridden",
    "overrides",
    "parse_attached",
    "parse_settings",
    "read_settings",
]

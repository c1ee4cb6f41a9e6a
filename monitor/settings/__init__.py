"""SITE.toml: schema, reading, overrides, template."""

from monitor.settings.attached import attachable as attachable
from monitor.settings.attached import attached_structure as attached_structure
from monitor.settings.attached import has_settings as has_settings
from monitor.settings.attached import parse_attached as parse_attached
from monitor.settings.device import AXES as AXES
from monitor.settings.device import DeviceSettings as DeviceSettings
from monitor.settings.notify import HomeAssistantSettings as HomeAssistantSettings
from monitor.settings.notify import NotifySettings as NotifySettings
from monitor.settings.overrides import Override as Override
from monitor.settings.overrides import overridden as overridden
from monitor.settings.overrides import overrides as overrides
from monitor.settings.reading import load_settings as load_settings
from monitor.settings.reading import parse_settings as parse_settings
from monitor.settings.reading import read_settings as read_settings
from monitor.settings.schema import AnalysisSettings as AnalysisSettings
from monitor.settings.schema import RecorderSettings as RecorderSettings
from monitor.settings.schema import Settings as Settings
from monitor.settings.schema import TemperatureSettings as TemperatureSettings
from monitor.settings.template import EXAMPLE as EXAMPLE
from monitor.settings.template import annotated as annotated
from monitor.settings.template import json_schema as json_schema

"""Messages of a site for Home Assistant: discovery of its entities, and their states.

References
----------
Home Assistant: MQTT discovery, https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from monitor.results.site_status import SiteStatus

ONLINE, OFFLINE = "online", "offline"
_STATES = ("learning", "normal", "watch", "alarm")
Config = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Topics:
    """Topics of one site."""

    base: str  #: unique per site at a broker
    discovery: str  #: prefix of the discovery topics

    @property
    def state(self) -> str:
        """Topic of the states, one JSON object."""
        return f"{self.base}/state"

    @property
    def availability(self) -> str:
        """Topic of the connection: online or offline."""
        return f"{self.base}/availability"

    @property
    def report(self) -> str:
        """Topic of the report for pages of many sites."""
        return f"{self.base}/site"

    @property
    def identity(self) -> str:
        """Identity of the site in Home Assistant."""
        return re.sub(r"[^A-Za-z0-9_-]", "_", self.base)

    def config(self, component: str, key: str) -> str:
        """Return the topic of the discovery of an entity."""
        return f"{self.discovery}/{component}/{self.identity}/{key}/config"


def site_configs(topics: Topics, site: str) -> dict[str, Config]:
    """Return the discovery of the entities that every site has, by topic."""
    connectivity = {
        "name": "Connectivity",
        "device_class": "connectivity",
        "state_topic": topics.availability,
        "payload_on": ONLINE,
        "payload_off": OFFLINE,
        "entity_category": "diagnostic",
    }
    alarm = "{{ 'ON' if value_json.state == 'alarm' else 'OFF' }}"
    number = {"state_class": "measurement"}
    temperature = number | {"device_class": "temperature", "unit_of_measurement": "°C"}
    entities = (
        ("binary_sensor", "alarm", {"name": "Alarm", "device_class": "problem"} | _state(topics, alarm)),
        (
            "sensor",
            "state",
            {"name": "State", "device_class": "enum", "options": list(_STATES)}
            | _state(topics, "{{ value_json.state }}"),
        ),
        ("sensor", "novelty", {"name": "Novelty over limit"} | number | _state(topics, "{{ value_json.novelty }}")),
        (
            "sensor",
            "temperature",
            {"name": "Temperature"} | temperature | _state(topics, "{{ value_json.temperature }}"),
        ),
        ("binary_sensor", "connectivity", connectivity),
    )
    return dict(_config(topics, site, *entity) for entity in entities)


def mode_configs(topics: Topics, site: str, modes: Iterable[int]) -> dict[str, Config]:
    """Return the discovery of the frequencies of modes, by topic."""
    return dict(_mode_configs(topics, site, modes))


def _mode_configs(topics: Topics, site: str, modes: Iterable[int]) -> Iterator[tuple[str, Config]]:
    for mode in modes:
        frequency = {
            "name": f"Frequency of mode {mode}",
            "device_class": "frequency",
            "unit_of_measurement": "Hz",
            "state_class": "measurement",
            "suggested_display_precision": 3,
        }
        template = f"{{{{ value_json.modes['{mode}'] | default(none) }}}}"  # a mode may be missing in a window
        yield _config(topics, site, "sensor", f"mode_{mode}", frequency | _state(topics, template))


def _state(topics: Topics, template: str) -> Config:
    """Return the part of an entity that has its value in the states, and is unavailable with the monitor."""
    return {
        "state_topic": topics.state,
        "value_template": template,
        "availability_topic": topics.availability,
        "payload_available": ONLINE,
        "payload_not_available": OFFLINE,
    }


def _config(topics: Topics, site: str, component: str, key: str, entity: Config) -> tuple[str, Config]:
    device = {"identifiers": [topics.identity], "name": site, "manufacturer": "modalwatch", "model": "monitor"}
    common = {"unique_id": f"{topics.identity}_{key}", "device": device, "origin": {"name": "modalwatch"}}
    return topics.config(component, key), entity | common


def states(status: SiteStatus) -> dict[str, Any]:
    """Return the states of all entities; unknown values are None."""
    window = status.window
    level = window.novelty.level if window and window.novelty else math.nan
    readings = [device.temperature for device in status.devices.values() if device.temperature is not None]
    own = fmean(readings) if readings else None
    return {
        "state": status.state,
        "novelty": round(level, 4) if math.isfinite(level) else None,
        "temperature": own if status.temperature is None else status.temperature,
        "modes": {str(mode): found.frequency for mode, found in (window.tracked if window else {}).items()},
        "window_end": window.end if window else None,
    }

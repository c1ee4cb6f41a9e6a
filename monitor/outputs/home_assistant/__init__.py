"""Entities of a site in Home Assistant, by MQTT discovery."""

from monitor.outputs.home_assistant.publisher import HomeAssistant as HomeAssistant

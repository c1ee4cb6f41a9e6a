"""Client of an MQTT broker, made from its address. paho-mqtt is an extra."""

import ssl
from collections.abc import Callable
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from paho.mqtt.client import Client

_PORTS = {"mqtt": 1883, "mqtts": 8883}


class MqttMissingError(MonitorError):
    """paho-mqtt is not installed."""

    def __init__(self) -> None:
        super().__init__("paho-mqtt is not installed: pip install 'modalwatch[fleet]'")


def mqtt_client(address: str, tls: ssl.SSLContext | None = None) -> "Client":
    """Return a client with login and TLS of an address, not connected yet.

    Parameters
    ----------
    address : mqtt://USER:PASSWORD@HOST:PORT/TOPIC, or mqtts:// with TLS
    tls : context of the TLS connection. Default: one with the certificates of the system

    Raises
    ------
    MqttMissingError
        If paho-mqtt is not installed.
    """
    try:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise MqttMissingError from error
    place, client = urlsplit(address), Client(CallbackAPIVersion.VERSION2)
    if place.username is not None:
        client.username_pw_set(unquote(place.username), unquote(place.password or ""))
    if place.scheme == "mqtts":
        client.tls_set_context(tls or ssl.create_default_context())
    return client


def on_answer(client: "Client", answered: Callable[[str], None]) -> None:
    """Have a function called with each answer of the broker: the reason of a refusal, empty if it accepts."""
    from paho.mqtt.reasoncodes import ReasonCode  # an extra

    def connected(_client: object, _data: object, _flags: object, reason: ReasonCode, _properties: object) -> None:
        answered(str(reason) if reason.is_failure else "")

    client.on_connect = connected


def mqtt_connect(client: "Client", address: str, keepalive_seconds: int = 60) -> None:
    """Connect a client to the broker of an address.

    Raises
    ------
    OSError, ValueError
        If that fails.
    """
    place = urlsplit(address)
    client.connect(place.hostname or "", place.port or _PORTS[place.scheme], keepalive_seconds)


def mqtt_topic(address: str) -> str:
    """Return the topic of an address; empty if it has none."""
    return unquote(urlsplit(address).path).strip("/")

"""The ways a notice goes out; each either delivers or raises `NoticeError`."""

import json
import os
import subprocess
import time
from collections.abc import Callable
from email.utils import parsedate_to_datetime
from typing import Any
from urllib.parse import unquote, urlsplit

import httpx

from monitor.errors import MonitorError
from monitor.notice_text import Message, Notice, message
from monitor.settings import NotifySettings

_MQTT_PORTS = {"mqtt": 1883, "mqtts": 8883}
Sender = Callable[[list[Notice], int], None]  #: of notices, and how many others there were


class NoticeError(MonitorError):
    """A notice that could not be delivered.

    Parameters
    ----------
    text : why
    wait : that the target asks for before it is tried again [s]
    """

    def __init__(self, text: str, wait: float = 0.0) -> None:
        super().__init__(text)
        self.wait = wait


def make_sender(target: NotifySettings) -> Sender:
    """Return what delivers notices, several at once as one message."""
    way = _by_webhook if target.webhook else _by_command if target.command else _by_mqtt

    def send(notices: list[Notice], others: int) -> None:
        try:
            way(target, message(notices, target.template, others))
        except ValueError as error:  # a zero byte for a program, a header that no server may be sent
            raise NoticeError(f"this cannot be sent: {error}") from error

    return send


def _content(said: Message) -> dict[str, Any]:
    """Return what programs read: the foremost notice's fields, `text` of all of them, and each one."""
    return said.foremost.values() | {"text": said.text, "notices": [notice.values() for notice in said.notices]}


def _by_webhook(target: NotifySettings, said: Message) -> None:
    seconds = target.timeout_seconds
    try:
        with httpx.stream(
            "POST", target.webhook or "", json=_content(said), headers=target.headers, timeout=seconds
        ) as answer:
            answer.raise_for_status()  # what else it says is not waited for: it may never end
    except httpx.HTTPStatusError as error:
        why = f"webhook: {error.response.status_code} {error.response.reason_phrase}"
        raise NoticeError(why, _wait(error.response.headers.get("Retry-After", ""))) from error
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise NoticeError(f"webhook: {type(error).__name__}: {error}") from error


def _wait(asked: str) -> float:
    """Return what `Retry-After` asks for [s]: a number, or a date; 0 for what is neither."""
    try:
        return float(asked) if asked.isdecimal() else parsedate_to_datetime(asked).timestamp() - time.time()
    except (ValueError, OverflowError, OSError):  # a year that no calendar has, or no clock
        return 0.0


def _by_command(target: NotifySettings, said: Message) -> None:
    values = said.foremost.values()
    named = {f"MODALWATCH_{name.upper()}": "" if value is None else str(value) for name, value in values.items()}
    try:
        subprocess.run(
            target.command or (),
            input=said.text.encode(),
            env=os.environ | named,
            timeout=target.timeout_seconds,
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise NoticeError(f"command: {error}") from error


def _by_mqtt(target: NotifySettings, said: Message) -> None:
    try:
        from paho.mqtt import MQTTException  # an extra
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion
        from paho.mqtt.reasoncodes import ReasonCode
    except ImportError as error:
        raise NoticeError("mqtt: paho-mqtt is not installed: pip install 'modalwatch[fleet]'") from error
    place = urlsplit(target.mqtt or "")
    refused = ""

    def connected(_client: Client, _data: object, _flags: object, reason: ReasonCode, _more: object) -> None:
        nonlocal refused
        refused = f"the broker refuses: {reason}" if reason.is_failure else ""

    client = Client(CallbackAPIVersion.VERSION2)
    client.on_connect = connected
    client.connect_timeout = target.timeout_seconds
    if place.username is not None:
        client.username_pw_set(unquote(place.username), unquote(place.password or ""))
    if place.scheme == "mqtts":
        client.tls_set()
    try:
        client.connect(place.hostname or "", place.port or _MQTT_PORTS[place.scheme])
        client.loop_start()
        topic = unquote(place.path).strip("/") or "modalwatch"
        sent = client.publish(topic, json.dumps(_content(said)), qos=1)
        sent.wait_for_publish(target.timeout_seconds)
        if not sent.is_published():
            raise NoticeError(f"mqtt: {refused or f'the broker has not taken it within {target.timeout_seconds:g} s'}")
    except (OSError, ValueError, RuntimeError, MQTTException) as error:
        raise NoticeError(f"mqtt: {refused or error}") from error
    finally:
        client.disconnect()
        client.loop_stop()

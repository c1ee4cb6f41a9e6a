"""Transports of notices; each either delivers or raises `NoticeError`."""

import contextlib
import json
import os
import signal
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from itertools import chain
from typing import Any

from monitor.errors import MonitorError
from monitor.outputs.mqtt import MqttMissingError, mqtt_client, mqtt_connect, mqtt_topic, on_answer
from monitor.outputs.notices.deadline import Deadline, DeadlineRunner
from monitor.settings import NotifySettings
from monitor.settings.redaction import masked, revealed, secrets_of_address
from monitor.text.notices import Message, Notice, message

_LOOK_SECONDS = 0.05  # between looks at whether a broker has refused
Sender = Callable[[list[Notice], int], None]  #: function that sends notices, with the number of others


class NoticeError(MonitorError):
    """A notice that could not be delivered.

    Parameters
    ----------
    text : why
    wait : requested by the target before the next attempt [s]
    """

    def __init__(self, text: str, wait: float = 0.0) -> None:
        super().__init__(text)
        self.wait = wait


def make_sender(target: NotifySettings) -> Sender:
    """Return the function that delivers notices, several at once as one message."""
    name, way = (
        ("webhook", _by_webhook)
        if target.webhook
        else ("command", _by_command)
        if target.command
        else ("mqtt", _by_mqtt)
    )
    runner = DeadlineRunner()

    def send(notices: list[Notice], others: int) -> None:
        notice_message = message(notices, target.template, others)
        try:
            runner.run(target.timeout_seconds, lambda deadline: way(target, notice_message, deadline))
        except TimeoutError as error:
            raise NoticeError(f"{name}: {error}") from error
        except ValueError as error:  # a zero byte for a program, a header that no server may be sent
            raise NoticeError(f"this cannot be sent: {_error_message(error, target)}") from None

    return send


def _error_message(error: Exception, target: NotifySettings) -> str:
    """Return the text of an error without parts of addresses and headers."""
    values = [revealed(value) for value in target.headers.values()]
    addresses = map(revealed, filter(None, (target.webhook, target.mqtt)))
    parts = chain.from_iterable(map(secrets_of_address, addresses))
    return masked(str(error), (*values, *(value.rpartition(" ")[2] for value in values), *parts))


def _content(notice_message: Message) -> dict[str, Any]:
    """Return the content for programs: the foremost notice's fields, `text` of all of them, and each one."""
    return notice_message.foremost.values() | {
        "text": notice_message.text,
        "notices": [notice.values() for notice in notice_message.notices],
    }


def _by_webhook(target: NotifySettings, notice_message: Message, deadline: Deadline) -> None:
    import httpx  # a tenth of the time of a start, and few monitors have a webhook

    headers = {name: revealed(value) for name, value in target.headers.items()}

    def trace(event: str, info: Mapping[str, Any]) -> None:
        if event == "connection.connect_tcp.complete":
            deadline.watch(info["return_value"].get_extra_info("socket").fileno())

    try:
        with (
            httpx.Client(timeout=deadline.seconds) as client,
            client.stream(
                "POST",
                revealed(target.webhook),
                json=_content(notice_message),
                headers=headers,
                extensions={"trace": trace},
            ) as answer,
        ):
            answer.raise_for_status()  # the rest of the reply is not waited for: it may never end
    except httpx.HTTPStatusError as error:
        code = error.response.status_code  # the server's own phrase is not repeated: it may quote the request
        phrase = f" {HTTPStatus(code).phrase}" if code in set(HTTPStatus) else ""
        raise NoticeError(f"webhook: {code}{phrase}", _wait(error.response.headers.get("Retry-After", ""))) from None
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise NoticeError(f"webhook: {type(error).__name__}: {_error_message(error, target)}") from None


def _wait(asked: str) -> float:
    """Return the wait requested by `Retry-After` [s]: a number, or a date; 0 for anything else."""
    try:
        return float(asked) if asked.isdecimal() else parsedate_to_datetime(asked).timestamp() - time.time()
    except (ValueError, OverflowError, OSError):  # a year that no calendar has, or no clock
        return 0.0


def _by_command(target: NotifySettings, notice_message: Message, deadline: Deadline) -> None:
    values = notice_message.foremost.values()
    named = {f"MODALWATCH_{name.upper()}": "" if value is None else str(value) for name, value in values.items()}
    try:
        process = subprocess.Popen(
            [revealed(word) for word in target.command or ()],
            env=os.environ | named,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # a shell that is ended ends with all that it has started
        )
    except OSError as error:  # its text may name the program
        raise NoticeError(f"command: cannot be started: {error.strerror}") from None
    with process:
        deadline.on_expiry(lambda: _end(process))
        process.communicate(notice_message.text.encode())
    if process.returncode:
        raise NoticeError(f"command: exit status {process.returncode}")


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)


def _watched_tls(deadline: Deadline, made: ExitStack) -> ssl.SSLContext:
    """Return the TLS context of connections whose handshake is also under the deadline; `made` closes them."""

    class Watched(ssl.SSLContext):
        def wrap_socket(self, sock: socket.socket, *rest: Any, **more: Any) -> ssl.SSLSocket:  # noqa: ANN401
            deadline.watch(sock.fileno())
            return made.enter_context(super().wrap_socket(sock, *rest, **more))

    context = Watched(ssl.PROTOCOL_TLS_CLIENT)
    context.load_default_certs()
    return context


def _by_mqtt(target: NotifySettings, notice_message: Message, deadline: Deadline) -> None:
    address, made = revealed(target.mqtt), ExitStack()
    try:
        client = mqtt_client(address, _watched_tls(deadline, made) if address.startswith("mqtts:") else None)
    except MqttMissingError as error:
        raise NoticeError(f"mqtt: {error}") from error
    from paho.mqtt import MQTTException  # an extra

    refused = ""

    def answered(reason: str) -> None:
        nonlocal refused
        refused = f"the broker refuses: {reason}" if reason else ""

    on_answer(client, answered)
    client.on_socket_open = lambda _client, _data, connection: deadline.watch(connection.fileno())
    client.connect_timeout = deadline.seconds
    try:
        mqtt_connect(client, address)
        client.loop_start()
        sent = client.publish(mqtt_topic(address) or "modalwatch", json.dumps(_content(notice_message)), qos=1)
        while not (sent.is_published() or refused) and deadline.remaining:
            sent.wait_for_publish(min(_LOOK_SECONDS, deadline.remaining))
        if not sent.is_published():
            raise NoticeError(f"mqtt: {refused or 'the broker has not taken it'}")
    except (OSError, ValueError, RuntimeError, MQTTException) as error:
        raise NoticeError(f"mqtt: {refused or _error_message(error, target)}") from None
    finally:
        client.disconnect()
        client.loop_stop()
        made.close()

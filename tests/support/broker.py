"""A real MQTT broker on loopback (Mosquitto), and a subscriber."""

import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from tests.support.processes import server_process

PROGRAM = shutil.which("mosquitto", path="/usr/local/sbin:/usr/sbin:/usr/local/bin:/usr/bin")
needs_broker = pytest.mark.skipif(PROGRAM is None, reason="mosquitto is not installed")
USER, PASSWORD = "ada", "Hush7Secret"


@contextmanager
def broker(folder: Path, port: int, *, login: bool = False) -> Iterator[None]:
    """Run a broker for as long as the context lasts; it keeps nothing on disk."""
    assert PROGRAM is not None
    lines = [
        f"listener {port} 127.0.0.1",
        "persistence false",
        "user root",
        f"allow_anonymous {str(not login).lower()}",
    ]
    if login:
        subprocess.run(["mosquitto_passwd", "-b", "-c", folder / "passwords", USER, PASSWORD], check=True)
        lines.append(f"password_file {folder / 'passwords'}")
    (folder / "mosquitto.conf").write_text("\n".join(lines) + "\n")
    with server_process([PROGRAM, "-c", "mosquitto.conf"], folder) as output:
        end = time.monotonic() + 10.0
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), 1.0).close()
                break
            except OSError:
                assert time.monotonic() < end, output.read_text()
                time.sleep(0.05)
        yield


class Subscriber:
    """Receives all messages of a broker."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, str]] = []
        self.retained: dict[str, str] = {}  #: of before the subscription
        self._client = Client(CallbackAPIVersion.VERSION2)
        self._client.on_message = self._take

    def _take(self, _client: Client, _data: object, message: MQTTMessage) -> None:
        payload = message.payload.decode()
        if message.retain:
            self.retained[message.topic] = payload
        self.messages.append((message.topic, payload))

    @contextmanager
    def connected(self, port: int) -> "Iterator[Subscriber]":
        self._client.connect("127.0.0.1", port)
        self._client.subscribe("#", qos=1)
        self._client.loop_start()
        try:
            yield self
        finally:
            self._client.disconnect()
            self._client.loop_stop()

    def of(self, topic: str) -> list[str]:
        """Return the payloads of a topic in their order."""
        return [payload for name, payload in list(self.messages) if name == topic]

    def until(self, true: Callable[[], object], seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, self.messages
            time.sleep(0.02)

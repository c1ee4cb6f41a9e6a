"""Targets that are slow on purpose: one deadline for a whole delivery, and nothing waits behind one that hangs."""

import json
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from daq import Event
from monitor.outputs.notices import NoticeError, NoticeSender, make_sender
from monitor.outputs.notices.deadline import DeadlineRunner
from monitor.settings import NotifySettings
from tests.support.monitor.notices import ALARM, NOTICE, Server, until

LOST = Event(topic="/event/device_failed", time=1, payload={"device": "left"})
LIMIT, MARGIN = 0.4, 0.6  # s: of a delivery; of a busy machine beside the runner's grace


@contextmanager
def trickling(answer: bytes, every: float = 0.05) -> Iterator[int]:
    """Accept connections and send a byte at a time, for ever: no pause between two bytes is as long as the limit."""
    listener, ending = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def serve(connection: socket.socket) -> None:
        with connection:
            for k in range(10**6):
                try:
                    connection.sendall(answer[k % len(answer)].to_bytes(1, "big"))
                except OSError:
                    return
                if ending.wait(every):
                    return

    def take() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=serve, args=(connection,), daemon=True).start()

    threading.Thread(target=take, daemon=True).start()
    try:
        yield listener.getsockname()[1]
    finally:
        ending.set()
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


HEADERS = b"HTTP/1.1 200 OK\r\n" + b"X-More: x\r\n" * 10_000
HANDSHAKE = bytes((22, 3, 3, 63, 255)) + bytes(16_383)  # of TLS: a record whose end never comes
TARGETS = {
    "headers": (HEADERS, "http://127.0.0.1:{}/x"),
    "status": (b"HTTP/1.1 200 " + b"x" * 60_000, "http://127.0.0.1:{}/x"),
    "handshake": (HANDSHAKE, "https://127.0.0.1:{}/x"),
    "broker": (b"\x20\x02\x00\x00" + b"\xd0\x00" * 100, "mqtt://127.0.0.1:{}/x"),
    "broker's handshake": (HANDSHAKE, "mqtts://127.0.0.1:{}/x"),
}


@pytest.mark.parametrize("kind", TARGETS)
def test_slow_byte_by_byte_response_is_aborted_at_the_deadline(kind: str) -> None:
    """Each byte restarts the time limit of a socket; the deadline is of the whole delivery, and leaves no thread."""
    answer, url = TARGETS[kind]
    before = threading.active_count()
    with trickling(answer) as port:
        way = "mqtt" if url.startswith("mqtt") else "webhook"
        target = NotifySettings.model_validate({way: url.format(port), "timeout_seconds": LIMIT})
        begun = time.monotonic()
        with pytest.raises(NoticeError, match=r"not delivered within|has not taken it"):
            make_sender(target)([NOTICE], 0)
        assert time.monotonic() - begun < LIMIT + MARGIN
        until(lambda: threading.active_count() <= before + 2)  # the server's


def test_timed_out_command_is_ended_with_its_child_processes(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    script = f"import subprocess, sys; p = subprocess.Popen(['sleep', '60']); open({str(pid)!r}, 'w').write(str(p.pid))"
    target = NotifySettings(command=(sys.executable, "-c", f"{script}; p.wait()"), timeout_seconds=1.0)
    with pytest.raises(NoticeError, match=r"not delivered within 1 s"):
        make_sender(target)([NOTICE], 0)
    status = Path(f"/proc/{pid.read_text()}/stat")
    until(lambda: not status.exists() or status.read_text().split()[2] == "Z")


def test_number_of_abandoned_deliveries_is_limited() -> None:
    """A look-up of a name takes as long as it takes."""
    release, runner = threading.Event(), DeadlineRunner()
    try:
        for _ in range(8):
            with pytest.raises(TimeoutError, match="not delivered within"):
                runner.run(0.0, lambda _: _wait(release))
        with pytest.raises(TimeoutError, match="8 earlier deliveries have not ended"):
            runner.run(0.0, lambda _: None)
    finally:
        release.set()
    delivered: list[int] = []
    until(lambda: not delivered and _tried(lambda: runner.run(1.0, lambda _: delivered.append(1))))
    assert delivered == [1]


def _wait(event: threading.Event) -> None:
    event.wait()


def _tried(action: Callable[[], None]) -> bool:
    try:
        action()
    except TimeoutError:
        return False
    return True


def test_alarm_is_not_delayed_by_trouble_notices_or_other_targets(tmp_path: Path) -> None:
    """A server that delays the first request and responds to the others; another target that hangs."""
    listener = socket.create_server(("127.0.0.1", 0))
    kinds: list[str] = []

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=take, args=(connection,), daemon=True).start()

    def take(connection: socket.socket) -> None:
        with connection, connection.makefile("rb") as stream:
            length = 0
            while (line := stream.readline()) not in (b"\r\n", b""):
                if line.lower().startswith(b"content-length:"):
                    length = int(line.split(b":")[1])
            kinds.append(json.loads(stream.read(length))["kind"])
            if kinds[-1] == "alarm":
                connection.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")
            else:
                time.sleep(3.0)

    threading.Thread(target=serve, daemon=True).start()
    held = NotifySettings(webhook=f"http://127.0.0.1:{listener.getsockname()[1]}/x", timeout_seconds=3.0)
    with listener, trickling(HEADERS) as port:
        hung = NotifySettings(webhook=f"http://127.0.0.1:{port}/x", timeout_seconds=3.0)
        first, second = (
            NoticeSender(target, tmp_path / f"{k}.jsonl", "bridge") for k, target in enumerate((hung, held))
        )
        for sender in (first, second):
            sender.__enter__()
        for sender in (first, second):
            sender.put(LOST)
        until(lambda: kinds == ["trouble"])
        for sender in (first, second):
            sender.put(ALARM)
        begun = time.monotonic()
        until(lambda: "alarm" in kinds)
        assert time.monotonic() - begun < 1.0
        for sender in (first, second):
            sender.stop()


def test_alarm_without_a_writable_spool_is_delivered_from_memory(tmp_path: Path) -> None:
    """The state folder is a file: nothing can be written there."""
    (tmp_path / "state").write_text("")
    with (
        Server().running() as server,
        NoticeSender(
            NotifySettings(webhook=server.url), tmp_path / "state" / "n.jsonl", "bridge", retry_seconds=0.1
        ) as sender,
    ):
        server.answer = 503
        sender.put(ALARM)
        until(lambda: sender.problem)
        server.answer = 200
        until(lambda: server.got)
    assert server.got[0]["kind"] == "alarm"

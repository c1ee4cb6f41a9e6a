"""Notices after years: templates that fail, targets that were away for long, answers that never end."""

import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from daq import Event
from monitor.outputs.notices import NoticeSender, make_sender
from monitor.results.service_events import NoticeFailed, NoticeRecovered
from monitor.settings import NotifySettings
from monitor.text.notice_template import TemplateFailure
from monitor.text.notices import message, render
from tests.support.daq.blocks import make_block
from tests.support.monitor.history import change
from tests.support.monitor.notices import ALARM, NOTICE, Server, until


@pytest.fixture
def server() -> Iterator[Server]:
    with Server().running() as made:
        yield made


def test_template_cannot_access_python_internals() -> None:
    """It is text from a file: it may not reach into the interpreter."""
    with pytest.raises(TemplateFailure, match="unsafe"):
        render([NOTICE], "{{ notices.__class__.__mro__ }}")


def test_failing_template_is_replaced_by_the_plain_text(server: Server, tmp_path: Path) -> None:
    """Such content comes for the first time years after the settings were read: the notice must still be sent."""
    server.answer = 503
    template = "{% if notices|length > 1 %}{{ notice.nothing }}{% else %}{{ notice.text }}{% endif %}"
    target = NotifySettings(webhook=server.url, template=template)
    with NoticeSender(target, tmp_path / "n.jsonl", "bridge", retry_seconds=0.05) as sender:
        sender.put(ALARM)
        sender.put(change(20, "normal", "over", lasted=10.0))
        until(lambda: (tmp_path / "n.jsonl").exists() and len((tmp_path / "n.jsonl").read_text().splitlines()) == 2)
        server.answer = 200
        until(lambda: server.got)
    assert "ALARM: a mass" in server.got[0]["text"]
    assert "has no attribute 'nothing'" in server.got[0]["text"]


def test_undeliverable_notice_does_not_block_later_ones(tmp_path: Path) -> None:
    """A name with a zero byte fits into no environment of a program."""
    script = "import os, sys; open(sys.argv[1], 'a').write(os.environ['MODALWATCH_TEXT'] + '|')"
    target = NotifySettings(command=(sys.executable, "-c", script, str(tmp_path / "got")))
    with NoticeSender(target, tmp_path / "n.jsonl", "bridge", retry_seconds=0.05) as sender:
        sender.put(change(10, "alarm", "ALARM: a \0 mass"))
        until(lambda: sender.problem)
        sender.put(change(20, "normal", "over", lasted=10.0))
        until(lambda: (tmp_path / "got").exists() and "over" in (tmp_path / "got").read_text())


@pytest.mark.parametrize(
    ("kinds", "index"),
    [
        (["alarm", "update", "trouble"], 0),
        (["alarm", "update", "recovery", "trouble"], 2),
        (["trouble", "update", "trouble"], 1),
        (["trouble", "trouble"], 1),
    ],
)
def test_message_fields_are_those_of_the_most_important_notice(kinds: list[Any], index: int) -> None:
    """A program that pages a person by `kind` alone, or a template of `notice` alone, must not miss the alarm."""
    reported = message([replace(NOTICE, kind=kind, text=str(k)) for k, kind in enumerate(kinds)], "{{ notice.text }}")
    assert (reported.foremost.text, reported.text) == (str(index), str(index))


def test_heartbeat_failure_is_cleared_by_the_next_success(server: Server, tmp_path: Path) -> None:
    """There may be no other notice for years: the page would report failing notices all the while."""
    server.answer = 503
    target = NotifySettings(webhook=server.url, heartbeat_minutes=0.005, events=())
    with NoticeSender(target, tmp_path / "n.jsonl", "bridge") as sender:
        sender.put(make_block("left", 0))
        until(lambda: sender.problem)
        server.answer = 200
        until(lambda: sender.problem is None)
    assert [type(event) for event in sender.events()] == [NoticeFailed, NoticeRecovered]


def test_alarm_is_sent_at_once_after_an_outage_of_the_target(server: Server, tmp_path: Path) -> None:
    server.answer = 503
    with NoticeSender(NotifySettings(webhook=server.url), tmp_path / "n.jsonl", "bridge", retry_seconds=60.0) as sender:
        sender.put(Event(topic="/event/device_failed", time=1, payload={"device": "left"}))
        until(lambda: sender.problem)
        server.answer = 200
        sender.put(ALARM)
        until(lambda: server.got)


def test_many_trouble_notices_make_one_short_separate_message(server: Server, tmp_path: Path) -> None:
    """Chat servers refuse long texts: one that grew while they were away would never be taken."""
    server.answer = 503
    spool = tmp_path / "n.jsonl"
    with NoticeSender(NotifySettings(webhook=server.url), spool, "bridge", retry_seconds=0.05) as sender:
        for k in range(20_000):
            sender.put(Event(topic="/event/device_failed", time=k, payload={"device": "left"}))
            if k == 7:
                sender.put(ALARM)
        until(lambda: sender.others.dropped)
        server.answer = 200
        until(lambda: sender.problem is None)
    alarm, got = sorted(server.got, key=lambda message: message["kind"])
    assert [notice["text"] for notice in alarm["notices"]] == ["ALARM: a mass"]
    assert len(got["text"]) < 4000
    stated = len(got["notices"])
    assert stated <= 200
    assert f"{20_000 - stated} others" in got["text"]
    assert list(tmp_path.iterdir()) == []


def test_webhook_with_an_endless_response_counts_as_delivered() -> None:
    """Its status is sufficient; the rest of the response is not read."""
    listener = socket.create_server(("127.0.0.1", 0))
    release = threading.Event()

    def drip() -> None:
        connection, _ = listener.accept()
        with listener, connection:
            connection.recv(65536)
            connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
            while not release.wait(0.02):
                connection.sendall(b"x")

    thread = threading.Thread(target=drip, daemon=True)
    thread.start()
    begun = time.monotonic()
    target = NotifySettings(webhook=f"http://127.0.0.1:{listener.getsockname()[1]}/", timeout_seconds=1.0)
    make_sender(target)([NOTICE], 0)
    assert time.monotonic() - begun < 5.0
    release.set()
    thread.join(5.0)

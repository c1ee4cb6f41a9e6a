"""Notices reach a real server, a program, an MQTT connection; those that fail are delivered later."""

import json
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from email.utils import formatdate
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from daq import Event
from monitor.outputs.notices import NoticeError, NoticeFilter, NoticeSender, make_sender
from monitor.results.service_events import NoticeFailed, NoticeRecovered
from monitor.settings import NotifySettings
from tests.support.daq.blocks import make_block
from tests.support.monitor.history import change, run_events
from tests.support.monitor.notices import ALARM, NOTICE, Server, until

LOST = Event(topic="/event/device_failed", time=1, payload={"device": "left"})
LAST: dict[str, Any] = {"extended_model": None, "next_measurement": ""}


@pytest.fixture
def server() -> Iterator[Server]:
    with Server().running() as made:
        yield made


def test_alarm_without_new_results_sends_one_notice() -> None:
    """A run that learns, watches and finds a mass; without a diagnosis there is nothing to add to the alarm."""
    news = NoticeFilter("bridge")
    stated = [notice for event in run_events() if (notice := news.of(event))]
    assert [(notice.kind, notice.alarm == notice.time) for notice in stated] == [("alarm", True)]


def test_changed_cause_in_the_diagnosis_sends_an_update() -> None:
    """The window that raises the alarm precedes it and is part of its notice; then a figure, then the cause changes."""
    alarmed = next(e for e in run_events() if e.payload.get("phase") == "alarm")

    def window(cause: str, mass: float) -> Event:
        found = {"cause": cause, "probability": 1.0, "where": None, "cannot_be_told_from": []}
        found |= {"parameters": {"mass": {"value": mass, "std": 0.01, "unit": "kg"}}}
        diagnosis = {"verdict": "explained", "causes": [found], "rejected": [], "modes": [], "gain": None}
        return replace(alarmed, payload=alarmed.payload | {"diagnosis": diagnosis | LAST})

    news = NoticeFilter("bridge")
    events = [window("added_mass", 0.2), ALARM, window("added_mass", 0.21), window("distributed_mass", 0.2)]
    assert [notice.kind for event in events if (notice := news.of(event))] == ["alarm", "update"]
    resumed = change(20, "alarm", kind="resumed", quiet=True, since=10)  # by another analysis, or after a restart
    events = [resumed, window("distributed_mass", 0.21), window("added_mass", 0.2)]
    for stated in (news, NoticeFilter("bridge")):
        assert [notice.kind for event in events if (notice := stated.of(event))] == ["update"]


@pytest.mark.parametrize(
    ("events", "kinds"),
    [
        ([change(1, "watch"), change(2, "normal")], []),
        ([change(1, "normal", "baseline learned")], []),
        ([change(1, "alarm"), change(2, "normal", lasted=1.0)], ["alarm", "recovery"]),
        (
            [change(1, "alarm"), change(2, "alarm", kind="latched"), change(3, "normal")],
            ["alarm", "recovery", "recovery"],
        ),
        ([change(1, "alarm"), change(2, "alarm", kind="acknowledged")], ["alarm", "acknowledged"]),
        ([change(1, "alarm", quiet=True), change(2, "normal", lasted=1.0, quiet=True)], []),
        ([change(1, "alarm"), change(2, "alarm", kind="reopened", quiet=True)], ["alarm"]),
        ([change(1, "alarm"), change(2, "alarm", kind="changed_again")], ["alarm", "alarm"]),
        ([change(1, "alarm"), change(2, "alarm", kind="changing", quiet=True)], ["alarm"]),
        ([change(1, "alarm", kind="flapping"), change(2, "normal", kind="steady")], ["flapping", "flapping"]),
        ([LOST], ["trouble"]),
        ([Event(topic="/event/gap", time=1, payload={"device": "left"}), make_block("left", 0)], []),
    ],
)
def test_events_and_their_notices(events: list[Event], kinds: list[str]) -> None:
    news = NoticeFilter("bridge")
    assert [notice.kind for event in events if (notice := news.of(event))] == kinds


def test_windows_without_a_usable_result_and_recovery_each_send_one_notice() -> None:
    """Sensors that are mounted on nothing send data all the while: no device is lost, and no window overdue."""
    good = next(e for e in run_events() if e.payload.get("phase") == "watching" and e.payload.get("novelty"))
    bad = replace(good, payload=good.payload | {"novelty": None, "modes": [], "problem": "no resonance stands out"})
    news = NoticeFilter("bridge")
    stated = [news.of(event) for event in (good, bad, bad, good, bad, bad, bad, bad, bad, good, good)]
    assert [i for i, notice in enumerate(stated) if notice] == [6, 9]
    assert "no usable result from the last 3 windows: no resonance stands out" in stated[6].text  # type: ignore[union-attr]
    assert "again, after 5 without" in stated[9].text  # type: ignore[union-attr]


def test_repeated_failure_of_an_optional_analysis_sends_one_notice() -> None:
    news = NoticeFilter("bridge")
    events = [change(k, "alarm", text, kind="failed", quiet=True) for k, text in enumerate("aab")]
    assert [bool(news.of(event)) for event in events] == [True, False, True]


def test_webhook_gets_json_with_headers(server: Server) -> None:
    make_sender(NotifySettings(webhook=server.url, headers={"Authorization": "Bearer x"}))([NOTICE, NOTICE], 0)
    [got] = server.got
    assert (got["text"], got["kind"], got["alarm"]) == ("bridge, then: 200 g\nbridge, then: 200 g", "alarm", 4)
    assert len(got["notices"]) == 2
    assert server.headers[0]["Authorization"] == "Bearer x"


def test_command_gets_text_and_fields(tmp_path: Path) -> None:
    script = "import os, sys; open(sys.argv[1], 'w').write(os.environ['MODALWATCH_KIND'] + '|' + sys.stdin.read())"
    target = NotifySettings(
        command=(sys.executable, "-c", script, str(tmp_path / "got")), template="{{ notice.text }}!"
    )
    make_sender(target)([NOTICE], 0)
    assert (tmp_path / "got").read_text() == "alarm|200 g!"


def broker(answer: bool, got: list[bytes], refusal: int = 0) -> tuple[int, threading.Thread]:
    """Speak as much MQTT 3.1.1 as one message at QoS 1 needs: CONNACK, with a reason to refuse or none, and PUBACK."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = listener.accept()
        connection.settimeout(5.0)
        with listener, connection, connection.makefile("rb") as stream:
            while kind := stream.read(1):
                length, shift = 0, 0
                while True:
                    byte = stream.read(1)[0]
                    length |= (byte & 0x7F) << shift
                    shift += 7
                    if byte < 0x80:
                        break
                body = stream.read(length)
                if kind[0] >> 4 == 1:
                    connection.sendall(bytes((0x20, 2, 0, refusal)))
                elif kind[0] >> 4 == 3 and answer:
                    topic = struct.unpack(">H", body[:2])[0]
                    got.extend([body[2 : 2 + topic], body[4 + topic :]])
                    connection.sendall(b"\x40\x02" + body[2 + topic : 4 + topic])

    listener.settimeout(5.0)
    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    return listener.getsockname()[1], thread


def test_mqtt_delivery_waits_for_the_acknowledgement() -> None:
    got: list[bytes] = []
    port, thread = broker(answer=True, got=got)
    make_sender(NotifySettings(mqtt=f"mqtt://127.0.0.1:{port}/site/alarms"))([NOTICE], 0)
    thread.join(5.0)
    assert got[0] == b"site/alarms"
    assert json.loads(got[1])["text"] == "bridge, then: 200 g"


def test_unresponsive_mqtt_broker_times_out() -> None:
    port, thread = broker(answer=False, got=[])
    with pytest.raises(NoticeError, match=r"not delivered within 0\.3 s|has not taken it"):
        make_sender(NotifySettings(mqtt=f"mqtt://127.0.0.1:{port}/x", timeout_seconds=0.3))([NOTICE], 0)
    thread.join(5.0)


def test_mqtt_refusal_is_reported_with_its_reason() -> None:
    port, thread = broker(answer=False, got=[], refusal=5)
    with pytest.raises(NoticeError, match="mqtt: the broker refuses: Not authorized"):
        make_sender(NotifySettings(mqtt=f"mqtt://127.0.0.1:{port}/x", timeout_seconds=2.0))([NOTICE], 0)
    thread.join(5.0)


@pytest.mark.parametrize(
    ("target", "says"),
    [
        (NotifySettings(webhook="http://127.0.0.1:1/x"), "webhook: ConnectError"),
        (NotifySettings(command=("/nowhere/program",)), "command: cannot be started: No such file"),
        (NotifySettings(command=(sys.executable, "-c", "raise SystemExit(3)")), "command: exit status 3"),
        (
            NotifySettings(
                command=(sys.executable, "-c", "input() or 1; import time; time.sleep(9)"), timeout_seconds=0.2
            ),
            "timed out",
        ),
        (NotifySettings(mqtt="mqtt://127.0.0.1:1/x"), "mqtt: .*refused"),
    ],
)
def test_failed_delivery_is_reported_with_its_reason(target: NotifySettings, says: str) -> None:
    with pytest.raises(NoticeError, match=says):
        make_sender(target)([NOTICE], 0)


def test_notices_of_an_outage_are_sent_later_in_one_message(server: Server, tmp_path: Path) -> None:
    server.answer = 503
    target, spool = NotifySettings(webhook=server.url), tmp_path / "notices.jsonl"
    with NoticeSender(target, spool, "bridge", retry_seconds=0.05) as sender:
        sender.put(ALARM)
        until(lambda: sender.problem)
        sender.put(change(20, "normal", "over", lasted=10.0))
        until(lambda: len(spool.read_text().splitlines()) == 2)
        server.answer = 200
        until(lambda: sender.problem is None)
    [got] = server.got
    assert [notice["text"] for notice in got["notices"]] == ["ALARM: a mass", "over"]
    assert list(sender.events()) == [
        NoticeFailed(to="webhook", why="webhook: 503 Service Unavailable"),
        NoticeRecovered(to="webhook"),
    ]
    assert not spool.exists()


@pytest.mark.parametrize(
    ("asked", "seconds"),
    [
        ("120", 120.0),
        ("a date", 1800.0),
        ("9" * 400, 3600.0),  # an hour at most
        ("Wed, 21 Oct 99999999999 07:28:00 GMT", 0.0),
        ("Wed, 21 Oct 0001 07:28:00 -0000", 0.0),
        ("soon", 0.0),
        ("", 0.0),
    ],
)
def test_webhook_retry_after_delays_all_notices_except_alarms(
    server: Server, tmp_path: Path, asked: str, seconds: float
) -> None:
    """But an alarm is tried at once all the same."""
    date = formatdate(time.time() + seconds, usegmt=True)
    server.answer, server.retry_after = 429, date if asked == "a date" else asked
    with NoticeSender(NotifySettings(webhook=server.url), tmp_path / "n.jsonl", "bridge", retry_seconds=5.0) as sender:
        sender.put(LOST)
        until(lambda: sender.problem)
        left = sender.others.due - time.monotonic()
        assert seconds - 30.0 < left <= max(seconds, 5.0)
        refused = server.refused
        sender.put(ALARM)
        until(lambda: server.refused > refused)
    assert sender.problem == "webhook: 429 Too Many Requests"


def test_undelivered_notices_are_sent_at_the_next_start(server: Server, tmp_path: Path) -> None:
    spool = tmp_path / "notices.jsonl"
    with NoticeSender(NotifySettings(webhook="http://127.0.0.1:1/x"), spool, "bridge") as sender:
        sender.put(ALARM)
    assert spool.exists()
    with spool.open("a") as file:
        file.write('{"of": "another version"}\n{"cut')
    with NoticeSender(NotifySettings(webhook=server.url), spool, "bridge") as sender:
        until(lambda: server.got)
    assert list(sender.events()) == [NoticeRecovered(to="webhook")]
    assert [notice["text"] for notice in server.got[0]["notices"]] == ["ALARM: a mass"]


def test_alarm_delivery_does_not_report_recovery_of_the_other_lane(server: Server, tmp_path: Path) -> None:
    """Troubles of an earlier run that still wait for the hour make no alarm report a recovery."""
    spool = tmp_path / "n_other.jsonl"
    spool.write_text(json.dumps(asdict(replace(NOTICE, kind="trouble"))) + "\n", encoding="utf-8")
    with NoticeSender(NotifySettings(webhook=server.url, max_per_hour=1), tmp_path / "n.jsonl", "bridge") as sender:
        sender.others.due = time.monotonic() + 60.0
        sender.put(ALARM)
        until(lambda: server.got)
        until(lambda: not (tmp_path / "n.jsonl").exists())
    assert list(sender.events()) == []


def test_notices_above_the_hourly_limit_wait_except_alarms(server: Server, tmp_path: Path) -> None:
    with NoticeSender(NotifySettings(webhook=server.url, max_per_hour=1), tmp_path / "n.jsonl", "bridge") as sender:
        sender.put(LOST)
        until(lambda: len(server.got) == 1)
        sender.put(LOST)
        until(lambda: (tmp_path / "n_other.jsonl").exists())
        time.sleep(0.5)  # two looks at what waits
        assert len(server.got) == 1
        sender.put(ALARM)
        until(lambda: len(server.got) == 2)
    assert [notice["kind"] for notice in server.got[1]["notices"]] == ["alarm"]


def test_kinds_not_selected_in_the_settings_are_not_sent(server: Server, tmp_path: Path) -> None:
    target = NotifySettings(webhook=server.url, events=("alarm",))
    with NoticeSender(target, tmp_path / "n.jsonl", "bridge") as sender:
        sender.put(LOST)
        sender.put(ALARM)
        until(lambda: server.got)
    assert [notice["kind"] for got in server.got for notice in got["notices"]] == ["alarm"]


def test_new_sender_waits_until_the_previous_one_has_ended(server: Server, tmp_path: Path) -> None:
    """Notices under way in the former sender would be sent twice from the same files; here each has its own."""
    target = NotifySettings(webhook=server.url)
    with NoticeSender(target, tmp_path / "before.jsonl", "bridge") as before:
        after = NoticeSender(target, tmp_path / "after.jsonl", "bridge")
        after.continue_from(before)
        with after:
            after.put(LOST)
            time.sleep(0.6)  # more than two looks at what waits
            assert server.got == []
            before.stop()
            until(lambda: server.got)
    assert [notice["kind"] for got in server.got for notice in got["notices"]] == ["trouble"]


def test_heartbeat_is_sent_only_while_data_arrive(server: Server, tmp_path: Path) -> None:
    target = NotifySettings(webhook=server.url, heartbeat_minutes=0.005, events=())
    with NoticeSender(target, tmp_path / "n.jsonl", "bridge") as sender:
        time.sleep(0.5)
        assert server.got == []
        sender.put(make_block("left", 0))
        until(lambda: len(server.got) >= 2)
    assert {got["kind"] for got in server.got} == {"heartbeat"}


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "expected one of `webhook`, `command` and `mqtt`, found none"),
        ({"webhook": "http://a/b", "mqtt": "mqtt://a/b"}, "found webhook and mqtt"),
        ({"webhook": "ftp://a/b"}, "expected http://HOST"),
        ({"mqtt": "a/b"}, "expected mqtt://HOST"),
        ({"webhook": "http://a/b", "template": "{{ notice.nothing }}"}, "has no attribute 'nothing'"),
        (
            {"webhook": "http://a/b", "template": "{% if notice.kind == 'recovery' %}{{ notice.no }}{% endif %}"},
            "has no attribute 'no'",
        ),
        ({"webhook": "http://a/b", "template": "{% if %}"}, "expected a jinja2 template"),
        ({"webhook": "http://a/b", "events": ["alarms"]}, "'alarm'"),
        ({"command": []}, "at least 1"),
    ],
)
def test_invalid_notify_settings_are_refused(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError) as caught:
        NotifySettings.model_validate(fields)
    assert says in str(caught.value)

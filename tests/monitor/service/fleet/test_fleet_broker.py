"""The page of a thousand sites from a real broker, without a database."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from monitor.outputs.fleet_broker import FleetBroker
from monitor.outputs.history import STATE_SECONDS, FleetReader, FleetRow, SiteState
from monitor.outputs.home_assistant import HomeAssistant
from monitor.outputs.site_report import ActiveAlarm, SiteReport, SiteReporter
from monitor.service.servers.fleet import FleetSource
from monitor.service.servers.fleet.overview import PAGE_SITES, Wanted, overview
from monitor.settings import HomeAssistantSettings
from tests.support.broker import broker, needs_broker
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.service.manager import Listener
from tests.support.monitor.service.status import site_status
from tests.support.processes import free_port

SITES = 1000
STATE = SiteState(state="normal", window=1, window_age=2.0, overdue=False, problems=(), url="")


def until(condition: Callable[[], object], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.1)


def report(number: int) -> SiteReport:
    """Return the report of a site: of every hundredth an alarm, of others some problems."""
    alarm = ActiveAlarm(raised=10**18, text="<b>mass added") if number % 100 == 0 else None
    return SiteReport(
        site=f"structure {number:04}",
        state="alarm" if alarm else "normal",
        lasts=60.0,
        window_age=2.0,
        overdue=number % 100 == 1,
        problems=("disk: full",) if number % 100 == 2 else (),
        alarm=alarm,
        levels=(0.5, 2.5 if alarm else 0.7),
        url="javascript:alert(1)" if number == 100 else f"https://bridge{number}.example.org",
    )


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Run a broker with the retained reports of all sites, and messages that are none."""
    port = free_port()
    with broker(tmp_path_factory.mktemp("broker"), port):
        publish(port)
        yield f"mqtt://127.0.0.1:{port}/modalwatch"


def publish(port: int) -> None:
    client = Client(CallbackAPIVersion.VERSION2)
    client.max_inflight_messages_set(0)
    client.connect("127.0.0.1", port)
    client.loop_start()
    messages = {f"modalwatch/{k:04}/site": report(k).model_dump_json() for k in range(1, SITES + 1)}
    messages |= {"modalwatch/hostile/site": "{", "modalwatch/0001/state": "{}"}
    messages["elsewhere/site"] = report(1).model_dump_json()
    messages["modalwatch/0003/availability"] = "offline"
    for sent in [client.publish(topic, payload, qos=1, retain=True) for topic, payload in messages.items()]:
        sent.wait_for_publish(30.0)
    client.disconnect()
    client.loop_stop()


@pytest.mark.live
@needs_broker
def test_page_of_a_thousand_sites_from_retained_messages(address: str, tmp_path: Path) -> None:
    port, notifications = free_port(), Listener(str(tmp_path / "notify"))
    environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify")}
    command = [
        sys.executable,
        "-c",
        "from monitor.cli.main import main; main()",
        "fleet",
        address,
        "--web-port",
        str(port),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == f"fleet: http://127.0.0.1:{port}\n"

            def page(query: str = "") -> str:
                return httpx.get(f"http://127.0.0.1:{port}/{query}", timeout=30.0).raise_for_status().text

            assert notifications.received("READY=1", 10.0)
            until(lambda: f"of {SITES} sites" in page())
            text = page()
            assert text.count("<article") == PAGE_SITES
            for kind, number in (("changed", 10), ("stale", 11), ("faulty", 10), ("normal", 969)):
                assert f">{kind} <b>{number}</b></a>" in text, kind
            first = text.partition("<article")[2].partition("</article>")[0]
            for part in ("changed", "&lt;b&gt;mass added", "2.5 times the limit", "<polyline", "last window"):
                assert part in first
            assert "<b>mass" not in text
            assert "javascript:" not in text
            assert 'href="https://bridge200.example.org"' in text
            assert "/site/" not in text
            assert "no state from the monitor" in page("?q=0003")
            assert httpx.get(f"http://127.0.0.1:{port}/site/-1").status_code == 404
        finally:
            process.terminate()
            assert process.wait(20) == 0
            assert notifications.received("STOPPING=1", 5.0)


@pytest.mark.live
@needs_broker
def test_monitor_reports_and_becomes_stale_as_it_ends_and_a_lost_broker_is_followed(tmp_path: Path) -> None:
    port = free_port()
    settings = HomeAssistantSettings(mqtt=f"mqtt://127.0.0.1:{port}/modalwatch/a")
    status, reporter = site_status(tmp_path), SiteReporter()
    source: FleetSource | None = None

    def conditions() -> tuple[str, ...]:
        assert source is not None
        shown = overview(source.sites(), Wanted()).shown
        return shown[0].conditions if shown else ()

    with HomeAssistant(settings, "bridge", retry_seconds=0.1) as home:
        home.show(status, reporter.report("bridge", STATE))
        with broker(tmp_path, port):
            fleet = FleetBroker(f"mqtt://127.0.0.1:{port}/modalwatch").__enter__()
            source = FleetSource(reader=None, broker=fleet)
            until(lambda: conditions() == ("normal",))
        until(lambda: _problem(fleet))
        assert "the connection is lost" in _problem(fleet)
        with broker(tmp_path, port):
            until(lambda: not _problem(fleet))
            home.show(status, reporter.report("bridge", replace(STATE, problems=("disk: full",))))
            until(lambda: conditions() == ("faulty",))
            home.__exit__()
            until(lambda: "stale" in conditions())
        fleet.__exit__()


def _problem(fleet: FleetBroker) -> str:
    try:
        fleet.sites()
    except Exception as error:  # noqa: BLE001 - any
        return str(error)
    return ""


class Known(FleetReader):
    """Database with two sites."""

    def __init__(self) -> None: ...

    def sites(self) -> list[FleetRow]:
        row = FleetRow(number=7, name="both", state=STATE, age=1.0, lasts=5.0, alarm=None)
        return [row, replace(row, number=8, name="old")]


class Live(FleetBroker):
    """Broker with two sites."""

    def __init__(self) -> None: ...

    def sites(self) -> list[FleetRow]:
        row = FleetRow(number=-1, name="both", state=replace(STATE, state="alarm"), age=1.0, lasts=5.0, alarm=None)
        return [row, replace(row, number=-2, name="new")]


def test_states_of_the_broker_replace_those_of_the_database() -> None:
    """A site of both keeps its number in the database, and with it its history."""
    rows = FleetSource(reader=Known(), broker=Live(), hidden=("old",)).sites()
    assert [(row.name, row.number, row.state and row.state.state) for row in rows] == [
        ("both", 7, "alarm"),
        ("new", -2, "alarm"),
    ]


def test_recent_state_of_the_database_replaces_that_of_a_monitor_that_left_the_broker(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A retained report stays for good after `[home_assistant]` is removed from the settings of a site."""
    left = replace(Live().sites()[0], age=STATE_SECONDS + 1)
    monkeypatch.setattr(Live, "sites", lambda _: [left])
    rows = FleetSource(reader=Known(), broker=Live()).sites()
    assert [(row.name, row.number, row.age) for row in rows] == [("both", 7, 1.0), ("old", 8, 1.0)]
    old = replace(Known().sites()[0], age=STATE_SECONDS + 2)
    monkeypatch.setattr(Known, "sites", lambda _: [old])
    assert [row.age for row in FleetSource(reader=Known(), broker=Live()).sites()] == [STATE_SECONDS + 1]


def test_newest_report_of_a_name_is_shown_after_a_change_of_its_topic() -> None:
    fleet = FleetBroker("mqtt://127.0.0.1:1/modalwatch")
    fleet._problem = None
    for topic, content in (("new", "learning"), ("old", "alarm")):  # retained messages arrive in any order
        sent = report(1).model_copy(update={"state": content}).model_dump_json()
        fleet._take(fleet._client, None, received(f"modalwatch/{topic}/site", sent))
    fleet._take(fleet._client, None, received("modalwatch/old/availability", "offline"))
    assert [(row.name, row.state and row.state.state) for row in fleet.sites()] == [("structure 0001", "learning")]


def test_two_monitors_with_one_name_are_both_shown() -> None:
    """Structure files of many sites have the same name."""
    fleet = FleetBroker("mqtt://127.0.0.1:1/modalwatch")
    fleet._problem = None
    for topic in ("modalwatch/a", "modalwatch/b"):
        fleet._take(fleet._client, None, received(f"{topic}/site", report(1).model_dump_json()))
    rows = FleetSource(reader=None, broker=fleet).sites()
    assert [row.name for row in rows] == ["structure 0001 (modalwatch/a)", "structure 0001 (modalwatch/b)"]


def test_messages_that_no_monitor_sends_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.outputs.fleet_broker._MAX_SITES", 3)
    fleet = FleetBroker("mqtt://127.0.0.1:1/modalwatch")
    fleet._problem = None
    for k in range(9):
        fleet._take(fleet._client, None, received(f"{k}/availability", "offline"))
        fleet._take(fleet._client, None, received(f"{k}/site", report(k).model_dump_json()))
    long = report(1).model_dump_json().replace('"lasts":60.0', '"lasts":1e308')
    fleet._take(fleet._client, None, received("1/site", long))
    assert len(fleet._offline) == len(fleet.sites()) == 3
    assert max(row.lasts or 0.0 for row in fleet.sites()) < 61.0


def received(topic: str, payload: str) -> MQTTMessage:
    message = MQTTMessage(topic=topic.encode())
    message.payload = payload.encode()
    return message


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("mqtt://me:Hush7Secret@127.0.0.1:1/x", "mqtt://127.0.0.1:1"),
        ("mqtt://h/site/#", "ADDRESS: expected mqtt://HOST/TOPIC, without wildcards"),
    ],
)
def test_wrong_broker_is_one_error(target: str, says: str, modalwatch: Commands) -> None:
    done = modalwatch("fleet", target)
    assert_refused(done, says)
    assert "Hush7" not in done.err

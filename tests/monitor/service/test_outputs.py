"""Outputs of a run continue: a view that dies is restarted, a notice sender takes over the state of the former."""

import json
import multiprocessing
import os
import socket
import threading
import time
from pathlib import Path
from typing import cast
from unittest.mock import MagicMock

import pytest

from daq import Item, SystemClock
from monitor.outputs.notices import NoticeSender
from monitor.outputs.site_report import SiteReport
from monitor.results.service_events import HomeAssistantFailed, ViewerFailed, ViewerRecovered, WebFailed, WebRecovered
from monitor.results.site_status import FILE_NAME, Counters, PartProblems
from monitor.service.outputs import Outputs
from monitor.service.servers.live_view import LiveView
from monitor.service.site import Site, load_site
from monitor.service.status import MonitorStatus
from monitor.settings import NotifySettings
from tests.support.monitor.history import change, rows, run_events
from tests.support.monitor.service.status import PACE, site_status
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y"}
"""
START = 1_767_225_600_000_000_000


class View:
    """A live view that dies on request, and cannot restart while its port is taken."""

    def __init__(self) -> None:
        self.problem: str | None = None
        self.port_taken = False
        self.shown: list[Item] = []

    def show(self, item: Item) -> None:
        self.shown.append(item)

    def restart(self, *_: object) -> None:
        self.problem = "port 9876 is in use" if self.port_taken else None


@pytest.fixture
def site(tmp_path: Path) -> Site:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    return load_site(tmp_path / "site.toml")


def test_failed_live_view_is_reported_once_and_restarted(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("monitor.service.outputs.time.monotonic", lambda: now)
    view = View()
    outputs = Outputs(site, cast("LiveView", view))
    assert list(outputs.events()) == []
    view.problem, view.port_taken = "its process ended with code -9", True
    assert list(outputs.events()) == [ViewerFailed(why="its process ended with code -9")]
    assert list(outputs.events()) == []
    now += 61.0
    assert list(outputs.events()) == []  # tried, in vain
    assert outputs.problems["viewer"] == "port 9876 is in use"
    view.port_taken = False
    now += 61.0
    assert list(outputs.events()) == [ViewerRecovered()]
    assert outputs.problems["viewer"] is None


def test_live_view_without_a_viewer_section_is_not_reported_as_changed(site: Site) -> None:
    outputs = Outputs(site, cast("LiveView", View()))
    assert list(outputs.renew(site, analysed_alike=False)) == []
    site.path.write_text(f"{SITE}[viewer]\n", encoding="utf-8")
    for _ in range(2):  # it is asked for; then it is to show another analysis
        assert list(outputs.renew(load_site(site.path), analysed_alike=False)) == ["viewer"]


def test_reload_begins_and_ends_home_assistant(site: Site) -> None:
    """A broker that refuses connections is a problem of the part, which is gone with its settings."""
    home = f'{SITE}[home_assistant]\nmqtt = "mqtt://127.0.0.1:1"\n'
    with Outputs(site, None) as outputs:
        assert outputs.problems["home_assistant"] is None
        site.path.write_text(home, encoding="utf-8")
        assert list(outputs.renew(load_site(site.path), analysed_alike=True)) == ["home_assistant"]
        end = time.monotonic() + 20.0
        while not (events := list(outputs.events())):
            assert time.monotonic() < end
            time.sleep(0.02)
        assert [type(event) for event in events] == [HomeAssistantFailed]
        assert "mqtt://127.0.0.1:1: " in str(outputs.problems["home_assistant"])
        site.path.write_text(SITE, encoding="utf-8")
        assert list(outputs.renew(load_site(site.path), analysed_alike=True)) == ["home_assistant"]
        assert outputs.problems["home_assistant"] is None
    assert "home assistant" not in {thread.name for thread in threading.enumerate()}


def test_site_has_one_name_in_the_database_and_at_the_broker(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a page of both would show it twice; a SQLite file without `history.site` has no name."""
    found: list[SiteReport | None] = []
    home = MagicMock()
    home.show = lambda _, report: found.append(report)
    monkeypatch.setattr("monitor.service.outputs._home", lambda _: [home])
    with Outputs(site, None) as outputs:
        for history, name in (("", "t_structure"), ('[history]\nsite = "bridge 7"\n', "bridge 7")):
            site.path.write_text(SITE + history, encoding="utf-8")
            list(outputs.renew(load_site(site.path), analysed_alike=True))
            outputs.put_status(site_status(site.folder))
            assert found[-1] is not None
            assert found[-1].site == name


@pytest.mark.live
def test_web_server_is_restarted_after_its_process_ends(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    port = 22_000 + os.getpid() % 20_000
    site.path.write_text(f"{SITE}[web]\nport = {port}\n", encoding="utf-8")
    now = 100.0
    monkeypatch.setattr("monitor.service.outputs.time.monotonic", lambda: now)
    with Outputs(load_site(site.path), None) as outputs:
        [server] = [child for child in multiprocessing.active_children() if child.name == "web"]
        server.kill()
        server.join()
        assert list(outputs.events()) == [WebFailed(why="its process ended with code -9")]
        now += 61.0
        assert list(outputs.events()) == [WebRecovered()]
        assert outputs.problems["web"] is None
        socket.create_connection(("127.0.0.1", port), 5.0).close()


@pytest.mark.live
def test_status_of_a_run_is_written_to_the_history(site: Site) -> None:
    """State, problems and the address of the page, for the page of many sites."""
    port = 22_000 + (os.getpid() + 1) % 20_000
    site.path.write_text(f'{SITE}[web]\nport = {port}\nurl = "https://bridge.example.org"\n', encoding="utf-8")
    status = MonitorStatus(site.state / FILE_NAME, (), PACE, SystemClock())
    for event in run_events():
        status.take(event)
    written = status.write(PartProblems(disk="No space left"), Counters())
    assert written is not None
    with Outputs(load_site(site.path), None) as outputs:
        outputs.put_status(written)
    [row] = rows(f"sqlite:///{site.state / 'history.sqlite'}", "site_states")
    assert (row["state"], row["overdue"], row["url"]) == ("alarm", False, "https://bridge.example.org")
    assert json.loads(row["problems"]) == ["disk: No space left"]
    assert 0 <= row["window_age"] < 60


def test_new_sender_continues_the_notices_of_the_previous_one(tmp_path: Path) -> None:
    """An alarm with a notice from the old sender ends: the new one sends the notice of that end, and of which alarm."""
    over, waiting = change(START + 10**9, "normal", lasted=1.0), {}
    old = NoticeSender(NotifySettings(command=("true",)), tmp_path / "old.jsonl", "bridge")
    old.put(change(START, "alarm"))
    for before in (old, None):
        spool = tmp_path / f"{before is old}.jsonl"
        sender = NoticeSender(NotifySettings(command=("false",)), spool, "bridge")  # which delivers nothing
        if before:
            sender.continue_from(before)
        with sender:
            sender.put(over)
        waiting[before is old] = [json.loads(line) for line in spool.read_text().splitlines()] if spool.exists() else []
    assert waiting[False] == []  # one that knows of no alarm has no end to tell of
    assert [(notice["kind"], notice["alarm"]) for notice in waiting[True]] == [("recovery", START)]

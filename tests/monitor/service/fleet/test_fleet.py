"""The page of a thousand sites, from a real PostgreSQL through a real server."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from sqlalchemy import create_engine

from monitor.outputs.history import FleetReader, HistoryRecorder, HistoryStore, SiteState, Writer, recorder
from monitor.service.servers.fleet import overview as overview_
from monitor.service.servers.fleet.overview import PAGE_SITES, Wanted, overview
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.fleet import KINDS, Fleet, fill
from tests.support.monitor.history import run_events
from tests.support.postgres import Server, postgres_programs, postgres_server

pytestmark = [
    pytest.mark.live,
    pytest.mark.xdist_group("fleet"),  # one database for all
    pytest.mark.skipif(postgres_programs() is None, reason="no PostgreSQL server is installed"),
]
SITES = 1000
PORT = 20_000 + (os.getpid() + 5000) % 20_000
NORMAL = SiteState(state="normal", window=1, window_age=2.0, overdue=False, problems=(), url="")
SETTINGS = """url = "{url}"
port = {port}
hidden = ["structure 1000", "mine"]
[pages]
"structure 0001" = "https://bridge1.example.org"
"""


def until(condition: Callable[[], object], seconds: float = 15.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


@dataclass(frozen=True)
class Served:
    database: Server
    process: subprocess.Popen[str]

    def get(self, path: str, **headers: str) -> httpx.Response:
        return httpx.get(f"http://127.0.0.1:{PORT}{path}", headers=headers, timeout=30.0)


@pytest.fixture(scope="module")
def database() -> Iterator[Server]:
    """Return a database of a thousand sites, and some whose monitors write what they should not."""
    with postgres_server() as server:
        fill(server.url, Fleet(sites=SITES, days=10, keep_days=1, modes=1, events_per_day=1))
        hostile = SiteState(
            state="normal",
            window=1,
            window_age=2.0,
            overdue=False,
            problems=("<script>alert(1)",),
            url="javascript:alert(2)",
        )
        for name, state in {"<b>hostile": hostile, "empty": NORMAL}.items():
            with HistoryStore(server.url, Writer(site=name)) as store:
                store.write_state(state)
        with HistoryStore(server.url, Writer(site="whole run")) as store:
            store.write(run_events())
        yield server


@pytest.fixture(autouse=True)
def _running(database: Server) -> None:
    """Renew the states of the monitors that run, however long the tests before have taken."""
    engine = create_engine(database.url.replace("postgresql:", "postgresql+psycopg:"))
    with engine.begin() as connection:
        now = "extract(epoch from now())::bigint * 1000000000"
        connection.exec_driver_sql(f"UPDATE site_states SET time = {now} WHERE time > {now} - 2000000000000")
    engine.dispose()


@pytest.fixture(scope="module")
def served(database: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Serve the page as a user does."""
    path = tmp_path_factory.mktemp("fleet") / "fleet.toml"
    path.write_text(SETTINGS.format(url=database.url, port=PORT), encoding="utf-8")
    command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "fleet", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"fleet: http://127.0.0.1:{PORT}\n"
        found = Served(database, process)
        until(lambda: _answers(found))
        yield found
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0


def _answers(served: Served) -> bool:
    try:
        return served.get("/healthz").status_code == 200
    except httpx.TransportError:
        return False


def test_page_lists_the_sites_that_need_a_person_first(served: Served) -> None:
    answer = served.get("/")
    assert answer.status_code == 200
    for kind, share, *_ in KINDS[:-1]:
        label = "changed" if kind == "alarm" else kind
        extra = {"changed": 1, "stale": 1, "faulty": 1}.get(label, 0)  # an alarm without a state; hostile
        assert f">{label} <b>{round(share * SITES) + extra}</b></a>" in answer.text
    assert answer.text.count("<article") == PAGE_SITES
    first, *_ = served.get("/?q=structure").text.partition("<article")[2].partition("</article>")
    for text in ("changed", "204 ± 11 g added on the column", "last window", "<polyline", "times the limit"):
        assert text in first
    assert "https://bridge1.example.org" in answer.text
    assert "structure 1000" not in served.get("/?q=structure+1000").text.partition("</header>")[2]
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert "form-action 'self'" in answer.headers["content-security-policy"]
    assert "<script>" not in answer.text


def test_every_site_is_on_one_of_the_pages(served: Served) -> None:
    names: list[str] = []
    path: str | None = "/"
    while path:
        text = served.get(path).text
        names += [card.partition("</a>")[0].rpartition(">")[2] for card in text.split("<article")[1:]]
        path = (
            text.rpartition('rel="next"')[0].rpartition('<a href="')[2].partition('"')[0].replace("&amp;", "&") or None
        )
    assert len(names) == len(set(names)) == SITES + 3 - 1  # one is hidden


def test_search_and_filter_narrow_the_page(served: Served) -> None:
    text = served.get("/?q=structure+00&state=stale").text
    assert (text.count("<article"), ">stale <b>20</b></a>" in text) == (20, True)
    assert served.get("/?q=nowhere").text.count("No site matches.") == 1
    for query in ("?page=-1", "?page=99999999", "?page=x", "?state=%00", "?q=%27%22%3C%00", "?state=normal&page=2"):
        assert served.get(f"/{query}").status_code == 200


def test_texts_of_monitors_are_escaped_and_their_links_are_web_pages(served: Served) -> None:
    text = served.get("/?q=hostile").text
    assert "&lt;b&gt;hostile" in text
    assert "&lt;script&gt;alert(1)" in text
    assert "javascript:" not in text


def test_site_has_a_page_from_the_history(served: Served) -> None:
    for span in ("day", "month", "year"):
        answer = served.get(f"/site/1?span={span}")
        assert answer.status_code == 200
        for text in ("<h2>Novelty", "<h2>Modes", "<h2>Alarms", "204 ± 11 g added", f'aria-current="page">{span}'):
            assert text in answer.text
    assert re.search("14[34] windows", served.get("/site/5?span=day").text)  # of 10 minutes; one ends between the two
    past = served.get("/?q=whole+run").text.partition('<a href="/site/')[2].partition('"')[0]  # a day in the past
    assert "No window in this span." in served.get(f"/site/{past}?span=day").text
    for path in ("/site/99999", "/site/1?span=eon", "/site/x"):
        assert served.get(path).status_code == 404
    number = served.get("/?q=empty").text.partition('<a href="/site/')[2].partition('"')[0]
    answer = served.get(f"/site/{number}")
    assert "no window has been analysed yet" in answer.text


def test_page_has_the_guard_of_the_status_page(served: Served) -> None:
    assert served.get("/", host="elsewhere.example").status_code == 421
    assert httpx.post(f"http://127.0.0.1:{PORT}/").status_code == 401
    assert served.get("/fleet.js").status_code == served.get("/page.css").status_code == 200


def test_restarted_database_is_followed(served: Served) -> None:
    assert served.get("/").status_code == 200
    served.database.stop()
    try:
        until(lambda: served.get("/healthz").status_code == 503)
        answer = served.get("/")
        assert answer.status_code == 503
        assert "The states cannot be read" in answer.text
    finally:
        served.database.start()
    until(lambda: served.get("/healthz").status_code == 200)
    assert served.get("/").text.count("<article") == PAGE_SITES


def test_monitor_that_stops_becomes_stale(database: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a real recorder, with times that are shortened."""
    monkeypatch.setattr("monitor.outputs.history.sites._REPEAT_SECONDS", 0.2)
    monkeypatch.setattr(recorder, "_POLL", 0.1)
    monkeypatch.setattr(overview_, "STATE_SECONDS", 1.5)
    with FleetReader(database.url) as reader:

        def conditions() -> tuple[str, ...]:
            shown = overview(reader.sites(), Wanted(words="mine")).shown
            return shown[0].conditions if shown else ()

        writer = Writer(site="mine", place="here")
        with HistoryRecorder(database.url, tmp_path / "spool", keep_events=10, writer=writer) as made:
            made.put_state(NORMAL)
            until(lambda: conditions() == ("normal",))
            time.sleep(2.0)  # an unchanged state is written again and again
            until(lambda: conditions() == ("normal",))
            made.put_state(SiteState(**NORMAL.__dict__ | {"state": "alarm"}))
            until(lambda: conditions() == ("changed",))
        until(lambda: conditions() == ("changed", "stale"))


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("postgresql://me:secret@127.0.0.1:1/none", "error: postgresql://127.0.0.1:1/none: "),
        (
            "nonsense",
            "ADDRESS: expected postgresql://USER@HOST/NAME, mqtt://HOST/TOPIC or FLEET.toml, found 'nonsense'",
        ),
        ("h.sqlite", "found 'h.sqlite': a file holds one site (`modalwatch history h.sqlite`)"),
        ("oracle9://me:secret@h/x", "expected sqlite:///FILE or postgresql://USER@HOST/NAME"),
        ("sqlite:///history.sqlite", "expected postgresql://USER@HOST/NAME: a file holds one site"),
        ("nowhere.toml", "nowhere.toml: cannot be read"),
    ],
)
def test_wrong_database_is_one_error(
    target: str, says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = Commands(monkeypatch, capsys)("fleet", target)
    assert_refused(done, says)
    assert "secret" not in done.err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('url = "postgresql://u:secret@h/x"\nbind = "secret"', "bind: expected an address such as 127.0.0.1"),
        ('url = ["secret"]', "url: Input should be a valid string"),
        ('ulr = "secret"', "ulr: no such setting"),
        ("port = 8771", "expected url (a database), mqtt (a broker), or both"),
        ('mqtt = "http://me:secret@h/x"', "mqtt: expected mqtt://HOST/TOPIC or mqtts://HOST/TOPIC"),
        ('url = "postgresql://secret@h/x"\n[pages]\na = "javascript:x"', "pages: a: expected http://HOST"),
    ],
)
def test_wrong_settings_are_one_error_without_values(
    text: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fleet.toml").write_text(text, encoding="utf-8")
    done = Commands(monkeypatch, capsys)("fleet", tmp_path / "fleet.toml")
    assert_refused(done, says)
    assert "secret" not in done.err

"""Health, metrics and the status page: stale parts are named, and only requests with the token may act."""

import asyncio
import json
import math
import os
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from daq import Event, SystemClock
from monitor.errors import StartError
from monitor.outputs.history import HistoryStore
from monitor.results.residuals import ChannelResiduals
from monitor.results.site_status import FILE_NAME
from monitor.service.operator_commands import Inbox
from monitor.service.servers.web import Source, alarm_reports, make_app, web_process
from monitor.service.servers.web.alarm_page import alarm_page
from monitor.service.status import MonitorStatus
from monitor.text.quantities import utc
from tests.support.daq.blocks import make_block
from tests.support.monitor.answers import diagnosis
from tests.support.monitor.history import run_events, sqlite_url
from tests.support.monitor.service.status import PACE, WELL

PORT = 20_000 + os.getpid() % 20_000
TOKEN = "0123456789abcdef"
ACT = {"X-Modalwatch": "test", "Authorization": f"Bearer {TOKEN}"}
EVENTS = run_events()


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the history of a run that has found a mass."""
    folder = tmp_path_factory.mktemp("history")
    with HistoryStore(sqlite_url(folder)) as store:
        store.write(
            [*EVENTS, Event(topic="/event/device_recovered", time=10**18, payload={"device": "<script>alert(1)"})]
        )
    return folder


@pytest.fixture
def source(tmp_path: Path, history: Path) -> Source:
    """Return the state folder of a run in progress."""
    shutil.copytree(history, tmp_path, dirs_exist_ok=True)
    status = MonitorStatus(tmp_path / FILE_NAME, ("left", "right"), PACE, SystemClock())
    for name in ("left", "right"):
        status.take(make_block(name, 0))
    for event in EVENTS:
        status.take(event)
    status.write(*WELL)
    return Source(name="bridge <b>", state=tmp_path, url=sqlite_url(tmp_path))


class Client:
    """Sends requests to the application without a port."""

    def __init__(self, source: Source, *, open_to_look: bool = True) -> None:
        self._app = make_app(source, token=TOKEN, open_to_look=open_to_look)

    def ask(self, method: str, path: str, **how: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(self._app)
            async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8765") as asking:
                return await asking.request(method, path, **how)

        return asyncio.run(asked())

    def get(self, path: str, **how: Any) -> httpx.Response:
        return self.ask("GET", path, **how)

    def post(self, path: str, **how: Any) -> httpx.Response:
        return self.ask("POST", path, **how)


def changed(source: Source, **fields: Any) -> Source:
    file = source.state / FILE_NAME
    file.write_text(json.dumps(json.loads(file.read_text()) | fields))
    return source


def test_running_monitor_is_healthy(source: Source) -> None:
    answer = Client(source).get("/healthz")
    assert (answer.status_code, answer.json()) == (200, {"healthy": True, "problems": []})


def test_events_on_the_page_include_alarm_and_skipped_windows(source: Source) -> None:
    """The alarm is raised after the other events; it must be among the last events."""
    with HistoryStore(source.url) as store:
        store.write([Event(topic="/event/windows_left_out", time=EVENTS[-1].time - 1, payload={"why": "behind"})])
    events = Client(source).get("/state").text.partition("<h2>Events</h2>")[2]
    assert "<p>ALARM" in events
    assert "Windows are left out: behind" in events


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"time": time.time() - 60}, "no status of the monitor for"),
        (
            {"window_age": 4000.0, "window_overdue": True},
            "no window has been analysed for 4000 s; one is due every 600 s",
        ),
        ({"counters": {"dropped": 3}}, "3 items did not reach the log"),
        ({"overload": "2 of the last 10 windows left out: the analysis has fallen behind"}, "2 of the last 10 windows"),
        (
            {"problems": {"threads": "notices_1: OverflowError (senders.py:9), 2 times"}},
            "threads: notices_1: OverflowError",
        ),
        ({"problems": {"disk": "No space left"}}, "disk: No space left"),
        ({"problems": {"history": "database is locked"}}, "history: database is locked"),
        ({"devices": {"left": {"lost": True, "silent": 9.0}}}, "device left is lost"),
        ({"devices": {"left": {"lost": False, "silent": None}}}, "device left has sent nothing yet"),
        ({"devices": {"left": {"lost": False, "silent": 9.0}}}, "device left has been silent for"),
    ],
)
def test_each_health_problem_is_named(source: Source, fields: dict[str, Any], says: str) -> None:
    answer = Client(changed(source, **fields)).get("/healthz")
    assert answer.status_code == 503
    [problem] = answer.json()["problems"]
    assert says in problem


@pytest.mark.parametrize(
    ("fields", "headline"),
    [
        ({"state": "normal"}, "Normal"),
        ({"state": "normal", "counters": {"dropped": 3}}, "Normal"),
        ({"state": "normal", "devices": {"left": {"lost": True, "silent": 9.0}}}, "Degraded; the last window: Normal"),
        ({"state": "alarm", "time": time.time() - 60}, "No present state; the last one: ALARM"),
    ],
)
def test_headline_is_limited_where_the_measurement_is(source: Source, fields: dict[str, Any], headline: str) -> None:
    """A problem of another part, such as items that did not reach the log, leaves the verdict as it is."""
    page = Client(changed(source, **fields)).get("/state").text
    assert f'<p class="headline">{headline}' in page


def test_residuals_are_on_the_page_as_a_state(source: Source) -> None:
    residuals = ChannelResiduals(
        time=1, seconds=2.0, ratio={"a": 1.02, "b": 2.5}, deviation={"a": 0.2, "b": 9.31}, limit=6.0
    )
    fields = {"state": "normal", "residuals": residuals.model_dump(), "residual_course": [0.5, 9.31]}
    page = Client(changed(source, **fields)).get("/state").text
    section = page.partition("<h2>Residuals")[2].partition("</section>")[0]
    assert "+9.3 standard deviations" in section
    assert section.index("<td>b</td>") < section.index("<td>a</td>")  # the largest first
    assert "over the last 2 s" in section
    assert '<p class="headline">Normal' in page  # no alarm


def test_site_that_never_ran_has_a_page(tmp_path: Path) -> None:
    looked = Client(Source(name="new", state=tmp_path, url=sqlite_url(tmp_path)))
    assert looked.get("/healthz").json()["problems"] == ["no monitor has run here yet"]
    assert "No present state" in looked.get("/").text
    assert "modalwatch_healthy 0.0" in looked.get("/metrics").text


def test_windows_without_a_usable_result_are_unhealthy(source: Source, tmp_path: Path) -> None:
    """Data arrive and windows are analysed, but none has a usable result: as bad as no monitoring."""
    window = next(e for e in EVENTS if e.topic == "/result/window" and e.payload["phase"] == "watching")
    unseen: dict[str, Any] = dict.fromkeys(("t2", "limit"), math.nan) | {"modes": [], "detectors": []}
    status = MonitorStatus(source.state / FILE_NAME, (), PACE, SystemClock())
    for nothing, well in ((0, True), (2, True), (3, False), (0, True)):
        status.take(replace(window, payload=window.payload | {"problem": None}))
        for _ in range(nothing):
            status.take(replace(window, payload=window.payload | {"modes": [], "novelty": unseen}))
        status._due = 0.0
        status.write(*WELL)
        found = Client(source).get("/healthz").json()
        assert found["healthy"] == well, found
        assert well or "no watched mode was identified" in found["problems"][0]


def test_page_states_the_detectable_change_at_uncertain_temperatures(source: Source) -> None:
    unsure = {"least_percent": 0.93, "temperature": 21.5, "coldest": 10.1, "warmest": None}
    novelty = {"t2": 1.0, "limit": 5.0, "modes": [1], "detectors": [], "unsure": unsure}
    window = {"index": 30, "phase": "watching", "novelty": novelty}
    page = Client(changed(source, state="normal", window=window)).get("/").text
    assert "Normal (estimated)" in page
    assert "at 21.5 degC only changes of all frequencies alike by more than 0.93 % are detectable" in page
    sure = window | {"novelty": novelty | {"unsure": None}}
    assert "are detectable" not in Client(changed(source, state="normal", window=sure)).get("/").text


def test_smallest_detectable_change_is_kept_over_a_window_without_modes(source: Source) -> None:
    window = next(e for e in EVENTS if e.topic == "/result/window" and e.payload["phase"] == "watching")
    found = {"alike_percent": 0.57, "modes_percent": [1.0, 2.0], "thermometer": True}
    novelty = {"t2": 1.0, "limit": 5.0, "modes": [1], "detectors": [], "detectable": found}
    status = MonitorStatus(source.state / FILE_NAME, (), PACE, SystemClock())
    status.take(replace(window, payload=window.payload | {"novelty": novelty}))
    status.take(replace(window, payload=window.payload | {"modes": [], "novelty": None, "problem": "no modes"}))
    status.write(*WELL)
    assert (
        "smallest detectable change: a lasting change of all frequencies alike by 0.57 %"
        in Client(source).get("/").text
    )


def test_page_shows_the_progress_of_learning(source: Source) -> None:
    first = next(event for event in EVENTS if event.topic == "/result/window")
    status = MonitorStatus(source.state / FILE_NAME, (), PACE, SystemClock())

    def page(**fields: Any) -> str:
        status.take(replace(first, payload=first.payload | fields))
        status._due = 0.0
        status.write(*WELL)
        return Client(source).get("/").text

    assert "No usable window yet" in page(modes=[], problem="no resonance")
    found = page(index=6, learning={"windows": 6, "target": 8})
    assert '<progress value="6" max="8">' in found
    assert re.search(r"6 of 8 windows, about (20|19) min", found)  # two steps of 600 s
    assert "6 of 8 windows" in page(modes=[], problem="no resonance")
    assert "8 of 8 windows. No window is evaluated" in page(index=8, learning={"windows": 8, "target": 8})
    assert "<progress" not in page(phase="watching", learning=None)


def test_windows_without_modes_are_counted_and_marked(source: Source) -> None:
    before = Client(source).get("/").text
    assert "1 of the last 20 windows without modes" in before
    assert "left out since the start" not in before
    window = next(event for event in reversed(EVENTS) if event.topic == "/result/window")
    end = window.payload["end"] + 600 * 10**9
    bare: dict[str, Any] = {"modes": [], "novelty": None, "problem": "no <b> resonance", "end": end}
    with HistoryStore(source.url) as store:
        store.write([replace(window, time=end, payload=window.payload | bare)])
    last = {"index": 30, "phase": "watching", "end": end}
    page = Client(changed(source, windows_left_out=3, window=last)).get("/").text
    assert "3 windows left out since the start, because the analysis was behind" in page
    assert re.search(rf"2 of the last 21 windows without modes, the last one at {utc(end)}: no &lt;b&gt; res", page)
    assert (before.count('class="missing"'), page.count('class="missing"')) == (1, 2)


REPORT = re.compile(r'href="(/report/\d+)"')


def test_alarm_has_a_report(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not REPORT.findall(Client(source).get("/").text)  # there is no diagnosis
    code = "import sys; sys.stdout.write('<style></style>' + sys.stdin.read())"
    monkeypatch.setattr(alarm_reports, "_CODE", code)
    with HistoryStore(source.url) as store:
        store.write(with_diagnosis(EVENTS))
    client = Client(source)
    found = REPORT.findall(client.get("/").text)
    assert len(found) == 2  # of the verdict, and in the list of alarms
    assert found[0] == found[1]
    answer = client.get(found[0])
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert json.loads(answer.text.removeprefix("<style></style>"))["url"] == source.url
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'; style-src 'unsafe-inline'; img-src data:" in policy
    assert "script" not in policy
    monkeypatch.setattr(alarm_reports, "_CODE", "pass")
    assert Client(source).get(found[0]).status_code == 404
    monkeypatch.setattr(alarm_reports, "_CODE", "raise SystemExit(3)")
    assert Client(source).get(found[0]).status_code == 500
    assert Client(source, open_to_look=False).get(found[0]).status_code == 401


@pytest.mark.usefixtures("undrawn")
def test_report_of_an_alarm_is_made_from_the_history(source: Source) -> None:
    with HistoryStore(source.url) as store:
        store.write(with_diagnosis(EVENTS))
    raised = next(e.time for e in EVENTS if e.topic == "/result/alarm" and e.payload["state"] == "alarm")
    page = alarm_page("bridge <b>", source.url, "", raised)
    assert page is not None
    assert "bridge &lt;b&gt;" in page
    assert f"<td>Alarm raised</td><td>{utc(raised)}</td>" in page
    assert "302 ± 5 g added on the crossbeam" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert alarm_page("bridge", source.url, "", raised + 1) is None


def with_diagnosis(events: list[Event]) -> list[Event]:
    """Return the last window with a diagnosis."""
    last = next(event for event in reversed(events) if event.topic == "/result/window")
    return [replace(last, payload=last.payload | {"diagnosis": diagnosis().model_dump(mode="json")})]


def test_unavailable_history_is_not_shown_as_empty(source: Source) -> None:
    (source.state / "history.sqlite").unlink()
    assert "the history is empty" in Client(source).get("/").text
    text = Client(changed(source, problems={"history": "it is gone"})).get("/").text
    assert ("history: it is gone" in text, "the history is empty" in text) == (True, False)


def test_window_with_a_future_time_is_not_shown_as_the_last(source: Source) -> None:
    shown = re.search("last window .*?,", Client(source).get("/").text)
    ahead = next(event for event in reversed(EVENTS) if event.topic == "/result/window")
    years = 5 * 365 * 86_400 * 10**9
    later = {name: ahead.payload[name] + years for name in ("start", "end")}
    with HistoryStore(source.url) as store:
        store.write([replace(ahead, time=ahead.time + years, payload=ahead.payload | later)])
    again = re.search("last window .*?,", Client(source).get("/").text)
    assert shown is not None
    assert again is not None
    assert again[0] == shown[0]


def test_alarm_is_shown_without_the_history(source: Source, tmp_path: Path) -> None:
    """It may be locked, or damaged, or behind: the page reports it, with no wrong state."""
    looked = Client(Source(name="bridge", state=source.state, url="sqlite:////proc/nowhere/history.sqlite"))
    page = looked.get("/").text
    assert "ALARM: the structure has changed" in page
    assert "Acknowledge" in page
    assert 'modalwatch_state{state="alarm"} 1.0' in looked.get("/metrics").text


def test_metrics_are_in_prometheus_format(source: Source) -> None:
    text = Client(source).get("/metrics").text
    found = dict(re.findall(r"^(modalwatch_\S+) (\S+)$", text, re.MULTILINE))
    assert found["modalwatch_healthy"] == "1.0"
    assert found['modalwatch_device_lost{device="left"}'] == "0.0"
    assert float(found["modalwatch_novelty"]) > float(found["modalwatch_novelty_limit"])
    assert found["modalwatch_window_modes"] == "6.0"
    assert sum(float(v) for k, v in found.items() if k.startswith("modalwatch_state")) == 1.0
    assert found['modalwatch_queue_items{queue="analysis"}'] == "40.0"
    assert found['modalwatch_bad_bytes{device="left"}'] == "21.0"
    assert float(found["modalwatch_python_allocated_blocks"]) > 1e5
    assert {"modalwatch_window_latency_seconds", "modalwatch_alarm_latency_seconds"} <= found.keys()
    assert found['modalwatch_device_temperature_celsius{device="left"}'] == "21.5"
    assert "modalwatch_temperature_celsius" not in found  # the site has no thermometer
    assert found["modalwatch_window_overdue"] == "0.0"


def test_metrics_of_modes_have_standard_deviations(source: Source) -> None:
    window = next(event for event in reversed(EVENTS) if event.topic == "/result/window")
    mode = window.payload["modes"][1]

    def figures(source: Source) -> dict[str, float]:
        found = re.findall(
            r'^modalwatch_mode_(\w+)\{mode="2"\} (\S+)$', Client(source).get("/metrics").text, re.MULTILINE
        )
        return {name: float(value) for name, value in found}

    assert figures(source) == {
        "frequency_hertz": mode["frequency"],
        "frequency_std_hertz": mode["frequency_std"],
        "damping_ratio": mode["damping"],
        "damping_std_ratio": mode["damping_std"],
    }
    status = json.loads((source.state / FILE_NAME).read_text())["window"]
    unknown = status["modes"] | {"2": status["modes"]["2"] | {"damping_std": None}}
    assert figures(changed(source, window=status | {"modes": unknown})).keys() == {
        "frequency_hertz",
        "frequency_std_hertz",
        "damping_ratio",
    }
    assert figures(changed(source, window=status | {"phase": "learning"})) == {}  # identities of one window


def test_page_shows_the_alarm_and_escapes_foreign_text(source: Source) -> None:
    answer = Client(source).get("/")
    for text in ("bridge &lt;b&gt;", "<svg", "Acknowledge", "Novelty", "left", "gap"):
        assert text in answer.text
    assert "<script>alert" not in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "unsafe" not in answer.headers["content-security-policy"]
    assert (answer.headers["x-content-type-options"], answer.headers["cache-control"]) == ("nosniff", "no-store")
    for name in ("/page.css", "/page.js"):
        assert Client(source).get(name).status_code == 200


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({}, 401),
        ({"X-Modalwatch": "test"}, 401),
        ({"X-Modalwatch": "test", "Authorization": "Bearer wrong"}, 401),
        ({"X-Modalwatch": "test", "Authorization": "Basic !"}, 401),
        ({"Authorization": f"Bearer {TOKEN}"}, 403),  # a form on another site's page could do that
        (ACT, 202),
    ],
)
def test_acknowledgement_requires_the_token(source: Source, headers: dict[str, str], code: int) -> None:
    answer = Client(source).post("/acknowledge?by=Ada", headers=headers)
    assert answer.status_code == code
    assert [command.payload()["by"] for command in Inbox(source.state).taken()] == (["Ada"] if code == 202 else [])


def test_token_is_the_password_of_any_user_name(source: Source) -> None:
    answer = Client(source).post("/acknowledge", headers={"X-Modalwatch": "test"}, auth=("ada", TOKEN))
    assert answer.status_code == 202
    assert [command.payload()["by"] for command in Inbox(source.state).taken()] == ["ada"]


def test_unwritable_state_folder_is_reported(source: Source) -> None:
    shutil.rmtree(source.state / "inbox", ignore_errors=True)
    (source.state / "inbox").write_text("a file")
    answer = Client(source).post("/acknowledge", headers=ACT)
    assert (answer.status_code, "not writable" in answer.text) == (503, True)


def test_remote_reading_requires_the_token(source: Source) -> None:
    looked = Client(source, open_to_look=False)
    assert {
        looked.get(path).status_code for path in ("/", "/state", "/healthz", "/metrics", "/influx", "/page.js")
    } == {401}
    assert looked.get("/", headers=ACT).status_code == 200


def test_foreign_host_header_is_refused(source: Source) -> None:
    assert Client(source).get("/", headers={"Host": "evil.example"}).status_code == 421


@pytest.fixture(scope="module")
def served(history: Path) -> Iterator[str]:
    """Return the address of a server in a process of its own; it waits until that has come up."""
    source = Source(name="bridge", state=history, url=sqlite_url(history))
    with web_process(source, "127.0.0.1", PORT, None) as server:
        assert httpx.get(f"{server.url}/healthz", timeout=60.0).status_code == 503  # no monitor runs there
        assert server.problem is None
        yield server.url


@pytest.mark.live
def test_generated_token_is_readable_only_by_its_owner(served: str, history: Path) -> None:
    token = history / "web_token"
    assert token.stat().st_mode & 0o777 == 0o600
    answer = httpx.post(f"{served}/acknowledge", headers={"X-Modalwatch": "x"}, auth=("", token.read_text().strip()))
    assert answer.status_code == 202
    assert len(list(Inbox(history).taken())) == 1


@pytest.mark.live
def test_port_in_use_prevents_the_start(served: str, source: Source) -> None:
    with (
        pytest.raises(StartError, match=f"web: 127.0.0.1:{PORT}: .*in use"),
        web_process(source, "127.0.0.1", PORT, None),
    ):
        pass

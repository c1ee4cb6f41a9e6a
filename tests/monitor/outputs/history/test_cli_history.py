"""`modalwatch history`: tables, CSV, JSON, a picture; an unreadable file is one line."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.axes import Axes

from daq import Event
from monitor.outputs.history import HistoryStore, Writer
from monitor.outputs.history.schema import DAY
from monitor.results.windows import SelfTestResult, result_event
from monitor.text.quantities import utc
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.history import HOUR, START, change, run_events, sqlite_url, write_years
from tests.support.thorough import few_of


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return the history of a run in which a mass was found."""
    with HistoryStore(sqlite_url(tmp_path)) as store:
        store.write(run_events())
    return tmp_path / "history.sqlite"


def test_tables_summarize_the_run(modalwatch: Commands, file: Path) -> None:
    done = modalwatch("history", file)
    assert (done.code, done.err) == (0, "")
    for text in (
        "20 windows, 11 judged, 8 over the limit",
        "state: alarm",
        "active",
        "Missing scans of device",
        ": 12",
    ):
        assert text in done.out


def test_long_history_is_summarized_by_day(modalwatch: Commands, tmp_path: Path) -> None:
    n = write_years(sqlite_url(tmp_path), years=0.1, step=HOUR, n_modes=2)
    with HistoryStore(sqlite_url(tmp_path)) as store:
        store.write([change(START + HOUR, "alarm", "a [bold] mass"), change(START + 3 * HOUR, "normal", lasted=7200.0)])
    files = [tmp_path / name for name in ("h.csv", "h.json", "h.png")]
    done = modalwatch("history", sqlite_url(tmp_path), "--csv", files[0], "--json", files[1], "--plot", files[2])
    assert (done.code, done.err) == (0, "")
    for text in (f"{n} windows", "2026-01-01 01:00:00 UTC", "2 h", "a [bold] mass"):
        assert text in done.out
    lines = list(csv.DictReader(files[0].read_text(encoding="utf-8").splitlines()))
    assert sum(int(line["n"]) for line in lines if line["mode"] == "2") == n
    found = json.loads(files[1].read_text(encoding="utf-8"))
    assert (found["every"], found["state"], len(found["alarms"])) == ("day", "normal", 1)
    assert files[2].read_bytes().startswith(b"\x89PNG")


def test_accepted_change_is_marked_at_the_end_of_its_alarm(
    modalwatch: Commands, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarm = next(e for e in run_events() if e.topic == "/result/alarm" and e.payload["state"] == "alarm")
    last = max(e.time for e in run_events())
    reference = next(e for e in run_events() if e.topic == "/result/reference")
    taken = {"time": last - 5, "raised": alarm.time, "cause": "antenna", "by": "Ada", "found": "302 g", "n_windows": 6}
    taken |= {"shift_percent": [-1.0], "shift_std_percent": [0.1]}
    moved = replace(reference, time=last, payload=reference.payload | {"time": last, "accepted": [taken]})
    with HistoryStore(f"sqlite:///{file}") as store:
        store.write([moved, change(last, "normal", "accepted by Ada", kind="accepted", lasted=60.0)])
    written: list[str] = []
    drawn = Axes.annotate

    def annotate(axes: Axes, text: str, *more: Any, **how: Any) -> None:
        written.append(text)
        drawn(axes, text, *more, **how)

    monkeypatch.setattr(Axes, "annotate", annotate)
    files = [tmp_path / "h.json", tmp_path / "h.png"]
    assert modalwatch("history", file, "--json", files[0], "--plot", files[1]).code == 0
    assert json.loads(files[0].read_text(encoding="utf-8"))["accepted"] == [taken]
    assert written == [f"accepted as 'antenna' by Ada, {utc(last)}"]


def test_self_tests_are_summarized_in_one_line(modalwatch: Commands, file: Path, tmp_path: Path) -> None:
    assert "self-tests: none" in modalwatch("history", file).out
    reported: dict[str, Any] = {"mass": 0.15, "places": 24, "last_passed": None}
    tests = [
        SelfTestResult(time=START + k * HOUR, passed=detected >= 12, detected=detected, **reported)
        for k, detected in enumerate((3, 20, 11), 1)
    ]
    first, last = ("self-tests: 1, 0 passed; the last ", "11 of 24 places; passed last 2026-01-01 02:00:00 UTC")
    for until, text in ((1, "150 g would raise the alarm at 3 of 24 places; none has passed"), (3, last)):
        with HistoryStore(f"sqlite:///{file}") as store:
            store.write([result_event(test) for test in tests[:until]])
        done = modalwatch("history", file, "--json", tmp_path / "h.json", "--force")
        assert (text in done.out, first in done.out) == (True, until == 1)
    assert [test["json"]["detected"] for test in json.loads((tmp_path / "h.json").read_text())["self_tests"]] == [
        3,
        20,
        11,
    ]


@pytest.mark.parametrize(
    ("down", "days", "n", "newest"),
    few_of(
        [
            (0, "1", 25, ""),  # both ends included
            (14 * DAY, "16", 56, "; the newest 2026-01-08 07:00:00 UTC"),  # by the day: whole ones
            (-2 * HOUR, "1", 27, ""),  # by a clock that ran ahead
            (12 * HOUR, "1", 13, "; the newest 2026-01-08 07:00:00 UTC"),
            (14 * DAY, "7", 0, "; the newest 2026-01-08 07:00:00 UTC"),
            (0, "inf", 175, ""),
        ],
        3,
    ),
)
def test_last_days_are_counted_from_now(
    modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, down: int, days: str, n: int, newest: str
) -> None:
    """A monitor that was down for that time, an alarm raised since, and a notice that could not be sent."""
    url = sqlite_url(tmp_path)
    end = START + HOUR * write_years(url, years=0.02, step=HOUR, n_modes=1)
    with HistoryStore(url) as store:
        late = Event(topic="/event/notice_failed", time=end + 10 * DAY, payload={"why": "broken"})
        store.write([change(end - 3 * DAY, "alarm", "a mass"), late])
    monkeypatch.setattr("monitor.cli.operation.history_output.time_ns", lambda: end + down)
    files = [tmp_path / name for name in ("h.json", "h.csv", "h.png")]
    done = modalwatch("history", url, "--days", days, "--json", files[0], "--csv", files[1], "--plot", files[2])
    assert (done.code, done.err) == (0, "")
    assert f"\n{n} windows, {n} judged, 0 over the limit{newest}\n" in done.out
    for text in ("state: alarm", "a mass", "broken"):
        assert text in done.out
    found = json.loads(files[0].read_text())
    if found["every"] == "window":
        assert len(found["trends"]["1"]) == len(files[1].read_text().splitlines()) - 1 == n
    assert found["end"] == end + max(0, down)


def test_unreadable_history_is_a_one_line_error(modalwatch: Commands, tmp_path: Path, file: Path) -> None:
    assert_refused(modalwatch("history", tmp_path / "none"), "TARGET", "SITE.toml")
    assert_refused(modalwatch("history", f"sqlite:///{tmp_path / 'none'}"), "there is no history yet")
    assert_refused(modalwatch("history", "mysql9://x"), "expected sqlite:///FILE")
    (tmp_path / "text").write_text("no database" * 100)
    assert_refused(modalwatch("history", tmp_path / "text"), "file is not a database")
    HistoryStore(f"sqlite:///{tmp_path / 'empty'}").__exit__()
    assert_refused(modalwatch("history", tmp_path / "empty"), "no window has been analysed yet")
    assert_refused(modalwatch("history", file, "--plot", tmp_path / "h.what"), "--plot", "h.what")
    assert_refused(modalwatch("history", file, "--csv", tmp_path / "no" / "h.csv"), "--csv", "h.csv")


def test_site_of_many_is_chosen_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    url, modalwatch = sqlite_url(tmp_path), Commands(monkeypatch, capsys)
    for site in ("bridge", "tower"):
        with HistoryStore(url, Writer(site=site)) as store:
            store.write(run_events() if site == "tower" else run_events()[:3])
    assert_refused(modalwatch("history", url), "holds 2 sites (bridge, tower): expected --site-name NAME")
    assert_refused(
        modalwatch("history", url, "--site-name", "towr"), "--site-name: expected a site of the database, found 'towr'"
    )
    assert "20 windows" in modalwatch("history", url, "--site-name", "tower").out
    assert "3 windows" in modalwatch("history", url, "--site-name", "bridge").out

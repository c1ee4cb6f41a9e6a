"""An analysis that falls behind leaves windows out by rule, reports it, and a replay leaves out the same."""

from pathlib import Path

import pytest

from daq import Item, McapWriter
from monitor.outputs.notices.filter import NoticeFilter
from monitor.results.service_events import Stopped
from monitor.results.windows import Result, WindowResult, result_event
from monitor.service.replay import replay
from monitor.service.worker import LiveState, SavedState, Worker
from monitor.settings import parse_settings
from monitor.watch.backlog import MAX_WINDOWS, SKIPPED, Backlog
from monitor.watch.pipeline import Pipeline
from tests.support.daq.blocks import START, make_block
from tests.support.monitor.played_windows import BASELINE, STEP, Played, judged, run, site_settings
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[analysis]
window_seconds = 4
baseline_windows = 5
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y", z = "beam_left_z"}
"""
SECONDS = 90


def test_backlog_above_the_limit_skips_all_but_the_newest_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six may wait; from the seventh on all are left out, but for the last."""
    windows = list(Played(41, monkeypatch).windows(12))
    for waiting, expected in ((MAX_WINDOWS, 0), (MAX_WINDOWS + 1, MAX_WINDOWS), (11, 10)):
        newest = windows[waiting].end
        backlog = Backlog(site_settings(), lambda newest=newest: newest)  # type: ignore[misc]
        left_out = [backlog(i, window.end) for i, window in enumerate(windows[: waiting + 1])]
        assert left_out == [True] * expected + [False] * (waiting + 1 - expected)


def test_short_windows_are_skipped_after_one_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    [window] = Played(42, monkeypatch).windows(1)
    for speed, seconds, left_out in ((1, 59, False), (1, 61, True), (10, 599, False), (10, 601, True)):
        settings = parse_settings(f"{SITE}[clock]\nspeed = {speed}")
        backlog = Backlog(settings, lambda seconds=seconds: window.end + seconds * 10**9)  # type: ignore[misc]
        assert backlog(0, window.end) == left_out


def test_monitoring_continues_after_skipped_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(43, monkeypatch)
    out = {3, BASELINE + 3, BASELINE + 4}
    pipeline = Pipeline(played.structure, played.settings, None, lambda index, _: index in out)
    results = run(pipeline, played.windows(BASELINE + 8))
    windows = judged(results)
    assert [w.index for w in windows] == list(range(BASELINE + 8))
    assert {w.index for w in windows if w.skipped} == out
    assert all(w.problem == SKIPPED and not w.modes for w in windows if w.skipped)
    assert [w.index for w in windows if w.novelty] == [i for i in range(BASELINE + 1, BASELINE + 8) if i not in out]
    assert windows[-1].start - windows[-2].start == STEP * 10**9

    news = NoticeFilter("frame")
    reported = [notice.text for w in windows if (notice := news.of(result_event(w))) is not None]
    assert reported == ["windows are left out: the analysis has fallen behind"] * 2  # each time once


@pytest.mark.live
def test_replay_skips_the_same_windows_as_the_live_run(tmp_path: Path) -> None:
    """All signals come at once, before the first window is looked at: only the last one is analysed."""
    blocks = [make_block("beam_left", first) for first in range(0, SECONDS * 1000, 250)]
    stopped = Stopped(dropped=0).event(START)
    found: list[Result] = []
    with Worker(t_structure_toml(), SITE) as worker:
        items: tuple[Item, ...] = (*blocks, stopped)
        for item in items:
            worker.feed(item)
        while True:
            results = list(worker.results(30.0))
            found += [r for r in results if r is not None and not isinstance(r, SavedState | LiveState)]
            if None in results:
                break
    windows = [r for r in found if isinstance(r, WindowResult)]
    assert len(windows) == SECONDS // 4
    assert [w.skipped for w in windows] == [True] * (len(windows) - 1) + [False]

    writer = McapWriter(tmp_path / "log.mcap", {"site.toml": SITE, "structure.toml": t_structure_toml()})
    items = (*blocks, *map(result_event, found), stopped)
    for item in items:
        writer.write(item)
    writer.close()
    report = replay(tmp_path / "log.mcap", None, lambda _: None)
    assert len(report.found) == len(found)
    assert report.same

"""`report` and `view` as a user types them."""

import socket
from pathlib import Path

import pytest
from cli_helpers import Commands, assert_refused
from rrd_helpers import Rrd

from monitor.logged import load_run

LOG = Path(__file__).parents[2] / "replay_data" / "t_frame_added_mass.mcap"


@pytest.fixture(autouse=True)
def _no_display(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_report_is_written_from_the_log_alone(modalwatch: Commands, tmp_path: Path) -> None:
    done = modalwatch("report", LOG, "-o", tmp_path / "page.html")
    assert done.code == 0, done
    assert done.out == f"report: {tmp_path / 'page.html'}\n"
    assert "The structure has changed" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_a_log_becomes_a_recording_in_the_cache_and_one_line_says_how_to_see_it(
    modalwatch: Commands, tmp_path: Path
) -> None:
    done = modalwatch("view", LOG)
    assert done.code == 0, done
    path = tmp_path / "cache" / "modalwatch" / "t_frame_added_mass.rrd"
    assert f"recording: {path}" in done.out
    assert f"rerun --serve-web --bind 127.0.0.1 {path}" in done.out
    rrd, story = Rrd(path), load_run(LOG).story
    assert rrd.scalars("/trend/shift/mode_2")[0].tolist() == [w.end for w in story.watched]
    assert len(rrd.entities("/signal")) == len(story.windows[0].channels)


@pytest.mark.parametrize("command", ["report", "view"])
def test_what_cannot_be_shown_exits_2_and_is_named(command: str, modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(b"not a log")
    (tmp_path / "empty").mkdir()
    for name in ("cut.mcap", "none.mcap", "empty"):
        assert_refused(modalwatch(command, tmp_path / name), f"error: {tmp_path / name}: ")


def test_a_file_that_cannot_be_written_is_named(modalwatch: Commands, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    path = tmp_path / "file" / "run.rrd"
    assert_refused(modalwatch("view", LOG, "--out", path), f"error: {path}: cannot be written")
    assert_refused(modalwatch("report", LOG, "--out", path), f"error: {path}: cannot be written")


@pytest.mark.parametrize("url", ["http://host", "rerun+http://:x/proxy", "rerun+http://h:99999/proxy"])
def test_an_address_without_host_or_port_is_refused(url: str, modalwatch: Commands) -> None:
    assert_refused(modalwatch("view", url), f"error: {url}: ")


def test_a_monitor_that_does_not_run_is_told(modalwatch: Commands) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound, yet nobody listens
        url = f"rerun+http://127.0.0.1:{closed.getsockname()[1]}/proxy"
        assert_refused(modalwatch("view", url), f"error: {url}: nothing answers there")


def test_a_live_server_is_opened_with_its_signals(modalwatch: Commands) -> None:
    with socket.socket() as first:
        first.bind(("127.0.0.1", 0))
        first.listen()
        url = f"rerun+http://127.0.0.1:{first.getsockname()[1]}/proxy"
        done = modalwatch("view", url)
    assert done.code == 0, done
    assert done.out.strip().endswith(url)

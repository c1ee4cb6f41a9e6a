"""`view` as a user types it, and what it opens."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from rrd_helpers import Rrd

from monitor.cli import view
from monitor.errors import ArgumentError
from monitor.logged import load_run

LOG = Path(__file__).parents[2] / "replay_data" / "t_frame_added_mass.mcap"
VIEW = [sys.executable, "-c", "from monitor.cli.main import main; main()", "view"]


def run_view(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [*VIEW, *map(str, arguments)]
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(command, env=kept | environment, capture_output=True, text=True, timeout=60, check=False)


def test_a_log_becomes_a_recording_in_the_cache_and_one_line_says_how_to_see_it(tmp_path: Path) -> None:
    done = run_view(LOG, XDG_CACHE_HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr
    path = tmp_path / "modalwatch" / "t_frame_added_mass.rrd"
    assert f"recording: {path}" in done.stdout
    assert f"rerun --serve-web --bind 127.0.0.1 {path}" in done.stdout
    rrd, story = Rrd(path), load_run(LOG).story
    assert rrd.scalars("/trend/shift/mode_2")[0].tolist() == [w.end for w in story.watched]
    assert len(rrd.entities("/signal")) == len(story.windows[0].channels)


def test_what_cannot_be_viewed_exits_2_and_is_named(tmp_path: Path) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        url = f"rerun+http://127.0.0.1:{closed.getsockname()[1]}/proxy"
        for target in (tmp_path / "none", url):
            done = run_view(target)
            assert done.returncode == 2
            assert done.stderr.startswith(f"error: {target}: ")
            assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("url", ["http://host", "rerun+http://:x/proxy", "rerun+http://h:99999/proxy"])
def test_an_address_without_host_or_port_is_refused(url: str) -> None:
    with pytest.raises(ArgumentError):
        view.view_command(url, None, show=False)


def test_a_live_server_is_opened_with_its_signals(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with socket.socket() as first:
        first.bind(("127.0.0.1", 0))
        first.listen()
        port = first.getsockname()[1]
        assert view.view_command(f"rerun+http://127.0.0.1:{port}/proxy", None, show=True) == 0
    assert capsys.readouterr().out.strip().endswith(f"rerun+http://127.0.0.1:{port}/proxy")

"""Requirements of a run other than devices are tested by `check`, and named where they are not met."""

import os
import shutil
import socket
from pathlib import Path

import pytest

from monitor.service.site import load_site
from monitor.service.startup.preflight import Finding, look_around
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y"}
[recorder]
min_free_gb = 0
"""


def looked(folder: Path, more: str = "", *, file: str = SITE) -> dict[str, Finding]:
    (folder / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    (folder / "site.toml").write_text(file + more, encoding="utf-8")
    return {finding.what: finding for finding in look_around(load_site(folder / "site.toml"))}


def test_minimal_site_checks_history_disk_and_clock(tmp_path: Path) -> None:
    found = looked(tmp_path)
    assert all(finding.well for finding in found.values())
    assert list(found) == ["window", "history", "disk", "clock"]
    assert found["window"].text == "modes from 0.17 Hz are sought"  # 100 periods in 600 s
    assert "history.sqlite, made at the start" in found["history"].text
    assert not (tmp_path / "state").exists()  # nothing is made


@pytest.mark.parametrize(
    ("analysis", "well"),
    [("window_seconds = 1.3", True), ("window_seconds = 1.2", False), ("window_seconds = 1.2\nband = [90, 200]", True)],
)
def test_window_in_which_no_mode_is_sought_is_named(tmp_path: Path, analysis: str, well: bool) -> None:
    """At 1000 Hz: 100 periods of the frequency up to which the lowest of the rates, 200 Hz, is used, 0.4 of it."""
    found = looked(tmp_path, f"[analysis]\n{analysis}\n")["window"]
    assert found.well == well
    assert well or found.text.startswith("analysis.window_seconds: expected more than 1.25 s at 1000 Hz, found 1.2; ")


def test_unreadable_history_is_reported(tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "history.sqlite").write_bytes(b"no database" * 1000)
    assert not looked(tmp_path)["history"].well


def test_port_in_use_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        found = looked(tmp_path, f"[web]\nport = {port}\n")
        assert (found["web"].well, str(port) in found["web"].text) == (False, True)
    assert looked(tmp_path, f"[web]\nport = {port}\n")["web"].well


@pytest.mark.parametrize(
    ("target", "well", "says"),
    [
        ('command = ["true"]', True, "command "),
        ('command = ["no-such-program"]', False, "expected a program as its first word, found none of that name"),
        ('webhook = "http://127.0.0.1:{port}/hook"', True, "http://127.0.0.1:{port} answers"),
        ('webhook = "http://127.0.0.1:1/hook"', False, "http://127.0.0.1:1: "),
        ('mqtt = "mqtt://127.0.0.1:{port}/t"', True, "mqtt://127.0.0.1:{port} answers"),
    ],
)
def test_notify_targets_are_contacted_without_sending_a_notice(
    tmp_path: Path, target: str, well: bool, says: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = str(listener.getsockname()[1])
        found = looked(tmp_path, f"[[notify]]\n{target.replace('{port}', port)}\n")["notify 1"]
        assert (found.well, says.replace("{port}", port) in found.text) == (well, True), found
        if "{port}" in target:
            taken, _ = listener.accept()
            with taken:
                assert taken.recv(1) == b""


@pytest.mark.parametrize("well", [True, False])
def test_broker_of_home_assistant_is_contacted(tmp_path: Path, well: bool) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1] if well else 1
        found = looked(tmp_path, f'[home_assistant]\nmqtt = "mqtt://u:secret@127.0.0.1:{port}/x"\n')["home assistant"]
    assert (found.well, f"mqtt://127.0.0.1:{port}" in found.text, "secret" in found.text) == (well, True, False)


def test_insufficient_disk_space_is_reported(tmp_path: Path) -> None:
    free = shutil.disk_usage(tmp_path).free / 1e9
    found = looked(tmp_path, file=SITE.replace("min_free_gb = 0", f"min_free_gb = {2 * free}"))["disk"]
    assert (found.well, "less than recorder.min_free_gb" in found.text) == (False, True)


def test_clock_of_the_host_is_not_checked_for_recorded_devices(tmp_path: Path) -> None:
    recorded = 'driver = "replay"\nlog = {file = "run.mcap", device = "beam_left"}'
    file = SITE.replace('driver = "epson-uart"\nport = "/dev/none"', recorded)
    assert looked(tmp_path, file=file)["clock"].text == "times are those of the recorded devices"


def test_clock_behind_the_newest_log_is_reported(tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    newest = tmp_path / "log" / "later.mcap"
    newest.touch()
    assert looked(tmp_path)["clock"].well
    stamp = newest.stat().st_mtime + 7200
    os.utime(newest, (stamp, stamp))
    found = looked(tmp_path)["clock"]
    assert (found.well, "it has run backwards" in found.text) == (False, True)

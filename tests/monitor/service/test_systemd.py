"""Messages to systemd, over a real socket, and its unit."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from monitor.service.systemd.notify import ServiceManager, SignsOfLife
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.monitor.service.manager import Listener
from updater import t_structure_toml

WELL = SignsOfLife(data=0.1, disk=0.1, losing=False)
SITE = """structure = "t_structure.toml"
[recorder]
min_free_gb = 0
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "{port}"
channels = {{y = "beam_left_y"}}
"""


@pytest.fixture(params=["file", "abstract"])
def listener(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Listener, str]:
    path = str(tmp_path / "notify") if request.param == "file" else f"@modalwatch-{os.getpid()}"
    return Listener(path.replace("@", "\0")), path


def test_messages_to_the_service_manager(listener: tuple[Listener, str]) -> None:
    notifications, path = listener
    manager = ServiceManager({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "60000000", "WATCHDOG_PID": str(os.getpid())})
    manager.ready()
    manager.feed(WELL)
    manager.feed(WELL)  # not again before a quarter of the period
    manager.status("watching\nand more")
    manager.reloading()
    manager.stopping()
    assert notifications.received("STOPPING=1", 1.0)
    assert notifications.reported[:3] == ["READY=1", "WATCHDOG=1", "STATUS=watching"]
    assert notifications.reported[3].startswith("RELOADING=1\nMONOTONIC_USEC=")
    assert len(notifications.reported) == 5


@pytest.mark.parametrize(
    ("signs", "says"),
    [
        (SignsOfLife(data=11.0, disk=0.1, losing=False), "no data for 11 s"),
        (SignsOfLife(data=0.1, disk=12.0, losing=False), "the log has not been written for 12 s"),
        (SignsOfLife(data=0.1, disk=0.1, losing=True), "memory buffer is full"),
    ],
)
def test_watchdog_is_not_pinged_while_data_or_log_are_stalled(tmp_path: Path, signs: SignsOfLife, says: str) -> None:
    notifications = Listener(str(tmp_path / "notify"))
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "4"})
    assert says in str(signs.standing)
    manager.feed(signs)
    manager.ready()
    assert notifications.received("READY=1", 1.0)
    assert notifications.reported == ["READY=1"]
    manager.feed(WELL)
    assert notifications.received("WATCHDOG=1", 1.0)
    manager.stopping()  # ends the listener
    assert notifications.received("STOPPING=1", 1.0)


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"NOTIFY_SOCKET": "/none/such"},
        {"WATCHDOG_USEC": "4", "WATCHDOG_PID": "1", "NOTIFY_SOCKET": "/none"},
        {"WATCHDOG_USEC": "soon"},
    ],
)
def test_missing_service_manager_is_no_error(environment: dict[str, str]) -> None:
    manager = ServiceManager(environment)
    manager.ready()
    manager.feed(WELL)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    path = tmp_path / "bridge 100%.toml"
    path.write_text(SITE.format(port="/dev/none"), encoding="utf-8")
    return path


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd is installed")
@pytest.mark.parametrize("scope", ["system", "user"])
@pytest.mark.parametrize("kind", ["site", "fleet"])
def test_systemd_accepts_the_unit(modalwatch: Commands, site: Path, scope: str, kind: str) -> None:
    """systemd's own check of it prints nothing: every key is known, every path can be read."""
    as_whom = ["--user"] if scope == "user" else ["--as", "daemon"]
    if kind == "fleet":
        site.write_text('mqtt = "mqtt://h/modalwatch"')
        as_whom.append("--fleet")
    text = modalwatch("install-service", site, "--print", *as_whom).out
    assert f' {"run" if kind == "site" else "fleet"} "{site.parent}/bridge 100%%.toml"\n' in text
    unit = site.parent / "modalwatch-test.service"
    unit.write_text(text)
    command = ["systemd-analyze", "verify", "--man=no", f"--{scope}", str(unit)]
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(site.parent), "HOME": str(site.parent)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert [line for line in done.stderr.splitlines() if unit.name in line] == []
    assert done.returncode == 0, done
    assert "Type=notify" in text
    assert ("ProtectSystem=strict" in text) == (scope == "system")
    assert "\nMemoryMax=" in text


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd is installed")
@pytest.mark.parametrize(
    ("port", "devices", "most"),
    [
        ("/dev/serial/by-id/usb-x", {"DeviceAllow=char-ttyUSB rw", "DeviceAllow=char-ttyACM rw"}, 2.0),
        ("/dev/ttyS3", {"DeviceAllow=char-ttyS rw"}, 2.0),
        ("/dev/odd%1", {"DeviceAllow=/dev/odd%%1 rw"}, 2.0),
        ("elsewhere", {"PrivateDevices=yes"}, 1.7),
    ],
)
def test_unit_allows_only_the_device_ports_of_the_site(
    modalwatch: Commands, site: Path, port: str, devices: set[str], most: float
) -> None:
    site.write_text(SITE.format(port=port), encoding="utf-8")
    text = modalwatch("install-service", site, "--print", "--as", "daemon").out
    assert {line for line in text.splitlines() if line.startswith(("DeviceAllow", "PrivateDevices"))} == devices
    unit = site.parent / "modalwatch-test.service"
    unit.write_text(text)
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", str(unit)]
    reported = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = re.search(r"Overall exposure level for .*: ([\d.]+) ", reported)
    assert found is not None, reported
    assert float(found[1]) <= most, reported


def test_site_folder_owned_by_root_requires_a_user(modalwatch: Commands, site: Path) -> None:
    if site.parent.stat().st_uid == 0:
        assert_refused(modalwatch("install-service", site, "--print"), "belongs to root", "--as USER")
        assert not (site.parent / "state").exists()
    assert_refused(modalwatch("install-service", site, "--print", "--as", "nobody-of-that-name"), "--as")
    assert_refused(modalwatch("install-service", site, "--print", "--as", "daemon", "--user"), "--as")
    assert "\nUser=daemon\n" in modalwatch("install-service", site, "--print", "--as", "daemon").out


def test_unit_is_rewritten_but_foreign_units_are_not_overwritten(
    modalwatch: Commands, site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(site.parent))
    done = modalwatch("install-service", site, "--user")
    [unit] = (site.parent / ".config/systemd/user").glob("*.service")
    assert (done.code, str(unit) in done.out, "systemctl --user daemon-reload" in done.out) == (0, True, True)
    assert (site.parent / "log").is_dir()
    assert modalwatch("install-service", site, "--user").code == 0
    unit.write_text("[Service]\n")
    assert_refused(modalwatch("install-service", site, "--user"), str(unit), "not written by this program")
    site.write_text("structure = 3")
    assert_refused(modalwatch("install-service", site, "--user"), site, "structure")


@pytest.mark.skipif(os.geteuid() != 0, reason="only the superuser gives folders away")
def test_folders_created_by_root_get_the_owner_of_the_site(modalwatch: Commands, site: Path) -> None:
    """It runs as the owner of the site's folder, whoever has installed it."""
    os.chown(site.parent, 1234, 1234)
    assert modalwatch("install-service", site, "--print").code == 0
    assert {(site.parent / name).stat().st_uid for name in ("state", "log")} == {1234}

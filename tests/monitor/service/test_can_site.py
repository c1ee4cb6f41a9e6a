"""Devices on a CAN bus in the settings: `check` and `run` with them, and one line for each error."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from daq import Block, Event, LogError, read_log
from monitor.errors import SettingsError
from monitor.settings import parse_settings
from tests.support.daq.can_buses import DBC_SITE, IMU, can_process, wait_for
from tests.support.monitor.cli import Commands, assert_refused
from updater import t_structure_toml

pytestmark = pytest.mark.live

SITE = """structure = "t_structure.toml"
[analysis]
window_seconds = 60
baseline_windows = 10
[[device]]
name = "beam_left"
driver = "epson-can"
can = {interface = "slcan", channel = "PORT", node = 1}
rate = 500
channels = {y = "beam_left_y", z = "beam_left_z"}
[[device]]
name = "beam_right"
driver = "epson-can"
can = {interface = "slcan", channel = "PORT", node = 2}
rate = 500
channels = {y = "beam_right_y", z = "beam_right_z"}
"""
WRONG_SETTINGS = {
    "no such node": (
        "node = 2",
        "node = 128",
        "device.1.can.node: expected less than or equal to 127, found 128",
    ),
    "one node twice": ("node = 2", "node = 1", "device: two are connected to slcan:PORT node 1"),
    "no such interface": ('"slcan"', '"slcann"', "device.0.can.interface: expected one of "),
    "two bit rates": (
        "node = 2",
        "node = 2, bitrate = 500000",
        "device: slcan:PORT node 2 is at 500000 bit/s, its bus at",
    ),
    "two producers of SYNC": (
        "node = ",
        'sync = "producer", node = ',
        "device: slcan:PORT node 2 and slcan:PORT node 1 both produce SYNC, expected one on a bus",
    ),
    "misspelt": ("node = 2", "nod = 2", "device.1.can.nod: no such setting, did you mean 'node'?"),
    "missing": ('channel = "PORT", ', "", "device.0.can.channel: is missing"),
    "two places": (
        "node = 1}",
        'node = 1}\nport = "PORT"',
        "`port`, `can`, `daqmx` and `log`, found port and can",
    ),
    "a serial driver": ('"epson-can"', '"epson-uart"', "driver epson-uart: expected `port`, found `can`: slcan:PORT"),
    "no such rate": (
        "rate = 500",
        "rate = 300",
        "rate of slcan:PORT node 1: expected one of [50, 100, 200, 500, 1000] Hz",
    ),
}
CANNOT_START = {
    "no such port": ("node = 1", "node = 1", "slcan:PORT node 1: the bus cannot be opened: No such file or directory"),
    "no such bit rate": ("node = ", "bitrate = 123, node = ", "bitrate of PORT: expected one of [10000, "),
    "no such network": ('"slcan"', '"socketcan"', "socketcan:PORT node 1: the bus cannot be opened: "),
    "no vendor's library": ('"slcan"', '"kvaser"', "kvaser:PORT node 1: the bus cannot be opened: "),
}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    return tmp_path / "site.toml"


@pytest.mark.parametrize(("old", "new", "says"), WRONG_SETTINGS.values(), ids=WRONG_SETTINGS)
def test_wrong_settings_are_one_line_with_file_and_field(
    modalwatch: Commands, site: Path, old: str, new: str, says: str
) -> None:
    site.write_text(SITE.replace(old, new))
    for command in ("check", "run"):
        assert_refused(modalwatch(command, site), f"{site}: ", says)


def test_sync_requires_one_rate_and_delay_and_excludes_dbc() -> None:
    synced = SITE.replace("node = ", 'sync = "consumer", node = ')
    assert [device.waits_for_sync for device in parse_settings(synced, "s").device] == [True, True]
    with pytest.raises(SettingsError, match=r"node 2 is at 200 Hz, slcan:PORT node 1 on the same SYNC at 500 Hz"):
        parse_settings("rate = 200".join(synced.rsplit("rate = 500", 1)), "s")
    with pytest.raises(SettingsError, match=r"node 2 and slcan:PORT node 1 on one SYNC: expected one `delay_ms`"):
        parse_settings("rate = 500\ndelay_ms = 3".join(synced.rsplit("rate = 500", 1)), "s")
    dbc = 'dbc = {file = "i.dbc", signals = {x = "X", y = "Y", z = "Z"}, counter = "C"}\n'
    with pytest.raises(SettingsError, match=r"device.0: .*can.sync: not possible with `dbc`"):
        parse_settings(SITE.replace("node = 1}", 'sync = "consumer"}\n' + dbc), "s")


@pytest.mark.parametrize(("old", "new", "says"), CANNOT_START.values(), ids=CANNOT_START)
def test_unopenable_bus_is_a_line_per_device_with_the_bus(
    modalwatch: Commands, site: Path, old: str, new: str, says: str
) -> None:
    site.write_text(SITE.replace(old, new))
    done = modalwatch("check", site)
    assert done.code == 3, done
    left, right = done.err.splitlines()
    assert left.startswith("error: device beam_left: "), done
    assert right.startswith("error: device beam_right: "), done
    assert says in left
    assert says.replace("node 1", "node 2") in right


def test_check_lists_the_nodes_and_names_a_missing_one(modalwatch: Commands, site: Path, tmp_path: Path) -> None:
    with can_process(tmp_path, 2) as bus:
        site.write_text(SITE.replace("PORT", bus.channel))
        done = modalwatch("check", site)
        assert (done.code, done.err) == (0, ""), done
        assert "A552 AC10 1.00 100" in done.out
        assert "A552 AC10 1.00 101" in done.out
        site.write_text(SITE.replace("PORT", bus.channel).replace("node = 2", "node = 9"))
        done = modalwatch("check", site)
        assert done.code == 3
        assert done.err == (
            f"error: device beam_right: slcan:{bus.channel} node 9: no M-A552 answers: No SDO response received\n"
        )


def test_run_logs_the_nodes_and_ends_on_sigterm_to_all_processes(site: Path, tmp_path: Path) -> None:
    """As a service manager does it: SIGTERM to the analysis too."""
    with can_process(tmp_path, 2) as bus:
        site.write_text(SITE.replace("PORT", bus.channel))
        command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "run", str(site)]
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
        ) as process:
            try:
                wait_for(lambda: len({block.device for log in tmp_path.glob("log/*") for block in blocks_of(log)}) == 2)
                os.killpg(process.pid, signal.SIGTERM)
                _, reported = process.communicate(timeout=20)
            finally:
                process.kill()
        assert (process.returncode, reported) == (0, "")
    (log,) = tmp_path.glob("log/*")
    assert {block.device for block in blocks_of(log)} == {"beam_left", "beam_right"}
    assert not [item for item in read_log(log) if isinstance(item, Event) and item.topic == "/event/gap"]


def blocks_of(log: Path) -> list[Block]:
    """Return the blocks so far; a log that has just begun has none."""
    try:
        return [item for item in read_log(log) if isinstance(item, Block)]
    except LogError:
        return []


@pytest.fixture
def dbc_site(site: Path) -> Path:
    (site.parent / "imu.dbc").write_text(IMU.read_text())
    return site


def test_check_of_a_dbc_sensor_reports_an_unexpected_rate(modalwatch: Commands, dbc_site: Path, tmp_path: Path) -> None:
    with can_process(tmp_path, 0, dbc=(str(IMU), "0", "0")) as bus:
        dbc_site.write_text(DBC_SITE.replace("PORT", bus.channel).replace("rate = 1000", "rate = 400"))
        done = modalwatch("check", dbc_site)
    assert (done.code, done.err) == (1, ""), done
    assert "imu GroupCounter 0x6, Acceleration 0x34" in done.out
    assert "device beam_left: expected 400 scans per second, found " in done.out


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"imu.dbc"', '"gone.dbc"', "gone.dbc: cannot be read: No such file or directory"),
        ('"accX"', '"accx"', "imu.dbc: has no signal 'accx', did you mean 'accX'?"),
        ('"Counter"', '"Count"', "imu.dbc: has no signal 'Count', did you mean 'Counter'?"),
    ],
)
def test_unsuitable_dbc_file_is_a_one_line_error(
    modalwatch: Commands, dbc_site: Path, old: str, new: str, says: str
) -> None:
    dbc_site.write_text(DBC_SITE.replace(old, new))
    for command in ("check", "run"):
        assert_refused(modalwatch(command, dbc_site), f"{dbc_site.parent}/{says}")
    assert not (dbc_site.parent / "log").exists()

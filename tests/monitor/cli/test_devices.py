"""`devices`: emulated devices on ptys are found, and the settings that are printed work."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from daq import SystemClock, search_port
from daq.drivers import SerialPortInfo
from daq.emulator import (
    EmulatedAdapter,
    EmulatedEpson,
    EmulatedEpsonCan,
    EmulatedNode,
    EmulatedPort,
    EmulatedShake,
    EmulatedSlcan,
    EmulatedTextLines,
    serve_all,
    unplugging,
)
from monitor.settings import parse_settings
from tests.support.daq.can_buses import serving
from tests.support.daq.emulated_ports import LINES, Ramp
from tests.support.daq.steady import AtRest
from tests.support.monitor.cli import Commands

CLOCK = SystemClock()


@pytest.fixture
def plugged() -> Iterator[list[str]]:
    """Return ports: an A352, a node that measures y and z, one that does not listen, an adapter with two A552, lines of
    text behind a network, and a Raspberry Shake.
    """
    devices: list[EmulatedPort] = [
        EmulatedEpson(Ramp(), CLOCK, serial_number="T0000042"),
        EmulatedNode(Ramp(), CLOCK, serial_number="N 7", axes=(1, 2)),
        EmulatedNode(Ramp(), CLOCK, serial_number="N 7", rate=500.0),
        EmulatedSlcan([EmulatedEpsonCan(Ramp(), CLOCK, node=k, serial_number=100 + k) for k in (3, 120)]),
        EmulatedAdapter(EmulatedTextLines(AtRest(9_806_650), CLOCK, LINES, rate=1000.0, checksum=True), "tcp"),
        EmulatedShake(AtRest(3_770_488), CLOCK),
    ]
    with unplugging(devices), serving(lambda: serve_all(devices, 0)):
        yield [device.port for device in devices]


def named(ports: list[str]) -> list[str]:
    return [word for port in ports for word in ("--port", port)]


@pytest.mark.live
def test_found_devices_are_listed_with_valid_settings(modalwatch: Commands, plugged: list[str], tmp_path: Path) -> None:
    done = modalwatch("devices", *named(plugged), "--json", tmp_path / "found.json")
    assert (done.code, done.err) == (0, ""), done
    table, toml = done.out[: done.out.index("[[device]]")], done.out[done.out.index("[[device]]") :]
    for text in ("A352AD10 T0000042", "emulated N 7", "SLCAN adapter V1013", "node 3: A552 103", "node 120: A552 220"):
        assert text in table
    settings = parse_settings('structure = "s.toml"\n' + toml)
    adapter = plugged[3]
    assert [(d.name, d.driver, str(d.place), d.rate, "".join(d.channels)) for d in settings.device] == [
        ("device_T0000042", "epson-uart", plugged[0], 1000.0, "xyz"),
        ("device_N_7", "modalwatch-node", plugged[1], 1000.0, "yz"),
        ("device_N_7_3", "modalwatch-node", plugged[2], 500.0, "xyz"),
        ("device_103", "epson-can", f"slcan:{adapter} node 3", 1000.0, "xyz"),
        ("device_220", "epson-can", f"slcan:{adapter} node 120", 1000.0, "xyz"),
        ("device_6", "serial-text", plugged[4], 1000.0, "xyz"),
        ("device_7", "raspberry-shake", plugged[5], 100.0, "xyz"),
    ]
    lines = settings.device[5].text
    assert lines is not None
    assert lines.form.columns == (*LINES.columns[:-1], "-")  # a temperature is not recognized
    assert lines.form.unit == LINES.unit
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert [port["device"] for port in found["ports"]] == plugged
    assert found["ports"][3]["devices"][1]["place"]["node"] == 120
    assert tomllib.loads(toml)["device"][3]["can"]["channel"] == adapter


def test_given_port_without_a_device_is_an_error(
    modalwatch: Commands, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def search(path: str, bitrate: int) -> None:
        if path != "/dev/silent":
            search_port(path, bitrate)

    monkeypatch.setattr("monitor.cli.site.device_search.search_port", search)
    done = modalwatch("devices", *named(["/dev/silent", str(tmp_path / "none")]))
    assert done.code == 3
    silent, missing = done.err.splitlines()
    assert silent == "error: /dev/silent: no device that is known answers"
    assert missing.startswith(f"error: {tmp_path / 'none'}: cannot be opened")
    assert "# no device was found" in done.out


def test_all_ports_are_listed_and_only_usb_ports_are_probed(
    modalwatch: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports = [
        SerialPortInfo(device="/dev/ttyS0", by_id=None, description="", is_usb=False),
        SerialPortInfo(device="/dev/ttyUSB0", by_id="/dev/serial/by-id/usb-A", description="FT232R", is_usb=True),
    ]
    asked: list[str] = []

    def search(path: str, bitrate: int) -> None:
        asked.append(f"{path} {bitrate}")

    monkeypatch.setattr("monitor.cli.site.device_search.serial_ports", lambda: ports)
    monkeypatch.setattr("monitor.cli.site.device_search.can_adapters", lambda: [("socketcan", "can0")])
    monkeypatch.setattr("monitor.cli.site.device_search.search_port", search)
    done = modalwatch("devices", "--bitrate", 500_000)
    assert done.code == 0
    assert asked == ["/dev/serial/by-id/usb-A 500000"]
    for text in ("/dev/ttyUSB0", "FT232R", "no known device", "not queried", "can0", "interface socketcan"):
        assert text in done.out
    asked.clear()
    assert modalwatch("devices", "--no-probe").code == 0
    assert asked == []
    assert modalwatch("devices", "--all").code == 0
    assert sorted(asked) == ["/dev/serial/by-id/usb-A 1000000", "/dev/ttyS0 1000000"]

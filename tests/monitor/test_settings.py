"""Bad settings get one clear error that names file and key."""

from pathlib import Path

import pytest

from daq import CanAddress, DbcAddress, DbcSensor
from monitor.errors import SettingsError
from monitor.settings import load_settings, parse_settings

GOOD = """
structure = "t_structure.toml"

[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/ttyUSB0"
channels = {y = "beam_left_y", z = "beam_left_z"}
"""
CAN = 'can = {interface = "slcan", channel = "/dev/ttyACM0", node = 3}\n'
DBC = """driver = "can-dbc"
can = {interface = "slcan", channel = "/dev/ttyACM0"}
dbc = {file = "imu.dbc", signals = {x = "accX", y = "accY", z = "accZ"}, counter = "Counter"}
"""
WITH_DBC = GOOD.replace('driver = "epson-uart"\nport = "/dev/ttyUSB0"\n', DBC)
OTHER = '[[device]]\nname = "b"\ndriver = "epson-uart"\nport = "/dev/ttyUSB0"\nchannels = {x = "col_037_x"}\n'


def test_a_device_is_on_a_port_or_on_a_bus() -> None:
    assert parse_settings(GOOD).device[0].place == "/dev/ttyUSB0"
    on_can = parse_settings(GOOD.replace("port =", "# port =") + CAN).device[0].place
    assert on_can == CanAddress(interface="slcan", channel="/dev/ttyACM0", node=3, bitrate=1_000_000)


def test_a_dbc_file_is_looked_for_beside_the_settings(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(WITH_DBC)
    place = load_settings(tmp_path / "site.toml").device[0].place
    sensor = DbcSensor(file=tmp_path / "imu.dbc", signals=("accX", "accY", "accZ"), counter="Counter")
    assert place == DbcAddress(interface="slcan", channel="/dev/ttyACM0", sensor=sensor)


def test_channels_keep_device_and_axis() -> None:
    channels = parse_settings(GOOD).channels
    assert [(c.name, c.device, c.axis) for c in channels] == [
        ("beam_left_y", "beam_left", 1),
        ("beam_left_z", "beam_left", 2),
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (GOOD.replace("driver =", "drivr ="), "did you mean 'driver'"),
        (GOOD.replace("structure =", "struct ="), "struct"),
        (GOOD + "rate = -5\n", "device.0.rate"),
        (GOOD + "[analysis]\noverlap = 1.5\n", "analysis.overlap"),
        (GOOD + "[analysis]\nbaseline_windows = 2\n", "analysis.baseline_windows"),
        (GOOD.replace("{y =", "{q ="), "device.0.channels"),
        (GOOD.replace('"beam_left_z"', '"beam_left_y"'), "beam_left_y"),
        ("structure = 't.toml'\ndevice = []\n", "device"),
        ("structure = \n", "line 1"),
        (
            GOOD.replace("port =", "# port ="),
            "device.0: Value error, expected one of `port`, `can` and `log`, found none",
        ),
        (GOOD + CAN, "device.0: Value error, expected one of `port`, `can` and `log`, found port and can"),
        (GOOD.replace("port =", "# port =") + CAN.replace("node = 3", "node = 200"), "device.0.can.node"),
        (GOOD.replace("port =", "# port =") + CAN.replace("node", "nod"), "did you mean 'node'"),
        (WITH_DBC.replace(', channel = "/dev/ttyACM0"', ', channel = "/dev/ttyACM0", node = 1'), "`dbc`, found both"),
        (WITH_DBC.replace("dbc = {", "# "), "device.0: Value error, expected one of `can.node` and `dbc`, found none"),
        (GOOD + DBC.splitlines()[2], "device.0: Value error, expected `can` beside `dbc`, found `port`"),
        (WITH_DBC.replace(', z = "accZ"', ""), "channels: axis z is none of `dbc.signals`, x, y"),
        (WITH_DBC.replace('x = "accX", ', ""), "signals: expected those of x, of x and y, or of x, y and z"),
        (WITH_DBC.replace("counter", "countr"), "device.0.dbc.countr: no such setting, did you mean 'counter'?"),
        (GOOD + OTHER, "device: two are connected to /dev/ttyUSB0"),
    ],
)
def test_errors_name_file_and_key(text: str, says: str) -> None:
    with pytest.raises(SettingsError) as caught:
        parse_settings(text, "site.toml")
    assert str(caught.value).startswith("site.toml: ")
    assert says in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.toml: cannot be read"):
        load_settings(tmp_path / "none.toml")


def test_windows_begin_as_far_apart_as_overlap_leaves() -> None:
    settings = parse_settings(GOOD + "\n[analysis]\noverlap = 0.75\n")
    assert settings.step_seconds == 150.0

"""Bad settings get one clear error that names file and key."""

from pathlib import Path

import pytest

from daq import CanAddress, DbcAddress, DbcSensor
from daq.drivers import LineFormat, TextAddress
from monitor.errors import SettingsError
from monitor.service.site import load_site
from monitor.settings import load_settings, parse_settings
from updater import t_structure_toml

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
DAQMX = """driver = "nidaqmx"
daqmx = {inputs = {x = "cDAQ1Mod1/ai0", y = "cDAQ1Mod1/ai1"}, sensitivity = {x = 100, y = 99}, range_g = 50}
"""
WITH_DAQMX = GOOD.replace('driver = "epson-uart"\nport = "/dev/ttyUSB0"\n', DAQMX)
SENSORS = """[[sensor]]
channel = "beam_left_y"
at = [0, 0, 0.4]
direction = [0, 1, 0]
[[sensor]]
channel = "beam_left_z"
at = [0, 0, 0.9]
direction = [0, 0, 1]
"""
TEXT = 'text = {columns = ["counter", "y", "z"], unit = "g"}\n'
OTHER = '[[device]]\nname = "b"\ndriver = "epson-uart"\nport = "/dev/ttyUSB0"\nchannels = {x = "col_037_x"}\n'


def test_device_address_is_a_port_or_a_can_bus() -> None:
    assert parse_settings(GOOD).device[0].place == "/dev/ttyUSB0"
    on_can = parse_settings(GOOD.replace("port =", "# port =") + CAN).device[0].place
    assert on_can == CanAddress(interface="slcan", channel="/dev/ttyACM0", node=3, bitrate=1_000_000)


def test_port_with_lines_of_text_has_their_format() -> None:
    place = parse_settings(GOOD + TEXT.replace('"g"', '"mg", counter_bits = 16, baud = 9600')).device[0].place
    form = LineFormat(columns=("counter", "y", "z"), unit="mg", counter_bits=16)
    assert place == TextAddress(port="/dev/ttyUSB0", form=form, baud=9600)
    assert parse_settings(GOOD + TEXT.replace('unit = "g"', "scale = 0.01")).device[0].place == TextAddress(
        port="/dev/ttyUSB0", form=LineFormat(columns=("counter", "y", "z"), scale=0.01)
    )


def test_dbc_path_is_relative_to_the_settings_file(tmp_path: Path) -> None:
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
            "device.0: expected one of `port`, `can`, `daqmx` and `log`, found none",
        ),
        (GOOD + CAN, "device.0: expected one of `port`, `can`, `daqmx` and `log`, found port and can"),
        (GOOD.replace("port =", "# port =") + CAN.replace("node = 3", "node = 200"), "device.0.can.node"),
        (GOOD.replace("port =", "# port =") + CAN.replace("node", "nod"), "did you mean 'node'"),
        (WITH_DBC.replace(', channel = "/dev/ttyACM0"', ', channel = "/dev/ttyACM0", node = 1'), "`dbc`, found both"),
        (WITH_DBC.replace("dbc = {", "# "), "device.0: expected one of `can.node` and `dbc`, found none"),
        (GOOD + DBC.splitlines()[2], "device.0: expected `can` with `dbc`, found `port`"),
        (WITH_DBC.replace(', z = "accZ"', ""), "channels: axis z is none of `dbc.signals`, x, y"),
        (WITH_DBC.replace('x = "accX", ', ""), "signals: expected those of x, of x and y, or of x, y and z"),
        (WITH_DBC.replace("counter", "countr"), "device.0.dbc.countr: no such setting, did you mean 'counter'?"),
        (GOOD + TEXT.replace('"z"', '"x"'), "channels: axis z is none of `text.columns`, counter, y, x"),
        (
            GOOD + TEXT.replace('"z"', '"w"'),
            "device.0.text: columns: expected counter, time_s, time_ms, time_us, x, y, z",
        ),
        (GOOD + TEXT.replace(', unit = "g"', ""), "device.0.text: expected one of `unit` and `scale`"),
        (GOOD + TEXT.replace('"g"', '"kg"'), "device.0.text: unit: expected m/s2, g, mg, cm/s2, mm/s2, found 'kg'"),
        (GOOD.replace("port =", "# port =") + CAN + TEXT, "device.0: expected `port` with `text`, found `can`"),
        (
            GOOD + SENSORS.replace("left_z", "right_z"),
            "sensor.1.channel: expected a channel of a device, found 'beam_right",
        ),
        (GOOD + SENSORS.replace("left_z", "left_y"), "sensor.1.channel: 'beam_left_y' has a position already"),
        (GOOD + SENSORS.replace("0.9", "0.4"), "sensor: expected two positions or more, found [0.0, 0.0, 0.4] only"),
        (GOOD + SENSORS.replace("[0, 0, 1]", "[0, 0, 0]"), "sensor.1.direction: expected a direction, found [0, 0, 0]"),
        ("lines = [['beam_left_y', 'z']]\n" + GOOD + SENSORS, "lines: expected channels of [[sensor]], found 'z'"),
        (GOOD + "[analysis]\nband = [400.0, 5.0]\n", "analysis.band: expected 0 < low < high <= 500 Hz"),
        (GOOD + "[analysis]\nband = [5.0, 900.0]\n", "half the slowest rate, found [5.0, 900.0]"),
        (GOOD + "[analysis]\nband = [480.0, 490.0]\n", "low < 480 Hz, 0.48 of the slowest rate, found 480"),
        (GOOD + "[analysis]\noverlap = 0.9999\n", "analysis.overlap: expected less than or equal to 0.95"),
        (
            GOOD + "[analysis]\nwindow_seconds = inf\n",
            "analysis.window_seconds: expected a number from 1e-20 to 1e+09, found inf",
        ),
        (GOOD + "[alarm]\nfalse_alarms_per_year = 1e9\n", "alarm.false_alarms_per_year: expected less than"),
        (GOOD + "[web]\nport = 9877\n[viewer]\n", "web.port: the viewer serves on 9876 and 9877, found 9877"),
        (GOOD + '[web]\nbind = "localhost"\n', "web.bind: expected an address such as 127.0.0.1"),
        (GOOD + '[history]\nurl = "postgres://me@h/n"\n', "history.url: expected postgresql://USER@HOST/NAME"),
        (GOOD.replace('"beam_left"', '"../left"'), "device.0.name: "),
        (GOOD + '[[notify]]\nwebhook = "http://a/b"\nheaders = {A = "\u00e4"}\n', "headers: A: expected ASCII"),
        (GOOD.replace("{y =", "{q ="), "device.0.channels.q: expected 'x', 'y' or 'z', found 'q'"),
        ("", "site.toml: device: is missing"),
        (GOOD + OTHER, "device: two are connected to /dev/ttyUSB0"),
    ],
)
def test_errors_name_file_and_key(text: str, says: str) -> None:
    with pytest.raises(SettingsError) as caught:
        parse_settings(text, "site.toml")
    assert str(caught.value).startswith("site.toml: ")
    assert says in str(caught.value)


def test_errors_suggest_the_nearest_name_and_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    path.write_text(GOOD, encoding="utf-8-sig")
    assert load_site(path).settings.device[0].name == "beam_left"
    for wrong, meant in (("epson-urt", "epson-uart"), ("beam_lft_y", "beam_left_y")):
        path.write_text(GOOD.replace(meant, wrong), encoding="utf-8")
        with pytest.raises(SettingsError, match=f"did you mean '{meant}'"):
            load_site(path)


def test_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.toml: cannot be read"):
        load_settings(tmp_path / "none.toml")


def test_window_step_follows_from_overlap() -> None:
    settings = parse_settings(GOOD + "\n[analysis]\noverlap = 0.75\n")
    assert settings.step_seconds == 150.0

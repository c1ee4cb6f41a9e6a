"""Settings from the environment and the command line, and the text that is logged."""

import json
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import SecretStr

from monitor.errors import ArgumentError, SettingsError
from monitor.service.site import load_site
from monitor.settings import overrides, parse_settings, read_settings
from monitor.settings.overrides import overridden
from tests.support.monitor.cli import Commands, assert_refused
from updater import t_structure_toml

SITE = """# the bridge
structure = "t_structure.toml"

[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/ttyUSB0"
channels = {y = "beam_left_y"}

[[device]]
name = "col_074"
driver = "epson-uart"
port = "/dev/ttyUSB1"
channels = {x = "col_074_x"}

[analysis]
window_seconds = 300 # of quiet nights
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "t_structure.toml").write_text(t_structure_toml(), encoding="utf-8")
    path = tmp_path / "site.toml"
    path.write_text(SITE, encoding="utf-8")
    return path


def test_command_line_overrides_environment_and_environment_overrides_file(site: Path) -> None:
    environment = {
        "MODALWATCH_ANALYSIS__WINDOW_SECONDS": "120",
        "MODALWATCH_ANALYSIS__OVERLAP": "0.5",
        "MODALWATCH_DEVICE__BEAM_LEFT__PORT": "/dev/ttyACM7",
        "MODALWATCH__STATE": "kept here",
        "MODALWATCH_STATE": "alarm",  # what notices tell a command, and no setting
        "MODALWATCH_KIND": "recovery",
        "HOME": "/root",
    }
    arguments = ("analysis.overlap=0.25", "device.1.rate=500", "alarm.latched=true", 'notify=[{command = ["true"]}]')
    text, found = read_settings(site, overrides(arguments, environment))
    assert (found.analysis.window_seconds, found.analysis.overlap, found.state) == (120.0, 0.25, "kept here")
    assert [(device.port, device.rate) for device in found.device] == [
        ("/dev/ttyACM7", 1000.0),
        ("/dev/ttyUSB1", 500.0),
    ]
    assert found.alarm.latched
    assert found.notify[0].command == (SecretStr("true"),)
    assert parse_settings(text) == found  # what is logged needs neither environment nor arguments
    assert text.startswith("# the bridge\n")
    assert "# of quiet nights" in text


def test_settings_text_is_unchanged_without_overrides(site: Path) -> None:
    assert read_settings(site, overrides((), {}))[0] == SITE


def test_environment_overrides_settings_of_a_site(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MODALWATCH_RECORDER__ROTATE_MINUTES", "5")
    loaded = load_site(site, ["recorder.rotate_mb=10"])
    assert (loaded.settings.recorder.rotate_minutes, loaded.settings.recorder.rotate_mb) == (5.0, 10.0)
    assert tomllib.loads(loaded.site_text)["recorder"] == {"rotate_minutes": 5, "rotate_mb": 10}


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("ANALYSIS__OVERLAP", "1.5", "analysis.overlap: expected less than or equal to 0.95, found 1.5"),
        ("ANALYSIS__OVERLP", "0.5", "analysis.overlp: no such setting, did you mean 'overlap'?"),
        ("WINDOW_SECONDS__", "5", "window_seconds: no such setting, did you mean 'analysis.window_seconds'?"),
        ("DEVICE__BEAM_LFT__RATE", "500", "device: expected one of beam_left, col_074, found 'beam_lft'"),
        ("DEVICE__BEAM_LEFT", "500", "device: expected a setting of one of them after its name"),
        ("STRUCTURE__FILE", "a.toml", "structure is a value, not a section"),
    ],
)
def test_errors_name_the_variable(site: Path, name: str, value: str, says: str) -> None:
    with pytest.raises(SettingsError) as caught:
        read_settings(site, overrides((), {f"MODALWATCH_{name}": value}))
    assert str(caught.value).startswith(f"MODALWATCH_{name}: ")
    assert says in str(caught.value)


def test_error_in_the_file_names_the_file_despite_overrides(site: Path) -> None:
    site.write_text(SITE + "overlap = 2\n")
    with pytest.raises(SettingsError) as caught:
        read_settings(site, overrides(["analysis.baseline_windows=30"], {}))
    assert str(caught.value).startswith(f"{site}: analysis.overlap: ")


@pytest.mark.parametrize("argument", ["analysis", "=3", "analysis..overlap=1", "an alysis=1"])
def test_invalid_set_argument_is_refused(argument: str) -> None:
    with pytest.raises(ArgumentError, match="--set: expected KEY=VALUE"):
        overrides([argument], {})


@settings(max_examples=50)
@given(name=st.text(), value=st.text())
def test_any_variable_is_a_setting_or_refused(name: str, value: str) -> None:
    """Whatever the environment holds: settings, or an error of ours."""
    text = parse_text({f"MODALWATCH_{name}__X": value})
    assert text is None or parse_settings(text)


def parse_text(environment: dict[str, str]) -> str | None:
    try:
        text, _ = overridden(SITE, overrides((), environment))
        parse_settings(text)
    except SettingsError:
        return None
    return text


def test_commands_accept_and_show_overridden_settings(modalwatch: Commands, site: Path) -> None:
    done = modalwatch("settings", site, "--set", "analysis.overlap=0.5")
    assert done.code == 0
    shown = parse_settings(done.out)
    assert shown.analysis.overlap == 0.5
    assert shown == parse_settings(SITE.replace("[analysis]", "[analysis]\noverlap = 0.5"))
    assert_refused(modalwatch("check", site, "--set", "analysis.overlap=7"), "--set analysis.overlap: analysis.overlap")
    assert_refused(modalwatch("run", site, "--set", "overlap"), "--set: expected KEY=VALUE")


def test_schema_describes_every_setting(modalwatch: Commands) -> None:
    schema = json.loads(modalwatch("settings", "--schema").out)
    sections = [schema, *schema["$defs"].values()]
    assert all(section["additionalProperties"] is False for section in sections)
    assert set(schema["required"]) == {"device"}
    reported = [field for section in sections for field in section["properties"].values() if "$ref" not in str(field)]
    assert all(field["description"] for field in reported)

"""The printed defaults: their meaning, and that the program reads the same."""

import json
import re
import tomllib
from typing import Any

import pytest
from pydantic import BaseModel

from monitor.settings import EXAMPLE, TemperatureSettings, annotated, parse_settings
from monitor.settings.reading import section_of
from monitor.settings.schema import Settings
from monitor.settings.template import json_schema
from tests.support.monitor.cli import Commands


def test_printed_defaults_equal_the_program_defaults(modalwatch: Commands) -> None:
    text = modalwatch("settings").out
    assert parse_settings(text) == EXAMPLE
    given = tomllib.loads(text)
    for name, field in Settings.model_fields.items():
        section = section_of(field.annotation)
        if section is not None and name not in {"device", "sensor", "notify"} and field.default is not None:
            assert section.model_validate(given[name]) == field.default
    assert set(given["device"][0]) == {"name", "driver", "port", "rate", "channels"}


def test_settings_are_printed_without_descriptions_if_the_source_is_not_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing(section: object) -> str:
        raise OSError("could not get source code")

    monkeypatch.setattr("inspect.getsource", missing)
    assert parse_settings(annotated()) == EXAMPLE
    assert "description" not in json.loads(json_schema())["$defs"]["AlarmSettings"]["properties"]["clear_below"]


def uncommented() -> dict[str, Any]:
    return tomllib.loads(re.sub(r"^#(?=[\w\[])(?!:)", "", annotated(), flags=re.MULTILINE))


def every_key(section: type[BaseModel], table: dict[str, Any], place: str) -> None:
    """Assert that a table has all keys of its section, and those inside it theirs."""
    assert set(table) == set(section.model_fields), place
    for name, field in section.model_fields.items():
        below = section_of(field.annotation)
        if below is not None:
            inner = table[name]
            every_key(below, inner[0] if isinstance(inner, list) else inner, f"{place}.{name}")


def test_every_setting_is_printed() -> None:
    every_key(Settings, uncommented(), "SITE.toml")


@pytest.mark.parametrize("section", ["recorder", "analysis", "history", "home_assistant", "web", "viewer", "clock"])
def test_commented_examples_of_sections_are_valid(section: str) -> None:
    model = section_of(Settings.model_fields[section].annotation)
    assert model is not None
    assert model.model_validate(uncommented()[section])


@pytest.mark.parametrize("way", ["webhook", "command", "mqtt"])
def test_example_of_each_notice_target_is_valid(way: str) -> None:
    [target] = uncommented()["notify"]
    rest = {key: value for key, value in target.items() if key not in {"webhook", "command", "mqtt"}}
    model = section_of(Settings.model_fields["notify"].annotation)
    assert model is not None
    assert model.model_validate({**rest, way: target[way]})


@pytest.mark.parametrize("source", ["csv", "mqtt"])
def test_example_of_each_temperature_source_is_valid(source: str) -> None:
    table = uncommented()["temperature"]
    rest = {key: value for key, value in table.items() if key not in {"csv", "mqtt"}}
    assert TemperatureSettings.model_validate({**rest, source: table[source]})


@pytest.mark.parametrize("place", ["can", "log", "dbc", "text", "daqmx"])
def test_example_of_each_device_address_is_valid(place: str) -> None:
    [device] = uncommented()["device"]
    keep = {"dbc": ("can", "dbc"), "text": ("port", "text")}.get(place, (place,))
    rest = {key: value for key, value in device.items() if key not in {"port", "can", "dbc", "text", "daqmx", "log"}}
    if place == "log":
        del rest["delay_ms"]
    if place == "daqmx":  # the example has one input
        rest["channels"] = {"x": "beam_left_x"}
        rest.pop("sensor", None)
    places = {key: device[key] for key in keep}
    if place == "dbc":
        places["can"] = {key: value for key, value in device["can"].items() if key not in {"node", "sync"}}
    if place == "text":  # unit or scale
        places["text"] = {key: value for key, value in device["text"].items() if key != "scale"}
    settings = EXAMPLE.model_dump() | {"device": [{**rest, **places}]}
    again = Settings.model_validate(settings)
    assert parse_settings(annotated(again)) == again

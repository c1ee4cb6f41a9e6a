"""Home Assistant discovers the entities of a site through a real broker; a killed monitor becomes unavailable."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from jinja2 import Environment, StrictUndefined
from pydantic import ValidationError

from daq import read_attachments
from daq.events import EventPayload
from monitor.outputs.home_assistant import HomeAssistant
from monitor.outputs.home_assistant.discovery import Topics, mode_configs, site_configs, states
from monitor.results.service_events import HomeAssistantFailed, HomeAssistantRecovered
from monitor.results.site_status import SiteStatus
from monitor.settings import HomeAssistantSettings
from tests.support.broker import PASSWORD, USER, Subscriber, broker, needs_broker
from tests.support.monitor.service.status import site_status
from tests.support.processes import free_port

ROOT = Path(__file__).parents[3]
RECORDED = ROOT / "replay_data" / "t_frame_added_mass.mcap"
TOPICS = Topics(base="site/north bridge", discovery="homeassistant")
SENSOR = "homeassistant/sensor/site_north_bridge"
BINARY = "homeassistant/binary_sensor/site_north_bridge"


@pytest.fixture(scope="module")
def status(tmp_path_factory: pytest.TempPathFactory) -> SiteStatus:
    """Return the status of a run in alarm with six modes."""
    return site_status(tmp_path_factory.mktemp("state"))


def window_of(status: SiteStatus, **fields: Any) -> SiteStatus:
    """Return a status with another last window."""
    assert status.window is not None
    return status.model_copy(update={"window": status.window.model_copy(update=fields)})


def shown(configs: dict[str, dict[str, Any]], status: SiteStatus) -> dict[str, str]:
    """Return the states of entities as Home Assistant renders them: its templates are jinja2."""
    environment = Environment(undefined=StrictUndefined)
    values = json.loads(json.dumps(states(status)))
    return {
        topic: environment.from_string(config["value_template"]).render(value_json=values)
        for topic, config in configs.items()
        if "value_template" in config
    }


def test_entities_render_the_states(status: SiteStatus) -> None:
    assert status.window is not None
    configs = site_configs(TOPICS, "bridge") | mode_configs(TOPICS, "bridge", status.window.tracked)
    found = shown(configs, status)
    assert status.window.novelty is not None
    assert found.pop(f"{SENSOR}/novelty/config") == str(round(status.window.novelty.level, 4))
    assert found == {
        f"{BINARY}/alarm/config": "ON",
        f"{SENSOR}/state/config": "alarm",
        f"{SENSOR}/temperature/config": "-3.5",
    } | {f"{SENSOR}/mode_{mode}/config": str(status.window.modes[mode].frequency) for mode in range(1, 7)}


def test_unknown_values_render_as_none(status: SiteStatus) -> None:
    """Home Assistant shows "None" of a sensor as unknown."""
    unseen = window_of(status, novelty=None, modes={}, n_modes=0).model_copy(
        update={"state": "normal", "temperature": None, "devices": {}}
    )
    configs = site_configs(TOPICS, "bridge") | mode_configs(TOPICS, "bridge", [2])
    assert shown(configs, unseen) == {
        f"{BINARY}/alarm/config": "OFF",
        f"{SENSOR}/state/config": "normal",
        f"{SENSOR}/novelty/config": "None",
        f"{SENSOR}/temperature/config": "None",
        f"{SENSOR}/mode_2/config": "None",
    }


def test_temperature_without_a_thermometer_is_the_mean_of_the_devices(status: SiteStatus) -> None:
    devices = {
        name: device.model_copy(update={"temperature": celsius})
        for (name, device), celsius in zip(status.devices.items(), (4.0, 5.0), strict=True)
    }
    own = status.model_copy(update={"temperature": None, "devices": devices})
    assert states(own)["temperature"] == 4.5


def test_discovery_has_what_home_assistant_requires() -> None:
    """Identities are unique; all entities belong to one device; all but the connectivity become unavailable."""
    configs = site_configs(TOPICS, "bridge") | mode_configs(TOPICS, "bridge", [1, 2])
    assert len({config["unique_id"] for config in configs.values()}) == len(configs) == 7
    for topic, config in configs.items():
        assert config["device"]["identifiers"] == ["site_north_bridge"]
        assert config["device"]["name"] == "bridge"
        if topic == f"{BINARY}/connectivity/config":
            assert config["state_topic"] == "site/north bridge/availability"
            assert (config["payload_on"], config["payload_off"]) == ("online", "offline")
        else:
            assert config["state_topic"] == "site/north bridge/state"
            assert config["availability_topic"] == "site/north bridge/availability"
    kinds = {topic.split("/")[3]: config.get("device_class") for topic, config in configs.items()}
    assert kinds == {
        "alarm": "problem",
        "state": "enum",
        "novelty": None,
        "temperature": "temperature",
        "connectivity": "connectivity",
        "mode_1": "frequency",
        "mode_2": "frequency",
    }


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"mqtt": "http://h/x"},
        {"mqtt": "mqtt://h/site/+"},
        {"mqtt": "mqtt://h/site/#"},
        {"mqtt": "mqtt://h", "discovery": "home/#"},
        {"mqtt": "mqtt://h", "discovery": ""},
    ],
)
def test_wrong_settings_are_refused(fields: dict[str, str]) -> None:
    with pytest.raises(ValidationError):
        HomeAssistantSettings(**fields)


@pytest.mark.live
@needs_broker
def test_discovery_and_states_are_retained(status: SiteStatus, tmp_path: Path) -> None:
    port = free_port()
    settings = HomeAssistantSettings(mqtt=f"mqtt://127.0.0.1:{port}/site/a", discovery="ha")
    with broker(tmp_path, port):
        with Subscriber().connected(port) as early, HomeAssistant(settings, "bridge") as home:
            early.until(lambda: early.of("site/a/availability"))
            assert early.of("site/a/state") == []  # there is no status yet
            home.show(status.model_copy(update={"state": "learning", "window": None}))  # of a start
            time.sleep(0.5)
            assert early.of("site/a/state") == []
            home.show(status)
            early.until(lambda: early.of("site/a/state"))
            for _ in range(3):
                home.show(status.model_copy(update={"time": time.time()}))  # the same window
                time.sleep(0.5)
            assert len(early.of("site/a/state")) == 1
            assert status.window is not None
            home.show(window_of(status, index=status.window.index + 1))
            early.until(lambda: len(early.of("site/a/state")) == 2)
            with Subscriber().connected(port) as late:
                late.until(lambda: len(late.retained) == 5 + 6 + 2)
            assert json.loads(late.retained["ha/binary_sensor/site_a/alarm/config"])["device_class"] == "problem"
            assert json.loads(late.retained["site/a/state"]) == states(status)
            assert late.retained["site/a/availability"] == "online"
            assert home.problem is None
            # a new baseline: identities of modes end with the old one
            home.show(window_of(status, phase="learning").model_copy(update={"state": "learning"}))
            early.until(lambda: early.of("ha/sensor/site_a/mode_6/config")[-1:] == [""])
            early.until(lambda: json.loads(early.of("site/a/state")[-1])["modes"] == {})
        with Subscriber().connected(port) as after:
            after.until(lambda: len(after.retained) == 5 + 2)
        assert after.retained["site/a/availability"] == "offline"  # as it ends


@pytest.mark.live
@needs_broker
def test_lost_broker_is_reported_and_states_are_published_again(status: SiteStatus, tmp_path: Path) -> None:
    port = free_port()
    settings = HomeAssistantSettings(mqtt=f"mqtt://127.0.0.1:{port}")
    events: list[EventPayload] = []

    def until_reported(n: int) -> None:
        end = time.monotonic() + 20.0
        while len(events) < n:
            assert time.monotonic() < end, events
            events.extend(home.events())
            time.sleep(0.02)

    with HomeAssistant(settings, "b+1", retry_seconds=0.1) as home:
        home.show(status)
        until_reported(1)
        for n in (2, 4):
            with broker(tmp_path, port), Subscriber().connected(port) as found:
                found.until(lambda: found.of("modalwatch/b_1/state"))
                assert json.loads(found.of("modalwatch/b_1/state")[0])["state"] == "alarm"
                until_reported(n)
                assert home.problem is None
            until_reported(n + 1)
    assert [type(event) for event in events] == [HomeAssistantFailed, HomeAssistantRecovered] * 2 + [
        HomeAssistantFailed
    ]


@pytest.mark.live
@needs_broker
@pytest.mark.parametrize("password", [PASSWORD, "Hush7Wrong"])
def test_login_is_used_and_never_shown(tmp_path: Path, password: str) -> None:
    port = free_port()
    settings = HomeAssistantSettings(mqtt=f"mqtt://{USER}:{password}@127.0.0.1:{port}/Hush7Topic")
    with broker(tmp_path, port, login=True), HomeAssistant(settings, "bridge") as home:
        events: list[EventPayload] = []
        end = time.monotonic() + 3.0
        while time.monotonic() < end and not events:
            events += list(home.events())
            time.sleep(0.05)
    if password == PASSWORD:
        assert (events, home.problem) == ([], None)
    else:
        assert "refuses: Not authorized" in (home.problem or "")
        assert "Hush7" not in (home.problem or "")


@pytest.mark.live
@needs_broker
def test_killed_monitor_becomes_unavailable(tmp_path: Path) -> None:
    """A monitor of a recorded log is killed (-9): the broker publishes its last will."""
    port = free_port()
    (tmp_path / "t_structure.toml").write_text(read_attachments(RECORDED)["structure.toml"], encoding="utf-8")
    (tmp_path / "site.toml").write_text(
        f"""structure = "t_structure.toml"
[recorder]
min_free_gb = 0
[analysis]
window_seconds = 5
[clock]
speed = 4
[home_assistant]
mqtt = "mqtt://127.0.0.1:{port}/site/a"
[[device]]
name = "beam_left"
driver = "replay"
rate = 500
log = {{file = "{RECORDED}", device = "beam_left"}}
channels = {{y = "beam_left_y"}}
""",
        encoding="utf-8",
    )
    command = [sys.executable, "-c", "from monitor.cli.main import main; main()", "run", str(tmp_path / "site.toml")]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    quiet = subprocess.DEVNULL
    with broker(tmp_path, port), Subscriber().connected(port) as found:
        with subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet) as process:
            try:
                found.until(lambda: found.of("site/a/state"), 60.0)
                assert process.poll() is None
                assert json.loads(found.of("site/a/state")[-1])["window_end"]
                assert found.of("site/a/availability") == ["online"]
            finally:
                process.send_signal(signal.SIGKILL)
        found.until(lambda: found.of("site/a/availability") == ["online", "offline"])

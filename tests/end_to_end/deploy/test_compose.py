"""compose.yaml names files, settings and variables that exist; images have versions."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from monitor.rig.process import load_rig_structure
from monitor.rig.scenario import load_scenario
from monitor.settings import Settings, overrides
from monitor.settings.overrides import overridden
from monitor.settings.reading import parse_settings
from updater import parse_structure, t_structure_toml

DEPLOY = Path(__file__).parents[3] / "deploy"
TEXT = (DEPLOY / "compose.yaml").read_text(encoding="utf-8")
COMPOSE = yaml.safe_load(TEXT)
SERVICES: dict[str, Any] = COMPOSE["services"]
EXAMPLE = dict(
    line.split("=", 1)
    for line in (DEPLOY / ".env.example").read_text(encoding="utf-8").splitlines()
    if "=" in line and not line.startswith("#")
)
MADE_BY_THE_OPERATOR = {f".{line.rstrip('/')}" for line in (DEPLOY / ".gitignore").read_text(encoding="utf-8").split()}
MONITORS = ("rig", "site")


def filled(text: str) -> str:
    """Return a text of compose.yaml with the variables of the example."""
    return re.sub(r"\$\{(\w+)(?::[-?][^}]*)?\}", lambda found: EXAMPLE[found[1]], text)


def rig_settings() -> Settings:
    return parse_settings((DEPLOY / "rig" / "site.toml").read_text(encoding="utf-8"))


def test_variables_of_compose_are_those_of_the_example() -> None:
    assert set(re.findall(r"\$\{(\w+)", TEXT)) | {"COMPOSE_PROFILES"} == set(EXAMPLE)
    profiles = {profile for service in SERVICES.values() for profile in service.get("profiles", ())}
    assert EXAMPLE["COMPOSE_PROFILES"] in profiles == set(MONITORS)


def test_mounted_files_and_volumes_exist() -> None:
    mounts = [filled(mount).split(":") for service in SERVICES.values() for mount in service.get("volumes", ())]
    assert len(mounts) == 10
    for source, target, *mode in mounts:
        assert target.startswith("/")
        assert mode in ([], ["ro"])
        if source.startswith("."):
            assert source in MADE_BY_THE_OPERATOR or (DEPLOY / source).exists(), source
        else:
            assert source in COMPOSE["volumes"], source
    for secret in COMPOSE["secrets"].values():
        assert secret["file"] in MADE_BY_THE_OPERATOR


def test_named_parts_of_compose_are_defined() -> None:
    for service in SERVICES.values():
        assert set(service.get("depends_on", ())) <= set(SERVICES)
        for secret in service.get("secrets", ()):
            assert (secret["source"] if isinstance(secret, dict) else secret) in COMPOSE["secrets"]
        image = service["image"]
        assert re.fullmatch(r"[\w/]+:v?\d+(\.\d+)+", image), image


@pytest.mark.parametrize("name", MONITORS)
def test_environment_of_a_monitor_holds_settings(name: str) -> None:
    environment = {key: filled(str(value)) for key, value in SERVICES[name]["environment"].items()}
    given = overrides((), environment)
    assert [override.source for override in given] == sorted(environment)
    text, origins = overridden((DEPLOY / "rig" / "site.toml").read_text(encoding="utf-8"), given)
    settings = parse_settings(text, "site.toml", origins)
    assert settings.web is not None
    published, inside = map(int, SERVICES[name]["ports"][0].split(":")[1:])
    assert (published, inside, settings.web.bind) == (settings.web.port, settings.web.port, "0.0.0.0")
    assert settings.web.token_file == "/run/secrets/web_token"
    assert "web_token" in SERVICES[name]["secrets"]
    user, password = EXAMPLE["POSTGRES_PASSWORD"], SERVICES["postgres"]["environment"]
    assert settings.history.url is not None
    assert settings.history.url.get_secret_value() == (
        f"postgresql://{password['POSTGRES_USER']}:{user}@postgres/{password['POSTGRES_DB']}"
    )


@pytest.mark.parametrize("name", MONITORS)
def test_monitor_is_built_from_the_shipped_dockerfile(name: str) -> None:
    build = SERVICES[name]["build"]
    assert (DEPLOY / build["context"] / build["dockerfile"]).resolve() == DEPLOY.parent / "Dockerfile"


def test_prometheus_and_grafana_find_each_other() -> None:
    scraped = yaml.safe_load((DEPLOY / "prometheus.yml").read_text(encoding="utf-8"))["scrape_configs"][0]
    host, port = scraped["static_configs"][0]["targets"][0].split(":")
    for name in MONITORS:
        assert host in SERVICES[name]["networks"]["default"]["aliases"]
        assert SERVICES[name]["environment"]["MODALWATCH_WEB__PORT"] == port
    token = SERVICES["prometheus"]["secrets"][0]["target"]
    assert token == f"/etc/prometheus/{scraped['authorization']['credentials_file']}"
    provisioning = DEPLOY / "grafana" / "provisioning"
    [source] = yaml.safe_load((provisioning / "datasources" / "prometheus.yaml").read_text("utf-8"))["datasources"]
    assert source["url"] == "http://prometheus:9090"
    [provider] = yaml.safe_load((provisioning / "dashboards" / "modalwatch.yaml").read_text("utf-8"))["providers"]
    assert f"./grafana/dashboards:{provider['options']['path']}:ro" in SERVICES["grafana"]["volumes"]


def test_settings_of_the_rig_fit_its_scenario() -> None:
    path, settings = DEPLOY / "rig" / "scenario.toml", rig_settings()
    scenario = load_scenario(path)
    load_rig_structure(path, scenario)
    assert [device.name for device in settings.device] == [device.name for device in scenario.device]
    assert {device.rate for device in settings.device} == {scenario.rate}
    assert {channel.name for channel in settings.channels} <= set(parse_structure(t_structure_toml()).channels)
    assert scenario.event[0].at > settings.learning_seconds + settings.analysis.window_seconds

"""Settings of the page of many sites, from a file or an address, and its server."""

import tempfile
from pathlib import Path

from pydantic import SecretStr

from monitor.cli.terminal import echo
from monitor.errors import ArgumentError
from monitor.service.servers.fleet import serve_fleet
from monitor.settings.fleet import FleetSettings, load_fleet_settings
from monitor.settings.notify import is_broker


def serve(target: str, port: int | None) -> None:
    """Serve the page until a signal ends it."""
    if port is not None and not 1 <= port <= 65535:
        raise ArgumentError("--port", f"expected 1 to 65535, found {port}")
    if "://" in target:
        with tempfile.TemporaryDirectory() as folder:  # of a token that nobody needs: the page is for this machine only
            serve_fleet(_with_port(_settings(target), port), Path(folder), _ready)
        return
    path = Path(target)
    if path.suffix != ".toml":
        known = "postgresql://USER@HOST/NAME, mqtt://HOST/TOPIC or FLEET.toml"
        raise ArgumentError("TARGET", f"expected {known}, found {target!r}")
    serve_fleet(_with_port(load_fleet_settings(path), port), path.parent, _ready)


def _settings(address: str) -> FleetSettings:
    """Return the settings of an address alone."""
    if not address.startswith(("mqtt://", "mqtts://")):
        return FleetSettings(url=SecretStr(address))
    if not is_broker(address):
        raise ArgumentError("TARGET", "expected mqtt://HOST/TOPIC, without wildcards")
    return FleetSettings(mqtt=SecretStr(address))


def _with_port(settings: FleetSettings, port: int | None) -> FleetSettings:
    return settings if port is None else settings.model_copy(update={"port": port})


def _ready(url: str) -> None:
    echo(f"fleet: {url}")

"""Command `fleet`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DONE

_FILES = (".sqlite", ".sqlite3", ".db")  # of SQLite, as the history of a site


def fleet(
    target: Annotated[str, Argument(metavar="ADDRESS|FLEET.toml", help="Database or broker, or settings.")],
    port: Annotated[
        int | None, Option("--web-port", metavar="PORT", help="Port of the page. Default: that of FLEET.toml, or 8770.")
    ] = None,
) -> int:
    """Serve a page of all sites of a database or a broker.

    Sites that need a person come first: changed structures, then monitors without data or with problems.

    Example:
    modalwatch fleet postgresql://modalwatch@localhost/modalwatch
    modalwatch fleet mqtt://broker.example.org/modalwatch
    """
    from tempfile import TemporaryDirectory

    from pydantic import SecretStr

    from monitor.cli.terminal import echo
    from monitor.errors import ArgumentError
    from monitor.service.servers.fleet import serve_fleet
    from monitor.settings.fleet import FleetSettings, load_fleet_settings
    from monitor.settings.notify import is_broker

    path, is_mqtt = Path(target), target.startswith(("mqtt://", "mqtts://"))
    if port is not None and not 1 <= port <= 65535:
        raise ArgumentError("--web-port", f"expected 1 to 65535, found {port}")
    if "://" not in target and path.suffix != ".toml":
        known = "postgresql://USER@HOST/NAME, mqtt://HOST/TOPIC or FLEET.toml"
        hint = f": a file holds one site (`modalwatch history {target}`)" if path.suffix in _FILES else ""
        raise ArgumentError("ADDRESS", f"expected {known}, found {target!r}{hint}")
    if is_mqtt and not is_broker(target):
        raise ArgumentError("ADDRESS", "expected mqtt://HOST/TOPIC, without wildcards")
    if "://" in target:
        settings = FleetSettings(mqtt=SecretStr(target)) if is_mqtt else FleetSettings(url=SecretStr(target))
    else:
        settings = load_fleet_settings(path)
    settings = settings if port is None else settings.model_copy(update={"port": port})
    with (
        TemporaryDirectory() as folder
    ):  # of a token that nobody needs: the page of an address is for this machine only
        serve_fleet(settings, Path(folder) if "://" in target else path.parent, lambda url: echo(f"fleet: {url}"))
    return DONE

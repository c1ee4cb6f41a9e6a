"""FLEET.toml: settings of the page of many sites."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, SecretStr, ValidationError, field_validator, model_validator

from daq.bounded_text import parse_toml
from monitor.errors import SettingsError
from monitor.settings.notify import is_broker
from monitor.settings.redaction import revealed
from monitor.settings.schema import listening_address
from monitor.settings.section import Section, has_place


def _pages(pages: dict[str, str]) -> dict[str, str]:
    for name, url in pages.items():
        if not has_place(url, ("http", "https")):
            raise ValueError(f"{name}: expected http://HOST or https://HOST")
    return pages


class FleetSettings(Section):
    """Sources of the states of many sites, and the server of their page."""

    url: Annotated[SecretStr | None, Field(examples=["postgresql://modalwatch@localhost/modalwatch"])] = None
    """Database: `postgresql://USER@HOST/NAME`. Required without `mqtt`."""
    mqtt: Annotated[SecretStr | None, Field(examples=["mqtt://broker.example.org/modalwatch"])] = None
    """Broker with present states: `mqtt://HOST:PORT/TOPIC`, or `mqtts://` with TLS. All sites are below TOPIC."""
    bind: Annotated[str, AfterValidator(listening_address)] = "127.0.0.1"
    """Address of the server."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8770
    """Port of the server."""
    token_file: str = "fleet_token"
    """File with the token, relative to FLEET.toml. It is made if it does not exist."""
    pages: Annotated[dict[str, str], AfterValidator(_pages)] = Field(default_factory=dict)
    """Address of the status page of a site, by name. Default: `web.url` of the site, or its page of the history."""
    hidden: tuple[str, ...] = ()
    """Names of sites that are not shown, such as dismantled ones."""

    @field_validator("mqtt")
    @classmethod
    def _broker(cls, url: SecretStr | None) -> SecretStr | None:
        if url is not None and not is_broker(revealed(url)):
            raise ValueError("expected mqtt://HOST/TOPIC or mqtts://HOST/TOPIC, without wildcards")
        return url

    @model_validator(mode="after")
    def _source(self) -> "FleetSettings":
        if self.url is None and self.mqtt is None:
            raise ValueError("expected url (a database), mqtt (a broker), or both")
        return self


def load_fleet_settings(path: Path) -> FleetSettings:
    """Read FLEET.toml.

    Raises
    ------
    SettingsError
        Naming the file and the key; values are not shown, they may be secrets.
    """
    try:
        return FleetSettings.model_validate(parse_toml(path.read_text(encoding="utf-8-sig")))
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        message = (
            "no such setting" if first["type"] == "extra_forbidden" else first["msg"].removeprefix("Value error, ")
        )
        place = ".".join(map(str, first["loc"]))
        raise SettingsError(path, f"{place}: {message}" if place else message) from error
    except OSError as error:
        raise SettingsError(path, f"cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise SettingsError(path, f"cannot be read: {error}") from error

"""[home_assistant]: discovery of the site by Home Assistant."""

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, SecretStr, field_validator

from monitor.settings.redaction import revealed
from monitor.settings.section import Section, has_place


def is_broker(address: str) -> bool:
    """Return whether an address is that of an MQTT broker, without wildcards in its topic."""
    return has_place(address, ("mqtt", "mqtts")) and not any(c in address.partition("://")[2] for c in "+#")


class HomeAssistantSettings(Section):
    """Entities of the site in Home Assistant, by MQTT discovery. Leave the section out for none."""

    mqtt: Annotated[SecretStr, Field(examples=["mqtt://broker.example.org/modalwatch/bridge"])]
    """`mqtt://HOST:PORT/TOPIC`, or `mqtts://` with TLS. Default topic: `modalwatch/SITE`. Requires extra `fleet`."""
    discovery: Annotated[str, Field(pattern=r"^[^/+#\s][^+#\s]*$")] = "homeassistant"
    """Prefix of the discovery topics, as set in Home Assistant."""

    if TYPE_CHECKING:  # plain strings become secrets

        def __init__(self, **values: Any) -> None: ...  # noqa: ANN401 - validated

    @field_validator("mqtt")
    @classmethod
    def _address(cls, url: SecretStr) -> SecretStr:
        if not is_broker(revealed(url)):
            raise ValueError("expected mqtt://HOST/TOPIC or mqtts://HOST/TOPIC, without wildcards")
        return url

"""[[notify]] and [home_assistant]: targets of notices, and discovery by Home Assistant."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import Field, SecretStr, ValidationInfo, field_validator, model_validator

from monitor.settings.redaction import revealed
from monitor.settings.section import Positive, Section, has_place
from monitor.text.notices import NoticeKind, check_template


class NotifySettings(Section):
    """Target of notices. Each has one of `webhook`, `command` and `mqtt`."""

    webhook: Annotated[SecretStr | None, Field(examples=["https://chat.example.org/hooks/abc"])] = None
    """URL that receives a JSON POST. Each `[[notify]]` has exactly one of `webhook`, `command`, `mqtt`."""
    command: Annotated[
        Annotated[tuple[SecretStr, ...], Field(min_length=1)] | None,
        Field(examples=[["mail", "-s", "modalwatch", "ada@example.org"]]),
    ] = None
    """Program and its arguments, as a list; it gets the text on its standard input."""
    mqtt: Annotated[SecretStr | None, Field(examples=["mqtt://broker.example.org/site/alarms"])] = None
    """`mqtt://HOST:PORT/TOPIC`, or `mqtts://` with TLS. Requires `modalwatch[fleet]`."""
    headers: Mapping[str, SecretStr] = {}
    """Headers of the webhook's request."""
    events: tuple[NoticeKind, ...] = ("alarm", "update", "recovery", "flapping", "trouble", "trend")
    """Events that are sent; `acknowledged` may be added."""
    template: Annotated[str | None, Field(examples=["{{ notice.site }}: {{ notice.text }}"])] = None
    """jinja2 template with `notices`. Default: the built-in text."""
    max_per_hour: Annotated[int, Field(ge=1)] = 12
    """Maximum number of messages per hour. Further notices are sent together later. Alarms are never delayed."""
    heartbeat_minutes: Annotated[Positive | None, Field(examples=[5.0])] = None
    """Interval of a message that confirms operation, sent only while data arrive [min]."""
    timeout_seconds: Positive = 10.0
    """Time limit of a delivery [s]."""

    if TYPE_CHECKING:  # plain strings become secrets

        def __init__(self, **values: Any) -> None: ...  # noqa: ANN401 - validated

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [name for name in ("webhook", "command", "mqtt") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of `webhook`, `command` and `mqtt`, found {' and '.join(given) or 'none'}")
        return self

    @field_validator("template")
    @classmethod
    def _renders(cls, template: str | None) -> str | None:
        if template is not None:
            check_template(template)
        return template

    @field_validator("headers")
    @classmethod
    def _can_be_sent(cls, headers: Mapping[str, SecretStr]) -> Mapping[str, SecretStr]:
        for name, secret in headers.items():
            line = name + revealed(secret)
            if not line.isascii() or not line.isprintable():
                raise ValueError(f"{name}: expected ASCII without line breaks")  # characters permitted in HTTP
        return headers

    @field_validator("webhook", "mqtt")
    @classmethod
    def _address(cls, url: SecretStr | None, info: ValidationInfo) -> SecretStr | None:
        schemes = ("http", "https") if info.field_name == "webhook" else ("mqtt", "mqtts")
        if url is not None and not has_place(revealed(url), schemes):
            raise ValueError(f"expected {schemes[0]}://HOST/.. or {schemes[1]}://HOST/..")
        return url


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

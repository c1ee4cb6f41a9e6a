"""[[notify]]: whom to tell, and of what."""

from collections.abc import Mapping
from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import Field, ValidationInfo, field_validator, model_validator

from monitor.notice_text import NoticeKind, check_template
from monitor.settings.section import Positive, Section


class NotifySettings(Section):
    """Whom to tell, and of what: each has one of `webhook`, `command` and `mqtt`."""

    webhook: Annotated[str | None, Field(examples=["https://chat.example.org/hooks/abc"])] = None
    """of each `[[notify]]`: address that gets a POST of JSON; one has this, `command` or `mqtt`"""
    command: Annotated[
        Annotated[tuple[str, ...], Field(min_length=1)] | None,
        Field(examples=[["mail", "-s", "modalwatch", "ada@example.org"]]),
    ] = None
    """program and its arguments, as a list; the text on its input"""
    mqtt: Annotated[str | None, Field(examples=["mqtt://broker.example.org/site/alarms"])] = None
    """`mqtt://HOST:PORT/TOPIC`, `mqtts://` with TLS; needs `modalwatch[fleet]`"""
    headers: Mapping[str, str] = {}
    """of the webhook's request"""
    on: tuple[NoticeKind, ...] = ("alarm", "update", "recovery", "flapping", "trouble", "trend")
    """events that are sent; `acknowledged` may be added (service.md)"""
    template: Annotated[str | None, Field(examples=["{{ notice.site }}: {{ notice.text }}"])] = None
    """jinja2 text of `notices`; the program's own unless given"""
    per_hour: Annotated[int, Field(ge=1)] = 12
    """messages; what comes beyond that is told together, later; an alarm never waits"""
    heartbeat_minutes: Annotated[Positive | None, Field(examples=[5.0])] = None
    """a sign of life this often, only while data flow"""
    timeout_seconds: Positive = 10.0
    """of a delivery"""

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
    def _can_be_sent(cls, headers: Mapping[str, str]) -> Mapping[str, str]:
        for name, value in headers.items():
            if not (name + value).isascii() or not (name + value).isprintable():
                raise ValueError(f"{name}: expected ASCII without line breaks")  # what servers may be sent
        return headers

    @field_validator("webhook", "mqtt")
    @classmethod
    def _address(cls, url: str | None, info: ValidationInfo) -> str | None:
        schemes = ("http", "https") if info.field_name == "webhook" else ("mqtt", "mqtts")
        if url is not None and (urlsplit(url).scheme not in schemes or not urlsplit(url).hostname):
            raise ValueError(f"expected {schemes[0]}://HOST/.. or {schemes[1]}://HOST/..")
        return url

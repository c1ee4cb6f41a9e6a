"""Commented template of all settings, and their JSON Schema."""

import json
import textwrap
from collections.abc import Iterator
from typing import Any

import tomlkit
from pydantic import SecretStr
from pydantic.fields import FieldInfo

from monitor.settings.device import DeviceSettings
from monitor.settings.reading import section_of
from monitor.settings.schema import Settings
from monitor.settings.section import Section, descriptions

_WIDTH = 110
_HEAD = """\
#:schema ./site.schema.json
# All settings of a site, with their defaults. A line that begins with # and no space is a setting that is not given,
# with an example. Write the schema for editors next to this file:
#     modalwatch settings --schema > site.schema.json
# An environment variable, MODALWATCH_ANALYSIS__WINDOW_SECONDS=300, overrides this file; `--set
# analysis.window_seconds=300` on the command line overrides both. Possible secrets are shown as **********.
"""


def _example(section: type[Section]) -> dict[str, Any]:
    """Return the minimum content of a section, from the examples of the fields without a default."""
    fields = section.model_fields.items()
    return {name: (field.examples or [None])[0] for name, field in fields if field.is_required()}


#: the minimum settings of a site: one device on a serial port
EXAMPLE = Settings(
    structure=(Settings.model_fields["structure"].examples or [""])[0],
    device=(
        DeviceSettings(**_example(DeviceSettings), port=(DeviceSettings.model_fields["port"].examples or [""])[0]),
    ),
)


def annotated(settings: Settings = EXAMPLE) -> str:
    """Return settings as TOML that reads back equal, each with its description; secrets as `**********`."""
    plain = {name: field for name, field in Settings.model_fields.items() if section_of(field.annotation) is None}
    meaning = descriptions(Settings)
    blocks = [
        "\n".join(
            _setting(name, field, getattr(settings, name), meaning.get(name, "")) for name, field in plain.items()
        )
    ]
    for name, field in Settings.model_fields.items():
        section = section_of(field.annotation)
        if section is None:
            continue
        value = getattr(settings, name)
        many = isinstance(field.default, tuple) or field.is_required()
        first, *others = (value or (None,)) if many else (value,)
        blocks += _table(f"[[{name}]]" if many else f"[{name}]", section, first)
        blocks += [_given(f"[[{name}]]", other) for other in others]
    return _HEAD + "\n" + "\n\n".join(blocks) + "\n"


def _table(head: str, section: type[Any], given: Section | None) -> Iterator[str]:
    """Yield a section, then those inside it; one that is not given has a # before all its lines."""
    comment = _comment(section.__doc__ or "")
    lines = [comment, head if given else f"#{head}"]
    inner, meaning = [], descriptions(section)
    for name, field in section.model_fields.items():
        below = section_of(field.annotation)
        value = getattr(given, name) if given else None
        if below is not None:
            inner.append((f"[{head.strip('[]')}.{name}]", below, value))
        else:
            lines.append(_setting(name, field, value, meaning.get(name, "")))
    yield "\n".join(lines)
    for head_below, below, value in inner:
        yield from _table(head_below, below, value)


def _given(head: str, section: Section) -> str:
    """Return one more section of a documented kind: only values that differ from the defaults."""
    values = section.model_dump(exclude_defaults=True, exclude_none=True)
    return "\n".join([head, *(f"{name} = {_toml(value)}" for name, value in values.items())])


def _setting(name: str, field: FieldInfo, value: Any, description: str) -> str:  # noqa: ANN401 - of any setting
    comment = _comment(description)
    above = f"{comment}\n" if comment else ""
    if value is None:
        default = None if field.is_required() else field.default
        shown = (field.examples or [None])[0] if default is None or (default == () and field.examples) else default
        return f"{above}#{name} = {_toml(shown)}"
    return f"{above}{name} = {_toml(value)}"


def _comment(text: str) -> str:
    return "\n".join(textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# "))


def _toml(value: Any) -> str:  # noqa: ANN401 - of any setting
    if isinstance(value, dict):
        return "{" + ", ".join(f"{tomlkit.key(key).as_string()} = {_toml(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(tomlkit.item(str(value) if isinstance(value, SecretStr) else value).as_string())


def json_schema() -> str:
    """Return the JSON Schema of SITE.toml."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "SITE.toml of modalwatch",
        **{key: value for key, value in Settings.model_json_schema().items() if key != "title"},
    }
    return json.dumps(schema, indent=2)

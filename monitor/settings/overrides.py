"""Settings from the environment and the command line: over the file's, and written into the text that is logged.

The log of a run holds its complete settings, so that a replay needs neither the environment nor the command line:
overrides are put into the text of SITE.toml before it is read. pydantic-settings merges values but keeps no text, and
its errors do not name the source of a value.
"""

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import tomlkit

from monitor.errors import ArgumentError, SettingsError

_PREFIX = "MODALWATCH_"
_KEY = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


@dataclass(frozen=True, kw_only=True)
class Override:
    """A setting given elsewhere than in the file."""

    source: str  #: source, for errors
    keys: tuple[str, ...]  #: keys of tables; in `device` and `notify` a number from 0, or a device's name
    value: Any  #: value as in TOML


def overrides(arguments: Sequence[str] = (), environment: Mapping[str, str] | None = None) -> tuple[Override, ...]:
    """Return the overrides of a file, the strongest last: the environment, then the command line.

    Parameters
    ----------
    arguments : KEY=VALUE each, such as analysis.window_seconds=300 or device.beam_left.rate=500
    environment : Default: that of the process; variables such as MODALWATCH_ANALYSIS__WINDOW_SECONDS are used, and
        MODALWATCH__STATE for settings outside sections; others with that prefix, without two underscores, are not

    Raises
    ------
    ArgumentError
        If an argument is no KEY=VALUE.
    """
    variables = os.environ if environment is None else environment
    names = sorted(name for name in variables if name.startswith(_PREFIX) and "__" in name[len(_PREFIX) - 1 :])
    keys = {name: tuple(name[len(_PREFIX) :].lower().strip("_").split("__")) for name in names}
    given = (Override(source=name, keys=keys[name], value=_value(variables[name])) for name in names)
    return (*given, *map(_of_argument, arguments))


def _of_argument(argument: str) -> Override:
    key, equals, text = argument.partition("=")
    if not equals or not _KEY.fullmatch(key.strip()):
        raise ArgumentError(
            "--set", f"expected KEY=VALUE, such as analysis.window_seconds=300, found {argument.partition('=')[0]!r}"
        )
    return Override(source=f"--set {key.strip()}", keys=tuple(key.strip().split(".")), value=_value(text.strip()))


def _value(text: str) -> Any:  # noqa: ANN401 - whatever TOML can say
    """Return a TOML value; any other text is a string, so that paths need no quotes."""
    try:
        return tomllib.loads(f"value = {text}\n")["value"] if "\n" not in text else text
    except tomllib.TOMLDecodeError:
        return text


def overridden(text: str, given: Sequence[Override]) -> tuple[str, dict[tuple[str, ...], str]]:
    """Return the text of SITE.toml with other values put in, and where each of those was given, by its place.

    Raises
    ------
    SettingsError
        If a place is inside something that is no table, or names a device that there is not.
    """
    document, origins = tomlkit.parse(text), {}
    for override in given:
        *parents, last = place = _place(document.unwrap(), override)
        table: Any = document
        for key in parents:
            if isinstance(table, list):
                table = table[int(key)]
                continue
            table.setdefault(key, tomlkit.table())
            table = table[key]
        table[last] = override.value
        origins[tuple(place)] = override.source
    return (tomlkit.dumps(document) if given else text), origins


def _place(content: Any, override: Override) -> list[str]:  # noqa: ANN401 - TOML
    """Return the keys of an override, list entries by their number."""
    place: list[str] = []
    for key in override.keys:
        if isinstance(content, list):
            if key is override.keys[-1]:
                raise SettingsError(
                    override.source, f"{'.'.join(place)}: expected a setting of one of them after its name"
                )
            number = _number(content, key, override)
            place.append(str(number))
            content = content[number]
            continue
        if not isinstance(content, dict):
            raise SettingsError(override.source, f"{'.'.join(place)} is a value, not a section")
        place.append(key)
        content = content.get(key, {})
    return place


def _number(entries: list[Any], key: str, override: Override) -> int:
    names = [str(entry.get("name", number)) if isinstance(entry, dict) else "" for number, entry in enumerate(entries)]
    for number, name in enumerate(names):
        if key.lower() in (str(number), name.lower()):
            return number
    raise SettingsError(override.source, f"{override.keys[0]}: expected one of {', '.join(names)}, found {key!r}")

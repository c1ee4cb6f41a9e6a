"""Reading and checking of SITE.toml; errors name file and key."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, SecretStr, ValidationError

from daq import CanAddress
from daq.bounded_text import meant, parse_toml
from daq.drivers import CanPlace, DaqmxAddress
from daq.log import HOW_TO_PLACE
from monitor.errors import SettingsError
from monitor.settings.device import DeviceSettings
from monitor.settings.overrides import Override, overridden, overrides
from monitor.settings.schema import Settings

_NO_SUCH = "extra_forbidden"


def parse_settings(
    text: str, path: Path | str = "SITE.toml", origins: Mapping[tuple[str, ...], str] | None = None
) -> Settings:
    """Read settings from TOML text.

    Parameters
    ----------
    text : of the file
    path : named in errors
    origins : setting -> source named in errors, if it was not given in the file

    Raises
    ------
    SettingsError
        Naming the file, the key, the found value and, for an unknown key, the nearest valid word.
    """
    try:
        content = parse_toml(text)
    except ValueError as error:
        raise SettingsError(path, str(error)) from error
    try:
        settings = Settings.model_validate(content)
    except ValidationError as error:
        raise _explained(error, path, origins or {}) from error
    _check_devices(settings, path)
    return settings


def _check_devices(settings: Settings, path: Path | str) -> None:
    """Refuse devices that are not distinguishable, or differ in the settings of their bus."""
    names = [device.name for device in settings.device] + [channel.name for channel in settings.channels]
    for repeated in sorted({name for name in names if names.count(name) > 1}):
        raise SettingsError(path, f"device: the name {repeated!r} is given twice")
    places = [str(device.place) for device in settings.device]
    for repeated in sorted({place for place in places if places.count(place) > 1}):
        of_logs = [str(device.place) for device in settings.device if device.log]
        hint = f": {HOW_TO_PLACE}" if repeated in of_logs else ""
        raise SettingsError(path, f"device: two are connected to {repeated}{hint}")
    daqmx = [device.place for device in settings.device if isinstance(device.place, DaqmxAddress)]
    inputs = [name for place in daqmx for name in place.inputs]
    for repeated in sorted({name for name in inputs if inputs.count(name) > 1}):
        raise SettingsError(path, f"device: two are connected to {repeated}")
    rates: dict[tuple[str, str], int] = {}
    for address in (device.place for device in settings.device):
        if isinstance(address, CanPlace) and rates.setdefault(address.bus, address.bitrate) != address.bitrate:
            raise SettingsError(
                path, f"device: {address} is at {address.bitrate} bit/s, its bus at {rates[address.bus]}"
            )
    _check_sync(settings, path)


def _check_sync(settings: Settings, path: Path | str) -> None:
    """Refuse devices on a bus that cannot sample on one SYNC."""
    first: dict[tuple[str, str], tuple[CanAddress, float, float | None]] = {}
    producers: dict[tuple[str, str], CanAddress] = {}
    for address, rate, delay in ((device.place, device.rate, device.delay_ms) for device in settings.device):
        if not isinstance(address, CanAddress) or not address.sync:
            continue
        other, its, late = first.setdefault(address.bus, (address, rate, delay))
        if its != rate:
            raise SettingsError(path, f"device: {address} is at {rate:g} Hz, {other} on the same SYNC at {its:g} Hz")
        if late != delay:
            raise SettingsError(path, f"device: {address} and {other} on one SYNC: expected one `delay_ms`")
        if address.sync == "producer" and (other := producers.setdefault(address.bus, address)) is not address:
            raise SettingsError(path, f"device: {address} and {other} both produce SYNC, expected one on a bus")


def read_settings(path: Path, given: Sequence[Override]) -> tuple[str, Settings]:
    """Read a settings file and apply overrides.

    Returns
    -------
    text : of the file, with overrides
    settings : the same, read; files that devices name are found from anywhere

    Raises
    ------
    SettingsError
        As for `parse_settings`; naming the variable or argument where a value was given there.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors begin with a mark
        parse_toml(text)
    except OSError as error:
        raise SettingsError(path, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SettingsError(path, f"cannot be read: {error}") from error
    except ValueError as error:
        raise SettingsError(path, str(error)) from error
    text, origins = overridden(text, given)
    return text, _from_folder(parse_settings(text, path, origins), path.parent)


def load_settings(path: Path) -> Settings:
    """Read a settings file, with overrides of the environment; errors as for `read_settings`."""
    return read_settings(path, overrides())[1]


def _from_folder(settings: Settings, folder: Path) -> Settings:
    """Return settings whose files - DBC, logs, temperature - have absolute paths."""

    def found(device: DeviceSettings) -> DeviceSettings:
        files = {"dbc": device.dbc, "log": device.log}
        return device.model_copy(
            update={
                name: section.model_copy(update={"file": str(folder / section.file)})
                for name, section in files.items()
                if section is not None
            }
        )

    copied: dict[str, object] = {"device": tuple(found(device) for device in settings.device)}
    if settings.temperature and settings.temperature.csv:
        path = str(folder / settings.temperature.csv)
        copied["temperature"] = settings.temperature.model_copy(update={"csv": path})
    return settings.model_copy(update=copied)


def _explained(error: ValidationError, path: Path | str, origins: Mapping[tuple[str, ...], str]) -> SettingsError:
    # a misspelt key is also a missing one: the former is reported
    first: Any = min(error.errors(), key=lambda e: e["type"] != _NO_SUCH)
    place = tuple(str(part) for part in first["loc"])
    origin = next((source for keys, source in origins.items() if place[: len(keys)] == keys), path)
    shown = ".".join(part for part in place if part != "[key]")  # a key of a table is named by itself
    return SettingsError(origin, f"{shown}: {_what(first, place)}" if place else _what(first, place))


def _what(first: Any, place: tuple[str, ...]) -> str:  # noqa: ANN401 - one of pydantic's errors
    if first["type"] == _NO_SUCH:
        return "no such setting" + meant(place[-1], _near(place))
    if first["type"] == "missing":
        return "is missing"
    message = first["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    message = message.replace("a valid tuple", "a list in brackets").replace("a valid dictionary", "a table")
    whole = isinstance(first["input"], dict) or "found" in message  # for a section the name is sufficient
    found = (
        message
        if whole or _may_be_secret(place)
        else f"{message.partition(', unable')[0]}, found {first['input']!r:.80}"
    )
    if first["type"] == "literal_error":
        return found + meant(str(first["input"]), re.findall(r"'([^']*)'", first["ctx"]["expected"]))
    return found


def _may_be_secret(place: Sequence[str]) -> bool:
    """Return whether a place in the settings is a secret, or a section that should hold some."""
    annotation: Any = Settings
    for key in place:
        section = section_of(annotation)
        if section is None or key.isdigit():
            continue
        if key not in section.model_fields:
            return True
        annotation = section.model_fields[key].annotation
    return _holds_secrets(annotation)


def _holds_secrets(annotation: Any) -> bool:  # noqa: ANN401 - any annotation of a field
    section = section_of(annotation)
    if section is not None:
        return any(_holds_secrets(field.annotation) for field in section.model_fields.values())
    return annotation is SecretStr or any(map(_holds_secrets, get_args(annotation)))


def _near(place: tuple[str, ...]) -> list[str]:
    """Return the settings of the section that a place is in; where none is near, those of all sections in full."""
    section: type[BaseModel] | None = Settings
    for key in place[:-1]:
        if section is not None and not key.isdigit():
            section = section_of(section.model_fields[key].annotation) if key in section.model_fields else None
    own = list(section.model_fields) if section else []
    return own if meant(place[-1], own) else list(_all_keys(Settings))


def _all_keys(section: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in section.model_fields.items():
        yield prefix + name
        inner = section_of(field.annotation)
        if inner is not None:
            yield from _all_keys(inner, f"{prefix}{name}.")


def section_of(annotation: Any) -> type[BaseModel] | None:  # noqa: ANN401 - any annotation of a field
    """Return the section that a field holds, or holds many of; None for a plain value."""
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None

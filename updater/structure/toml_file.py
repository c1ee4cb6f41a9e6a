"""Structures read from structure.toml and written back."""

from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import BaseModel, ValidationError

from daq.bounded_text import parse_toml
from daq.errors import system_reason
from updater.errors import StructureError
from updater.structure.base import not_known
from updater.structure.entries import (
    Body,
    BreathingCrack,
    External,
    Ground,
    Joint,
    Material,
    Member,
    Mesh,
    Oscillator,
    Recorder,
    Segment,
    Support,
    Updating,
)
from updater.structure.parameters import check_updating
from updater.structure.section_shapes import Section
from updater.structure.sensors import Correction, Sensor
from updater.structure.structure import Structure
from updater.structure.toml_rewrite import rewrite

_ENTRIES: dict[str, type[BaseModel]] = {
    "external": External,
    "material": Material,
    "section": Section,
    "mesh": Mesh,
    "member": Member,
    "support": Support,
    "joint": Joint,
    "segment": Segment,
    "body": Body,
    "oscillator": Oscillator,
    "ground": Ground,
    "breathing_crack": BreathingCrack,
    "sensor": Sensor,
    "sensors": Correction,
    "recorder": Recorder,
    "updating": Updating,
}
_STAND_FOR_OTHERS = {"external": ["matrices"], "material": ["poisson_ratio"], "section": ["shape"]}


def parse_structure(text: str, path: Path | str = "structure.toml") -> Structure:
    """Read a structure from TOML text.

    Raises
    ------
    StructureError
        Naming the file and the entry that is wrong.
    """
    try:
        content = parse_toml(text)
    except ValueError as error:
        raise StructureError(path, str(error)) from error
    try:
        structure = Structure.model_validate(content).beside(Path(path).parent)
        check_updating(structure)
    except ValidationError as error:
        raise StructureError(path, _wrong(error, content)) from error
    except ValueError as error:
        raise StructureError(path, str(error)) from error
    return structure


def _wrong(error: ValidationError, content: dict[str, Any]) -> str:
    """Return in one line which entry is wrong and why; an unknown key may explain the rest, and comes first."""
    found = error.errors()
    first = next((e for e in found if e["type"] == "extra_forbidden"), found[0])
    place = _place(first["loc"], content)
    if first["type"] == "extra_forbidden":
        return f"{place}: {not_known(str(first['loc'][-1]), _known_keys(first['loc']))}"
    message = first["msg"].removeprefix("Value error, ").replace("a valid tuple", "a list in brackets")
    return (
        f"{place}: {message}"
        if isinstance(first["input"], dict)
        else f"{place}: {message}, found {first['input']!r:.80}"
    )


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Return the keys that are allowed next to the one at a location."""
    kind = str(location[0]) if len(location) > 1 else ""
    fields = _ENTRIES.get(kind, Structure).model_fields.items()
    return sorted([field.alias or name for name, field in fields] + _STAND_FOR_OTHERS.get(kind, []))


def _place(location: tuple[int | str, ...], content: dict[str, Any]) -> str:
    """Return such as `member.0.to of column`."""
    place = ".".join(str(part) for part in location) or "structure"
    if len(location) < 2 or not isinstance(location[1], int):
        return place
    entry = content[str(location[0])][location[1]]
    name = entry.get("name") or entry.get("channel") if isinstance(entry, dict) else None
    return f"{place} of {name}" if isinstance(name, str) else place


def load_structure(path: Path | str) -> Structure:
    """Read a structure file.

    Raises
    ------
    StructureError
        If it cannot be read or an entry is wrong.
    """
    return parse_structure(_text(path), path)


def _text(path: Path | str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise StructureError(path, f"cannot be read: {system_reason(error)}") from error
    except UnicodeDecodeError as error:
        raise StructureError(path, "expected a structure file, found no text in UTF-8") from error


def portable_text(path: Path | str) -> str:
    """Return a structure file's text for use in another folder: files that it names have their whole path.

    Raises
    ------
    StructureError
        If it cannot be read or an entry is wrong.
    """
    external = load_structure(path).external
    text = _text(path)
    if external is None:
        return text
    content = tomlkit.parse(text)
    table = tomlkit.table()
    table.update(external.model_dump(mode="json", exclude_defaults=True))
    content["external"] = table
    return tomlkit.dumps(content)


def dump_structure(structure: Structure, onto: str | None = None, *, note: str = "") -> str:
    """Return a structure as TOML that `parse_structure` reads back equal.

    Parameters
    ----------
    structure : to write
    onto : text of a structure file; only differences are changed, and its comments are kept
    note : comment in each support, joint, segment, body, oscillator, crack, member or sensor that the text does not
        have, and at each value of a sensor that differs

    Raises
    ------
    StructureError
        If the text is no structure.
    """
    brief = structure.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    brief = {key: value for key, value in brief.items() if value}
    if onto is None:
        return tomlkit.dumps(brief)
    old, new = (s.model_dump(mode="json", by_alias=True) for s in (parse_structure(onto), structure))
    return rewrite(onto, old, new, brief, note)


def t_structure_toml() -> str:
    """Return the text of the shipped T-frame's structure file."""
    with as_file(files("updater.structure") / "t_structure.toml") as path:
        return path.read_text(encoding="utf-8")

"""The table of settings in docs/monitor.md is the one the program reads."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from monitor.settings import Settings

DOCS = Path(__file__).parents[2] / "docs" / "monitor.md"
REQUIRED, NONE = "(required)", "none"


def section_of(annotation: Any) -> type[BaseModel] | None:
    """Return the section that a field holds, or holds many of."""
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None


def default_of(field: FieldInfo) -> str:
    if field.is_required():
        return REQUIRED
    if field.default is None:
        return NONE
    return f'`"{field.default}"`' if isinstance(field.default, str) else f"`{field.default}`"


def settings_of(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, field in model.model_fields.items():
        section = section_of(field.annotation)
        if section:
            yield from settings_of(section, f"{prefix}{name}.")
        else:
            yield prefix + name, default_of(field)


def test_every_setting_stands_in_the_table_with_its_default() -> None:
    text = DOCS.read_text(encoding="utf-8").split("## Settings")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([\w.]+)` \| (.+?) \| .+ \|$", text, re.MULTILINE)
    assert dict(rows) == dict(settings_of(Settings)), "docs/monitor.md: the table of settings"

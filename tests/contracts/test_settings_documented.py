"""The table of settings in docs/reference/monitor.md has the settings of the program, with the same meaning."""

import re
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from monitor.settings import Settings
from monitor.settings.reading import section_of

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "monitor.md"
REQUIRED, NONE = "(required)", "none"


def default_of(field: FieldInfo) -> str:
    if field.is_required():
        return REQUIRED
    if field.default is None:
        return NONE
    return f'`"{field.default}"`' if isinstance(field.default, str) else f"`{field.default}`"


def rows_of(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in model.model_fields.items():
        section = section_of(field.annotation)
        if section:
            yield from rows_of(section, f"{prefix}{name}.")
        else:
            yield f"| `{prefix}{name}` | {default_of(field)} | {field.description} |"


def test_settings_table_in_docs_matches_the_program() -> None:
    text = DOCS.read_text(encoding="utf-8").split("## Settings")[1].split("\n## ")[0]
    without_links = re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", text)
    rows = [line for line in without_links.splitlines() if line.startswith("| `")]
    assert rows == list(rows_of(Settings)), "docs/reference/monitor.md: the table of settings"

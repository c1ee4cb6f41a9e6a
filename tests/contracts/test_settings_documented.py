"""The reference of the settings has every setting of the program, with its default and its meaning."""

from collections.abc import Iterator

import pytest
from pydantic import BaseModel

from docs._site.program import settings
from monitor.settings import Settings
from monitor.settings.reading import section_of
from monitor.settings.section import descriptions


def fields_of(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield section, key and meaning of all settings."""
    meanings = descriptions(model)
    for name, field in model.model_fields.items():
        section = section_of(field.annotation)
        if section:
            yield from fields_of(section, f"{prefix}.{name}".lstrip("."))
        else:
            yield prefix, name, meanings.get(name, "")


@pytest.fixture(scope="module")
def sections() -> dict[str, str]:
    """Return the text of the reference by section."""
    parts = settings().split("\n## ")
    return {part.partition("\n")[0].strip("`[]# "): part for part in parts}


def test_reference_has_every_setting_with_its_meaning(sections: dict[str, str]) -> None:
    found = list(fields_of(Settings))
    assert len(found) > 60
    for section, key, meaning in found:
        rows = [line for line in sections[section or "Top level"].splitlines() if line.startswith(f"| `{key}` |")]
        assert len(rows) == 1, (section, key)
        assert meaning, (section, key)
        assert rows[0].endswith(f"| {meaning} |"), (section, key)

"""Common part of all sections of the settings."""

import ast
import inspect
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, ValidationInfo, field_validator

Positive = Annotated[float, Field(gt=0)]
_SMALLEST, _LARGEST = 1e-20, 1e9  # of a number with a fraction that is not 0


class Table(BaseModel):
    """Table of a settings file: frozen, unknown keys and implausible numbers are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _plausible(cls, given: object, info: ValidationInfo) -> object:
        """Refuse truth values where numbers are expected (Python takes them for 1 and 0), and absurd magnitudes."""
        field = cls.model_fields[info.field_name or ""]
        for value in given if isinstance(given, list | tuple) else (given,):
            if isinstance(value, bool) and field.annotation is not bool:
                raise ValueError("expected no truth value")
            if isinstance(value, float) and value and not _SMALLEST <= abs(value) <= _LARGEST:
                raise ValueError(f"expected a number from {_SMALLEST:g} to {_LARGEST:g}")
        return given


class Section(Table):
    """A table of SITE.toml: every setting is defined here once, with its default and its description.

    The text below a field is its description: in `modalwatch settings`, in the JSON Schema and, checked by a test, in
    the reference of the settings in the documentation. A field without a default has an example.
    """

    model_config = ConfigDict(hide_input_in_errors=True)  # it may be a secret

    @classmethod
    def __get_pydantic_json_schema__(
        cls,
        schema: Any,  # noqa: ANN401 - of pydantic_core
        handler: GetJsonSchemaHandler,
    ) -> dict[str, Any]:
        """Return the JSON Schema with the descriptions of the fields."""
        found = handler(schema)
        properties = handler.resolve_ref_schema(found)["properties"]
        for name, text in descriptions(cls).items():
            properties[name]["description"] = text
        return found


def descriptions(section: type[BaseModel]) -> Mapping[str, str]:
    """Return the description of each field, from the source; none if the source is not installed.

    Read only on request, as it takes a millisecond.
    """
    try:
        [definition] = ast.parse(inspect.getsource(section)).body
    except OSError:
        return {}
    return {
        field.target.id: inspect.cleandoc(text.value.value)
        for field, text in pairwise(getattr(definition, "body", ()))
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
    }


def has_place(url: str, schemes: Sequence[str]) -> bool:
    """Return whether an address has one of the schemes, a host, and a port that is a number if it has one."""
    try:
        place = urlsplit(url)
        return place.scheme in schemes and bool(place.hostname) and (place.port is None or place.port > 0)
    except ValueError:
        return False

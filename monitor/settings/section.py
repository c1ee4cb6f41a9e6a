"""What all sections of the settings have in common."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]


class Section(BaseModel):
    """A table of SITE.toml: every setting is spelled here, with its default, and said what it means, once.

    The text below a field is its description: in `modalwatch settings`, in the JSON Schema and, as a test sees to, in
    the table of docs/monitor.md. A field without a default of its own has an example.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

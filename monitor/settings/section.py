"""What all sections of the settings have in common."""

from collections.abc import Sequence
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]


class Section(BaseModel):
    """A table of SITE.toml: every setting is spelled here, with its default, and said what it means, once.

    The text below a field is its description: in `modalwatch settings`, in the JSON Schema and, as a test sees to, in
    the table of docs/monitor.md. A field without a default of its own has an example.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        use_attribute_docstrings=True,
        allow_inf_nan=False,
        hide_input_in_errors=True,  # it may be a secret
    )


def has_place(url: str, schemes: Sequence[str]) -> bool:
    """Return whether an address has one of the schemes, a host, and a port that is a number if it has one."""
    try:
        place = urlsplit(url)
        return place.scheme in schemes and bool(place.hostname) and (place.port is None or place.port > 0)
    except ValueError:
        return False

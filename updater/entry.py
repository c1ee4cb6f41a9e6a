"""What every entry of structure.toml is: frozen, and refusing keys it does not know."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

_LARGEST = 1e30  # of any figure: products of them stay numbers
_FARTHEST = 1e6  # m

Positive = Annotated[float, Field(gt=0, lt=_LARGEST)]
NotNegative = Annotated[float, Field(ge=0, lt=_LARGEST)]
Number = Annotated[float, Field(gt=-_LARGEST, lt=_LARGEST)]
Coordinate = Annotated[float, Field(ge=-_FARTHEST, le=_FARTHEST)]
Vector = tuple[Coordinate, Coordinate, Coordinate]


class Entry(BaseModel):
    """One table of structure.toml."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)

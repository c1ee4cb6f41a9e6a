"""Base model of the entries of structure.toml: frozen, unknown keys are errors."""

from collections.abc import Collection
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from daq.bounded_text import meant

_LARGEST = 1e30  # of any figure: products of them stay numbers
_SMALLEST = 1e-30  # of a positive one: their quotients too
_FARTHEST = 1e6  # m
ON_MEMBER = 1e-4  #: distance from the axis of a member within which a point is on it [m]


def _no_truth_value(given: object) -> object:
    """Refuse true and false where a number is expected: Python takes them for 1 and 0."""
    if isinstance(given, bool):
        raise ValueError("expected a number")
    return given


def _not_tiny(value: float) -> float:
    """Refuse numbers whose quotients are not finite."""
    if value < _SMALLEST:
        raise ValueError(f"expected at least {_SMALLEST:g}")
    return value


_Float = Annotated[float, BeforeValidator(_no_truth_value)]
Count = Annotated[int, BeforeValidator(_no_truth_value)]
Positive = Annotated[_Float, Field(gt=0, lt=_LARGEST), AfterValidator(_not_tiny)]
NotNegative = Annotated[_Float, Field(ge=0, lt=_LARGEST)]
Number = Annotated[_Float, Field(gt=-_LARGEST, lt=_LARGEST)]
Coordinate = Annotated[_Float, Field(ge=-_FARTHEST, le=_FARTHEST)]
Vector = tuple[Coordinate, Coordinate, Coordinate]


class Entry(BaseModel):
    """One table of structure.toml."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)


def not_known(word: str, known: Collection[str]) -> str:
    """Return the error for an unknown key, with the nearest key and all keys."""
    return f"not a known key{meant(word, known)}; known here are {', '.join(known)}"

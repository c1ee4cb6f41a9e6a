"""Draws of which the tests take the first ones, and `make thorough` all others."""

from collections.abc import Sequence
from typing import Any

import pytest


def few_of(values: Sequence[Any], n: int = 1) -> list[Any]:
    """Return parameters of a test, all but the first n marked as thorough."""
    more = [v if isinstance(v, tuple) else (v,) for v in values[n:]]
    return [*values[:n], *(pytest.param(*v, marks=pytest.mark.thorough) for v in more)]

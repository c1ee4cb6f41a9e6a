"""Which column of a table, or array of a file, holds the times."""

import re
from collections.abc import Collection

_CALLED = re.compile(r"(t|time)\s*([\[(]\s*(s|sec|seconds)\s*[\])])?", re.IGNORECASE)


def time_column(names: Collection[str], asked: str | None) -> str | None:
    """Return the name of the column of times [s], None where there is none.

    Parameters
    ----------
    names : of all columns
    asked : the name that it should have; else ``t`` or ``time``, large or small, with ``[s]`` or ``(s)`` or without
    """
    if asked is not None:
        return asked if asked in names else None
    return next((name for name in names if _CALLED.fullmatch(name.strip())), None)


def no_times(names: Collection[str], asked: str | None) -> str:
    """Say that there is no such column, and what to do."""
    what = "of times [s], as 't' or 'time (s)'" if asked is None else f"{asked!r} of times [s]"
    return f"has no column {what}, but {', '.join(names):.100}: give --time NAME or --rate"

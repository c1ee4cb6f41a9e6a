"""Parts that objects shown in a notebook share: optional packages, and values and tables as text."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from html import escape

import numpy as np


@contextmanager
def notebook_extra() -> Iterator[None]:
    """Import packages of the extra `notebook` inside this context.

    Raises
    ------
    ImportError
        Naming the extra, if the package is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise ImportError(
            f"{error.name} is not installed: pip install 'modalwatch[notebook]'", name=error.name
        ) from error


def number_text(value: float, std: float) -> str:
    """Return a value and its standard deviation, rounded to its first digit, or its second if the first is 1 or 2."""
    if not (math.isfinite(std) and std > 0):
        return f"{value:.4g}"
    power = math.floor(math.log10(std))
    digits = -power + (std < 2.95 * 10.0**power)
    shown = max(0, digits)
    return f"{round(value, digits) + 0.0:.{shown}f} ± {round(std, digits):.{shown}f}"  # no minus before 0


def utc_text(time: int) -> str:
    """Return a time [ns UTC] to the second."""
    return f"{str(np.datetime64(time, 'ns'))[:19].replace('T', ' ')} UTC"


def html_table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as HTML; all texts are escaped."""

    def row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    body = "".join(row("td", cells) for cells in rows)
    return f"<table><caption>{escape(caption)}</caption><thead>{row('th', head)}</thead><tbody>{body}</tbody></table>"

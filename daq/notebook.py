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


def number_text(value: float, std: float, *, sign: bool = False) -> str:
    """Return a value and its standard deviation, rounded to its first digit, or its second if the first is 1 or 2.

    With `sign` a positive value has a sign, too.
    """
    if not (math.isfinite(std) and std > 0):
        return rounded_text(value, std, sign=sign)
    digits = _decimals(std)
    return f"{rounded_text(value, std, sign=sign)} ± {round(std, digits):.{max(0, digits)}f}"


def rounded_text(value: float, std: float, *, sign: bool = False) -> str:
    """Return a value with the decimals that `number_text` gives it, without its standard deviation.

    Parameters
    ----------
    value, std : value and its standard deviation; four digits if that is not known
    sign : whether a positive value has a sign, too
    """
    plus = "+" if sign else ""
    if not (math.isfinite(std) and std > 0):
        return f"{value:{plus}.4g}"
    digits = _decimals(std)
    return f"{round(value, digits) + 0.0:{plus}.{max(0, digits)}f}"  # no minus before 0


def _decimals(std: float) -> int:
    """Return the decimals to round to, negative before the point."""
    power = math.floor(math.log10(std))
    return -power + (std < 2.95 * 10.0**power)


def utc_text(time: int) -> str:
    """Return a time [ns UTC] to the second."""
    return f"{str(np.datetime64(time, 'ns'))[:19].replace('T', ' ')} UTC"


def html_table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as HTML; all texts are escaped."""

    def row(tag: str, cells: Sequence[str]) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    body = "".join(row("td", cells) for cells in rows)
    return f"<table><caption>{escape(caption)}</caption><thead>{row('th', head)}</thead><tbody>{body}</tbody></table>"

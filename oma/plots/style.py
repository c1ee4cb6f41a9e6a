"""Colours and style of figures on a page, without global state."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

INK, SOFT, FAINT = "#1d2733", "#66707c", "#d8dde3"
OK, ALARM = "#2f9e62", "#cc3340"
WIDTH = 5.2  #: inches: half of the page, all of a telephone's
_STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "legend.frameon": False,
    "svg.hashsalt": "modalwatch",  # the same figure gives the same bytes
    "svg.fonttype": "path",
}


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inches] with automatic layout."""
    return Figure(figsize=(width, height), layout="constrained")


@contextmanager
def styled() -> Iterator[None]:
    """Draw and save figures in the page's style; the previous style is restored."""
    with mpl.rc_context(_STYLE):
        yield
